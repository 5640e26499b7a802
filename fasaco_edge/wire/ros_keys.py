"""Names of ROS 2 on Zenoh: keys, liveliness tokens, attachments, type hashes, actions.

Sources: ros2/rmw_zenoh, docs/design.md at commit 99a6a2b (keys, tokens), rmw_zenoh_cpp at
commit 3411fde (``liveliness_utils.cpp``: tokens, quality of service) and 5347477
(``attachment_helpers.cpp``: as changed by #601, in 0.1.2 for Humble; older ones differ).
eclipse-zenoh/zenoh-plugin-ros2dds at commit ebdb1e0 (``route_subscriber.rs``).

Humble has no type hashes: it writes ``TypeHashNotSupported``, and does not match endpoints that
send a type hash.

An action is three services and two topics below ``<action>/_action``, also for rmw_zenoh and
zenoh-bridge-ros2dds. Sources: rcl_action of Jazzy (names),
rmw_zenoh_cpp at commit 028bbe3 (``rmw_service_data.cpp``: attachment of a request; sequence numbers
must not repeat), nav2_msgs of Humble, Iron, Jazzy and Lyrical. Hashes follow REP 2016; the hash of
CancelGoal is also published.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from fasaco_edge.wire import schemas

TYPE_HASHES = {
    schemas.OCCUPANCY_GRID: "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    schemas.OCCUPANCY_GRID_UPDATE: (
        "c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8"
    ),
    schemas.POSE_STAMPED: "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    schemas.POSE_WITH_COVARIANCE_STAMPED: (
        "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e"
    ),
    schemas.ODOMETRY: "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    schemas.TF_MESSAGE: "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    schemas.TWIST: "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    schemas.TWIST_STAMPED: "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    schemas.BATTERY_STATE: "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
    schemas.LASER_SCAN: "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    schemas.DIAGNOSTIC_ARRAY: "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    schemas.PATH: "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
}
"""Hash of each type's definition, in hexadecimal, version 1 (REP 2016)."""

TRIGGER: Final = "std_srvs/srv/Trigger"
SERVICE_HASHES = {TRIGGER: "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"}
"""Hash of each service, over request, response and event."""

GID_BYTES = 16

# Sequence number, time [ns], length of the gid, gid: Zenoh's serialisation of two int64 and an
# array of bytes.
_ATTACHMENT = struct.Struct(f"<qqB{GID_BYTES}s")

Endpoint = Literal["MP", "MS", "SS"]


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A topic or a service: name, type and QoS.

    Attributes:
        name: with its namespace, ``/robot1/map``.
        schema: type of its messages, one of ``TYPE_HASHES`` or ``SERVICE_HASHES``.
        latched: transient local: late joiners get the last sample.
        depth: history depth.
    """

    name: str
    schema: str
    latched: bool = False
    depth: int = 1

    @property
    def bridge_key(self) -> str:
        """The key that zenoh-bridge-ros2dds gives it."""
        return self.name.strip("/")

    def rmw_key(self, domain: int, *, any_hash: bool = False) -> str:
        """Return the key that rmw_zenoh gives it; ``any_hash``: for any type hash."""
        type_hash = "*" if any_hash else _type_hash(self.schema)
        return f"{domain}/{self.bridge_key}/{dds_type(self.schema)}/{type_hash}"

    @property
    def qos(self) -> str:
        """Quality of service as in a token; rmw_zenoh's defaults are left out.

        Reliability, durability, history and its depth, deadline, lifespan, liveliness; all are
        reliable and keep the last ``depth``.
        """
        return f":{1 if self.latched else ''}:,{self.depth}:,:,:,,"


@dataclass(frozen=True, slots=True)
class RosNode:
    """A node in the graph of rmw_zenoh.

    Attributes:
        domain: ROS_DOMAIN_ID.
        session: id of its Zenoh session.
        namespace: ``/`` for none.
        name: its name.
    """

    domain: int
    session: str
    namespace: str
    name: str

    @property
    def token(self) -> str:
        """Liveliness token of the node, number 0 of its session."""
        return f"{self._prefix(0)}/NN/{self._name}"

    def endpoint_token(self, number: int, kind: Endpoint, topic: RosTopic) -> str:
        """Return the liveliness token of a publisher (MP), a subscriber (MS) or a service (SS).

        ``number`` counts the node's endpoints, from 1.
        """
        what = f"{mangled(topic.name)}/{dds_type(topic.schema)}/{_type_hash(topic.schema)}"
        return f"{self._prefix(number)}/{kind}/{self._name}/{what}/{topic.qos}"

    def _prefix(self, number: int) -> str:
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}"

    @property
    def _name(self) -> str:
        """Security enclave (none), namespace and name."""
        return f"{mangled('/')}/{mangled(self.namespace)}/{self.name}"


def graph_key(domain: int) -> str:
    """Return the key expression of all tokens in a domain's graph."""
    return f"@ros2_lv/{domain}/**"


def gid_of(token: str) -> bytes:
    """Return ``GID_BYTES`` bytes that are unique to a publisher's token.

    rmw_zenoh identifies publishers by the XXH3 of their tokens, so it does not find ours in the
    graph by the gid of a sample.
    """
    # This module loads OpenSSL: three megabytes that a follower without ROS does not need.
    from hashlib import blake2b  # noqa: PLC0415

    return blake2b(token.encode(), digest_size=GID_BYTES).digest()


def attachment(sequence: int, time_ns: int, gid: bytes) -> bytes:
    """Return the attachment that rmw_zenoh requires with each sample; ``sequence`` begins at 1."""
    return _ATTACHMENT.pack(sequence, time_ns, GID_BYTES, gid)


def attachment_of(beside: bytes) -> tuple[int, bytes] | None:
    """Return number and gid in an attachment; None if it is not rmw_zenoh's."""
    if len(beside) != _ATTACHMENT.size:
        return None
    sequence, _, size, gid = _ATTACHMENT.unpack(beside)
    return (sequence, gid) if size == GID_BYTES else None


def dds_type(schema: str) -> str:
    """Return the DDS name of a type."""
    package, kind, name = schema.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _type_hash(schema: str) -> str:
    return f"RIHS01_{(TYPE_HASHES | SERVICE_HASHES)[schema]}"


def mangled(name: str) -> str:
    """Return a name in the form used in tokens."""
    return name.replace("/", "%")


Call = Literal["send_goal", "cancel_goal", "get_result"]
CALLS: Final[tuple[Call, ...]] = ("send_goal", "cancel_goal", "get_result")
CANCEL_GOAL: Final = "action_msgs/srv/CancelGoal"

_FOLLOW_PATH: Final = "nav2_msgs/action/FollowPath"

Release = Literal["humble", "jazzy", "lyrical"]
RELEASES: Final[dict[Release, int]] = {"humble": 2, "jazzy": 3, "lyrical": 4}
"""Number of plugin names at the end of a goal of nav2_msgs/FollowPath: controller, goal checker,
from Iron on progress checker, from Lyrical on path handler. Iron and Kilted get the same as
Jazzy."""

_GOALS: Final[dict[str, Release]] = {
    "TypeHashNotSupported": "humble",
    "RIHS01_5b662aee1159e1d7e7b5f8fef21f556b8bc67c818c730a68e18bb29b85f66946": "jazzy",
    "RIHS01_0c091793c90a67349df3445771d5d30005daea785137bd6e6bf5d96ea53fb721": "lyrical",
}
"""The release by the hash in the key of ``send_goal``."""


def bridge_keys(action: str) -> dict[Call, str]:
    """Return the keys that zenoh-bridge-ros2dds gives the services of an action."""
    return {call: f"{action.strip('/')}/_action/{call}" for call in CALLS}


def server_tokens(domain: int, action: str) -> str:
    """Return the key expression of the tokens of an action's services."""
    return f"@ros2_lv/{domain}/*/*/*/SS/*/*/*/{mangled(action)}%_action%$*/**"


def served_keys(domain: int, action: str, tokens: Iterable[str]) -> dict[Call, str]:
    """Return the keys of the services named by tokens, for an action of type FollowPath."""
    kinds: dict[Call, str] = {
        "send_goal": dds_type(f"{_FOLLOW_PATH}_SendGoal"),
        "cancel_goal": dds_type(CANCEL_GOAL),
        "get_result": dds_type(f"{_FOLLOW_PATH}_GetResult"),
    }
    found = dict[Call, str]()
    for token in sorted(tokens):
        parts = token.split("/")
        name, kind, type_hash = parts[9:12] if len(parts) >= 12 else ("", "", "")
        for call in CALLS:
            if name == f"{mangled(action)}%_action%{call}" and kind == kinds[call]:
                found[call] = f"{domain}/{action.strip('/')}/_action/{call}/{kind}/{type_hash}"
    return found


def release_of(send_goal_key: str) -> Release | None:
    """Return the ROS release of a server's goal type, by its rmw_zenoh key; None if unknown."""
    return _GOALS.get(send_goal_key.rpartition("/")[2])
