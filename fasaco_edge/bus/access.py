"""Who may speak: Zenoh's own access control, sizes and rates, made from roles.

All of it is configuration of the session that listens (or of a router): Zenoh itself refuses what
is not allowed, before a byte of it reaches this program. Roles are named by what the *other* side
does, as ``protocol/README.md`` lists them.

* Nothing is allowed that is not named. ``**`` does not match a chunk that begins with ``@``, so
  every key is named, and beside it what Zenoh's advanced publishers and subscribers use to serve
  late joiners: ``<key>/@adv/**``.
* Who speaks on a key may publish it, answer for it, and say by a liveliness token that it is
  there; who listens may subscribe to it, ask it, and look for tokens. Neither may delete.
* Rules hold in both directions: what a role may not hear is not sent to it either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

SPEAK = ("put", "reply", "declare_queryable", "liveliness_token")
LISTEN = ("declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query")

MAPS = ("map", "map_update")
VIEWS = ("path", "status", "coverage", "pheromone", "alive")
VIEW_QUERIES = ("@rpc/path", "@rpc/status", "@rpc/coverage")
SAID_BY_ROBOT = (*VIEWS, "command", *VIEW_QUERIES, "@rpc/mission")
HEARD_BY_ROBOT = (*MAPS, "pose", "recorder")
EVERYTHING = (*HEARD_BY_ROBOT, *SAID_BY_ROBOT)
# To ask @rpc/mission is to command.
TOPICS = (*HEARD_BY_ROBOT, *VIEWS, "command", *VIEW_QUERIES)


@dataclass(frozen=True, slots=True)
class Role:
    """What the other side may do, by topics: what its keys end with.

    Attributes:
        speaks: topics it may publish and answer for.
        listens: topics it may subscribe to and ask.
        told: the same for people.
    """

    speaks: tuple[str, ...]
    listens: tuple[str, ...]
    told: str


ROLES: Mapping[str, Role] = {
    "mapper": Role((*MAPS, "pose"), (), "gives maps, map updates and poses"),
    "viewer": Role((), (*VIEWS, *VIEW_QUERIES), "sees path, status, coverage and pheromone"),
    "operator": Role(
        (), (*VIEWS, "command", *VIEW_QUERIES, "@rpc/mission"), "commands the mission, and views"
    ),
    "recorder": Role(("recorder",), TOPICS, "hears everything, and says how it is itself"),
    # Whom a daemon connects to: what others may do there, the router itself has to restrict.
    "router": Role(EVERYTHING, EVERYTHING, "passes everything on, both ways"),
    # The daemon itself, as a router sees it.
    "robot": Role(SAID_BY_ROBOT, HEARD_BY_ROBOT, "plans: hears maps, says paths"),
}


@dataclass(frozen=True, slots=True)
class Limits:
    """How large [bytes] and how frequent [1/s] what comes in may be, for each who sends it.

    Zenoh drops what is larger; of what is more frequent it passes the first of each period and
    drops the others. Map updates have no rate: a lost one would spoil the map unnoticed.
    """

    map_bytes: int
    pose_bytes: int
    json_bytes: int
    maps_hz: float
    poses_hz: float
    queries_hz: float


def access_control(
    prefixes: Mapping[str, str], names: Mapping[str, Sequence[str]], attribute: str
) -> dict[str, Any]:
    """Return Zenoh's ``access_control``: everything is denied but what roles allow.

    Args:
        prefixes: of each role, what the keys it may use begin with: ``fasaco/@v1/robot``, or
            ``fasaco/@v1/*`` for those of all robots. "" stands for all others.
        names: who has each role; one name may have several.
        attribute: what the names are: "cert_common_names" or "usernames".
    """
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for role, who in names.items():
        if not who:
            continue  # an empty list would mean everybody
        of_role = _rules(role, prefixes.get(role, prefixes.get("", "")))
        rules += of_role
        subjects.append({"id": role, attribute: list(who)})
        policies.append({"rules": [rule["id"] for rule in of_role], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def limits(prefix: str, most: Limits) -> dict[str, Any]:
    """Return Zenoh's ``low_pass_filter`` and ``downsampling`` for what comes in."""
    sizes = (
        ("maps", MAPS, most.map_bytes),
        ("poses", ("pose",), most.pose_bytes),
        ("the rest", ("recorder", *SAID_BY_ROBOT), most.json_bytes),
    )
    queries = (*VIEWS, *VIEW_QUERIES, "@rpc/mission")
    rates = (
        ("maps and poses", "put", {"map": most.maps_hz, "pose": most.poses_hz}),
        ("queries", "query", dict.fromkeys(queries, most.queries_hz)),
    )
    return {
        "low_pass_filter": [
            {
                "id": what,
                "flows": ["ingress"],
                "messages": ["put", "query", "reply"],
                "key_exprs": _keys(prefix, topics),
                "size_limit": size,
            }
            for what, topics, size in sizes
        ],
        "downsampling": [
            {
                "id": what,
                "flows": ["ingress"],
                "messages": [message],
                "rules": [
                    {"key_expr": f"{prefix}/{key}", "freq": hz} for key, hz in by_key.items()
                ],
            }
            for what, message, by_key in rates
        ],
    }


def mutual_tls(root_ca: str, certificate: str, private_key: str) -> dict[str, Any]:
    """Return Zenoh's ``transport`` where both sides show a certificate of the CA (PEM files)."""
    tls = {
        "root_ca_certificate": root_ca,
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": private_key,
        "connect_certificate": certificate,
        "connect_private_key": private_key,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    return {"link": {"protocols": ["tls"], "tls": tls}}


def user_password(user: str, password: str, dictionary_file: str = "") -> dict[str, Any]:
    """Return Zenoh's ``transport`` where both sides know a password.

    Args:
        user, password: of this session.
        dictionary_file: lines ``user:password`` of those that may connect to this session.
    """
    login: dict[str, str] = {"user": user, "password": password}
    if dictionary_file:
        login["dictionary_file"] = dictionary_file
    return {"auth": {"usrpwd": login}}


def _rules(role: str, prefix: str) -> list[dict[str, Any]]:
    part = ROLES[role]
    grants = (
        ("speaks", "ingress", SPEAK, part.speaks),
        ("is heard", "egress", LISTEN, part.speaks),
        ("listens", "ingress", LISTEN, part.listens),
        ("is told", "egress", SPEAK, part.listens),
    )
    return [
        {
            "id": f"{role} {what}",
            "permission": "allow",
            "flows": [flow],
            "messages": list(messages),
            "key_exprs": _keys(prefix, topics),
        }
        for what, flow, messages, topics in grants
        if topics
    ]


def _keys(prefix: str, topics: Sequence[str]) -> list[str]:
    return [f"{prefix}/{topic}{more}" for topic in topics for more in ("", "/@adv/**")]
