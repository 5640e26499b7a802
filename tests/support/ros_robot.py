"""Robot under ROS 2 on Zenoh: plain Zenoh, payloads by rosbags, without code of this project.

It imitates rmw_zenoh by its design.md and its sources.
"""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh
import zenoh.ext

from fasaco_edge.grid.geometry import Pose2D
from tests.support.outsider import TIMEOUT_S, Collector, Heard
from tests.wire import oracle

GRID, PATH, POSE = (
    "nav_msgs/msg/OccupancyGrid",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseStamped",
)
DIAGNOSTICS, TRIGGER = "diagnostic_msgs/msg/DiagnosticArray", "std_srvs/srv/Trigger"
# Hash of std_srvs/Trigger in Iron and later; rosbags does not compute hashes of services.
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
CLIENT = bytes(range(16))
EMPTY_REQUEST = b"\0\1\0\0\0"
UPDATE, TF = "map_msgs/msg/OccupancyGridUpdate", "tf2_msgs/msg/TFMessage"


@dataclass(frozen=True)
class Naming:
    """Conversion of ROS names to keys; ``domain``: None under zenoh-bridge-ros2dds."""

    domain: int | None
    namespace: str = ""

    def key(self, topic: str, schema: str) -> str:
        """Return the key of a topic, for example ``map``."""
        name = f"{self.namespace}/{topic}".strip("/")
        if self.domain is None:
            return name
        package, kind, type_name = schema.split("/")
        is_service = schema == TRIGGER
        type_hash = TRIGGER_HASH if is_service else oracle.STORE.hash_rihs01(schema)
        return f"{self.domain}/{name}/{package}::{kind}::dds_::{type_name}_/{type_hash}"


class RosPublisher:
    """Publishes as rmw_zenoh or the bridge does: without encoding; latched samples are kept."""

    def __init__(self, session: zenoh.Session, key: str, *, latched: bool, attached: bool) -> None:
        self._gid = os.urandom(16) if attached else None
        self._count = 0
        ext = zenoh.ext
        # A bridge has one publisher for all its nodes, with a ten times longer history.
        cache = ext.CacheConfig(max_samples=1 if attached else 10) if latched else None
        beats = ext.MissDetectionConfig(sporadic_heartbeat=0.5) if latched and attached else None
        self._publisher: Any = ext.declare_advanced_publisher(
            session, key, cache=cache, publisher_detection=latched, sample_miss_detection=beats
        )

    def put(self, payload: bytes) -> None:
        """Send a message."""
        self._count += 1
        serial, number = zenoh.ext.z_serialize, zenoh.ext.Int64
        attachment = None
        if self._gid is not None:
            parts = serial(number(self._count)), serial(number(time.time_ns())), serial(self._gid)
            attachment = b"".join(bytes(part) for part in parts)
        self._publisher.put(payload, attachment=attachment)


class RosRobot:
    """A session with the publishers and subscribers of a robot's nodes."""

    def __init__(self, session: zenoh.Session, naming: Naming) -> None:
        self.session = session
        self.naming = naming
        self._publishers: dict[str, RosPublisher] = {}
        self._others: list[RosPublisher] = []

    def put(self, topic: str, schema: str, payload: bytes, *, latched: bool = False) -> None:
        """Publish on a topic."""
        if topic not in self._publishers:
            self._publishers[topic] = self.another(topic, schema, latched=latched)
        self._publishers[topic].put(payload)

    def another(self, topic: str, schema: str, *, latched: bool = False) -> RosPublisher:
        """Return one more publisher of a topic."""
        key, attached = self.naming.key(topic, schema), self.naming.domain is not None
        publisher = RosPublisher(self.session, key, latched=latched, attached=attached)
        self._others.append(publisher)
        return publisher

    def put_tf(self, frame: str, child: str, where: Pose2D, topic: str = "tf") -> None:
        """Publish one transform."""
        message = oracle.transforms((frame, child, time.time_ns(), oracle.pose(where)))
        self.put(topic, TF, oracle.to_bytes(TF, message), latched=topic == "tf_static")

    def listen(self, topic: str, schema: str) -> Collector:
        """Subscribe as to a transient-local topic."""
        receiver = Collector()
        zenoh.ext.declare_advanced_subscriber(
            self.session,
            self.naming.key(topic, schema),
            receiver,
            history=zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True),
            subscriber_detection=True,
        )
        return receiver

    def call(self, service: str) -> tuple[bool, str, bytes]:
        """Call a Trigger service as a ROS client does, with a query to complete servers.

        Returns:
            Success and message of the response, and its attachment.
        """
        key, beside = self.naming.key(service, TRIGGER), None
        if self.naming.domain is not None:
            serial, number = zenoh.ext.z_serialize, zenoh.ext.Int64
            parts = serial(number(7)), serial(number(time.time_ns())), serial(CLIENT)
            beside = b"".join(bytes(part) for part in parts)
        replies = self.session.get(
            key,
            payload=EMPTY_REQUEST,
            attachment=beside,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=TIMEOUT_S,
        )
        (reply,) = replies
        assert reply.ok is not None
        assert str(reply.ok.key_expr) == key
        response = oracle.from_bytes(oracle.TRIGGER_RESPONSE, reply.ok.payload.to_bytes())
        attached = reply.ok.attachment.to_bytes() if reply.ok.attachment is not None else b""
        return response.success, response.message, attached

    def tokens(self) -> list[list[str]]:
        """Return the parts of all liveliness tokens of the domain."""
        replies = self.session.liveliness().get(f"@ros2_lv/{self.naming.domain}/**", timeout=2.0)
        return [str(reply.ok.key_expr).split("/") for reply in replies if reply.ok is not None]


@contextmanager
def ros_robot(
    endpoint: str, naming: Naming, transport: dict[str, Any] | None = None
) -> Iterator[RosRobot]:
    """Run a robot's session once a peer listens at ``endpoint``.

    ``transport``: the section of Zenoh's configuration, with the client's certificate.
    """
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        try:
            where = {"endpoints": [endpoint], "timeout_ms": 0}
            session = _open(mode="client", connect=where, transport=transport or {})
            break
        except zenoh.ZError:
            assert time.monotonic() < deadline, f"nobody listens at {endpoint}"
            time.sleep(0.05)
    try:
        yield RosRobot(session, naming)
    finally:
        session.close()  # type: ignore[no-untyped-call]


@contextmanager
def ros_node(router: str, naming: Naming) -> Iterator[RosRobot]:
    """Run a session like rmw_zenoh's nodes by default: peers that find each other by a router."""
    listen = {"endpoints": ["tcp/localhost:0"]}
    with _open(mode="peer", connect={"endpoints": [router]}, listen=listen) as session:
        yield RosRobot(session, naming)


@contextmanager
def ros_router(endpoint: str) -> Iterator[None]:
    """Run a router like rmw_zenohd by default."""
    with _open(mode="router", listen={"endpoints": [endpoint]}):
        yield


def _open(**document: Any) -> zenoh.Session:
    document["scouting"] = {"multicast": {"enabled": False}, "gossip": {"enabled": True}}
    document["timestamping"] = {"enabled": True}
    document["transport"] = {"shared_memory": {"enabled": False}} | document.get("transport", {})
    return zenoh.open(zenoh.Config.from_json5(json.dumps(document)))


def is_walk(heard: Heard) -> bool:
    return len(heard.payload) > 200


def check_path(heard: Heard, near: tuple[float, float]) -> None:
    """Check the parts of a path that a follower needs."""
    path = oracle.from_bytes(PATH, heard.payload)
    assert path.header.frame_id == "map"
    assert path.header.stamp.nanosec == 1  # the map's
    xy = np.array([[pose.pose.position.x, pose.pose.position.y] for pose in path.poses])
    assert len(xy) > 50
    assert np.hypot(*(xy[0] - near)) < 0.5
    for pose, step in zip(path.poses, np.diff(xy, axis=0), strict=False):
        assert pose.header.frame_id == "map"
        turn = pose.pose.orientation
        ahead = [turn.w**2 - turn.z**2, 2 * turn.w * turn.z]
        np.testing.assert_allclose(ahead, step / np.hypot(*step), atol=1e-6)


def check_attachment(heard: Heard) -> int:
    """Check the attachment as rmw_zenoh does; return the sequence number."""
    assert heard.attachment is not None
    assert len(heard.attachment) == 33
    sequence, time_ns, size = struct.unpack_from("<qqB", heard.attachment)
    assert size == 16
    assert abs(time_ns - time.time_ns()) < 60e9
    return sequence
