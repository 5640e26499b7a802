"""Access rules, size limits and rate limits for Zenoh, derived from roles and the topic table.

They are part of the configuration of the listening session, or of a router: Zenoh refuses forbidden
messages before they reach this program. A role is named after what the *other* side does, as listed
in ``protocol/security.md``.

* Everything that is not named is denied. Each key is named, as ``**`` does not match a chunk that
  begins with ``@``; so is ``<key>/@adv/**``, by which Zenoh's advanced publishers serve late
  joiners.
* A role that speaks on a key may publish, reply to queries and declare a liveliness token there; a
  role that listens may subscribe, query and look for tokens. Neither may delete.
* Rules hold in both directions: a message that a role may not receive is not sent to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from fasaco_edge.wire.limits import MAX_GRID_CELLS, MAX_JSON_BYTES
from fasaco_edge.wire.query_table import QUERIES, RPC_NAMES, Query
from fasaco_edge.wire.topic_types import Topic
from fasaco_edge.wire.topics import TOPICS

SPEAK = ("put", "reply", "declare_queryable", "liveliness_token")
LISTEN = ("declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query")

# Bytes of a map besides its cells: numbers and a frame name. A path's attachment is smaller.
HEADER_BYTES = 1024
# Largest size of a pose: a nav_msgs/Odometry with two covariances and two names [bytes].
POSE_BYTES = 4096
JSON_BYTES = MAX_JSON_BYTES + HEADER_BYTES
Hertz = Annotated[float, Meta(gt=0, le=10_000)]

Entry = Topic | Query
ENTRIES: tuple[Entry, ...] = (*TOPICS, *QUERIES)
TOKENS = tuple(entry.suffix for entry in ENTRIES if entry.size_class == "token")


@dataclass(frozen=True, slots=True)
class Role:
    """Rights of the other side, by topic (the last part of a key).

    Attributes:
        description: the rights in words, for people.
        speaks: topics that it may publish, and on which it may reply to queries.
        listens: topics that it may subscribe to and query.
        asked: topics whose subscribers are announced to it, on this robot's key and on the key of
            all robots: it publishes only to subscribers.
        includes: another role whose rights it also has, or "".
    """

    description: str
    speaks: tuple[str, ...] = ()
    listens: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    includes: str = ""


def _role(name: str, description: str, includes: str = "") -> Role:
    return Role(
        description,
        speaks=tuple(entry.suffix for entry in ENTRIES if entry.speaker == name),
        listens=tuple(entry.suffix for entry in ENTRIES if name in entry.listeners),
        includes=includes,
    )


EVERYTHING = tuple(entry.suffix for entry in ENTRIES)

ROLES: Mapping[str, Role] = {
    "mapper": _role("mapper", "publishes maps, map updates, poses, the battery and scans"),
    "viewer": _role("viewer", "sees path, status, coverage and pheromone"),
    "operator": _role("operator", "commands the mission, and views", includes="viewer"),
    "recorder": _role(
        "recorder",
        "receives all but keep-out mask and scans, publishes its status",
        includes="viewer",
    ),
    "driver": _role(
        "driver",
        "drives the robot: publishes cmd_vel, says what blocks it, and views",
        includes="viewer",
    ),
    # Topics that the configuration names: see ``ros_rights``.
    "ros": Role(
        "publishes maps, updates, poses, battery and scans on ROS 2 topics, sees path, coverage "
        "and diagnostics, commands by services"
    ),
    # The router that a daemon connects to; it must restrict its other clients itself.
    "router": Role("forwards everything, both ways", speaks=EVERYTHING, listens=EVERYTHING),
    "fleet": replace(
        _role("fleet", "another robot of the fleet, besides its own role"), asked=("fleet",)
    ),
    # The daemon itself, as a router sees it.
    "robot": _role("robot", "plans: receives maps, publishes paths"),
}


@dataclass(frozen=True, slots=True)
class Grant:
    """A role granted to names, for one robot or all.

    Attributes:
        role: one of ROLES.
        names: common names of certificates, or user names; a name may have several roles.
        prefix: first part of the keys: ``fasaco/@v1/robot``, ``fasaco/@v1/*`` for all robots;
            "" where topics are whole keys.
        of: distinguishes several grants of one role, each with its prefix; "" for a single grant.
        rights: rights of the role; None for the rights in ROLES.
    """

    role: str
    names: Sequence[str]
    prefix: str
    of: str = ""
    rights: Role | None = None

    @property
    def title(self) -> str:
        """Its name in Zenoh's configuration."""
        return f"{self.role} of {self.of}" if self.of else self.role


class SenderLimits(msgspec.Struct, frozen=True):
    """Largest size [bytes] and rate [1/s] of the messages of each sender.

    Zenoh drops larger messages; above the rate it passes on the first message of each period and
    drops the others. Map updates have no rate limit: a lost update would corrupt the map unnoticed.
    """

    map_bytes: Annotated[int, Meta(ge=HEADER_BYTES)] = MAX_GRID_CELLS + HEADER_BYTES
    maps_hz: Hertz = 100.0
    poses_hz: Hertz = 200.0
    queries_hz: Hertz = 100.0


def access_control(grants: Sequence[Grant], attribute: str) -> dict[str, Any]:
    """Return Zenoh's ``access_control``: everything that is not granted is denied.

    Args:
        grants: the roles granted. A grant without names is skipped: Zenoh would grant it to all.
        attribute: kind of the names: "cert_common_names" or "usernames".
    """
    rules: dict[str, dict[str, Any]] = {}
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for grant in grants:
        if not grant.names:
            continue
        granted = [rule for part in _parts(grant) for rule in _rules(part)]
        rules |= {rule["id"]: rule for rule in granted}
        subjects.append({"id": grant.title, attribute: list(grant.names)})
        policies.append({"rules": [rule["id"] for rule in granted], "subjects": [grant.title]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": list(rules.values()),
        "subjects": subjects,
        "policies": policies,
    }


def limits(prefix: str, most: SenderLimits) -> dict[str, Any]:
    """Return Zenoh's ``low_pass_filter`` and ``downsampling`` for incoming messages."""
    published = ["put", "reply"]
    classes: dict[str, list[str]] = {}
    for entry in ENTRIES:
        classes.setdefault(entry.size_class, []).append(entry.suffix)
    # Queries on the keys of these topics are answered with the last sample, as by a storage.
    answered = [topic.suffix for topic in TOPICS if topic.name in RPC_NAMES]
    sizes = (
        ("grids and paths", published, classes["large"], most.map_bytes),
        ("poses", published, classes["pose"], POSE_BYTES),
        ("JSON", published, classes["json"], JSON_BYTES),
        ("queries", ["query"], EVERYTHING, JSON_BYTES),
    )
    queries = (*answered, *(query.suffix for query in QUERIES))
    rates = (
        ("maps and poses", "put", {"map": most.maps_hz, "pose": most.poses_hz}),
        ("queries", "query", dict.fromkeys(queries, most.queries_hz)),
    )
    return {
        "low_pass_filter": [
            {
                "id": what,
                "flows": ["ingress"],
                "messages": messages,
                "key_exprs": _keys(prefix, topics),
                "size_limit": size,
            }
            for what, messages, topics, size in sizes
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


def ros_rights(inputs: Sequence[str], outputs: Sequence[str], graph: Sequence[str]) -> Role:
    """Return the rights of the other side in a ROS 2 graph, with keys of the daemon's inputs and
    outputs, and of the liveliness tokens of nodes."""
    return Role(ROLES["ros"].description, speaks=(*inputs, *graph), listens=(*outputs, *graph))


def mutual_tls(root_ca: str, certificate: str, private_key: str) -> dict[str, Any]:
    """Return Zenoh's ``transport`` with certificates of a CA on both sides (PEM files)."""
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


def user_password(user: str, password: str, dictionary_file: str) -> dict[str, Any]:
    """Return Zenoh's ``transport`` with authentication by user and password.

    ``dictionary_file``: lines ``user:password`` of the users that may connect here, or "".
    """
    login: dict[str, str] = {"user": user, "password": password}
    if dictionary_file:
        login["dictionary_file"] = dictionary_file
    return {"auth": {"usrpwd": login}}


def _parts(grant: Grant) -> Iterator[Grant]:
    """Yield the grant, and the grants of the roles that it includes."""
    yield grant
    included = ROLES[grant.role].includes
    if included:
        yield from _parts(replace(grant, role=included))


def _rules(grant: Grant) -> Iterator[dict[str, Any]]:
    role = grant.rights or ROLES[grant.role]
    for what, flow, messages, topics in (
        ("speaks", "ingress", SPEAK, role.speaks),
        ("is heard", "egress", LISTEN, role.speaks),
        ("listens", "ingress", LISTEN, role.listens),
        ("is told", "egress", SPEAK, role.listens),
        ("is asked", "egress", LISTEN, role.asked),
    ):
        if topics:
            yield {
                "id": f"{grant.title} {what}",
                "permission": "allow",
                "flows": [flow],
                "messages": list(messages),
                "key_exprs": _keys(grant.prefix, topics),
            }


def _keys(prefix: str, topics: Sequence[str]) -> list[str]:
    """Return the keys of topics and the keys that serve their late joiners."""
    begin = f"{prefix}/" if prefix else ""
    published = [topic for topic in topics if topic not in TOKENS and topic[0] != "@"]
    return [begin + topic for topic in topics] + [f"{begin}{one}/@adv/**" for one in published]
