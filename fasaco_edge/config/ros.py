"""ROS 2 section of the configuration: topics, services, frames, and Nav2."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

import msgspec
from msgspec import Meta

from fasaco_edge.bus.access import Role, ros_rights
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.documents import StrictDocument
from fasaco_edge.wire import schemas, topics
from fasaco_edge.wire.limits import MAX_STRING_BYTES
from fasaco_edge.wire.messages.ros_node import TRIGGERED, Triggered
from fasaco_edge.wire.ros_keys import TRIGGER, Release, RosTopic, graph_key

# History depth of tf2's listeners. A bridge keeps the static transforms of all nodes in one
# history.
DEPTH = 100


class RosRow(NamedTuple):
    """A ROS 2 topic.

    Attributes:
        name: its key under ``ros2.topics`` of the configuration.
        topic: its name in the daemon and in recordings.
        direction: as seen by the daemon.
        schemas: allowed message types.
        latched: transient local.
        depth: history depth.
    """

    name: str
    topic: str
    direction: Literal["in", "out"]
    schemas: tuple[str, ...]
    latched: bool
    depth: int


_TF = (schemas.TF_MESSAGE,)
_ROS_ROWS = (
    RosRow("map", "map", "in", topics.MAP.schemas, latched=True, depth=1),
    RosRow("map_updates", "map_update", "in", topics.MAP_UPDATE.schemas, latched=False, depth=256),
    RosRow("battery", "battery", "in", topics.BATTERY.schemas, latched=False, depth=16),
    RosRow("priority", "priority", "in", topics.PRIORITY.schemas, latched=True, depth=1),
    RosRow("keep_out_mask", "keep_out_mask", "in", topics.MAP.schemas, latched=True, depth=1),
    RosRow("scan", "scan", "in", topics.SCAN.schemas, latched=False, depth=5),
    RosRow("pose", "pose", "in", topics.POSE.schemas, latched=False, depth=DEPTH),
    RosRow("tf", "pose", "in", _TF, latched=False, depth=DEPTH),
    RosRow("tf_static", topics.TF_STATIC, "in", _TF, latched=True, depth=DEPTH),
    RosRow("coverage_path", "path", "out", topics.PATH.schemas, latched=True, depth=1),
    RosRow("coverage_grid", "coverage", "out", topics.COVERAGE.schemas, latched=True, depth=1),
    RosRow(
        "diagnostics", "diagnostics", "out", (schemas.DIAGNOSTIC_ARRAY,), latched=False, depth=10
    ),
    RosRow("cmd_vel", "cmd_vel", "out", topics.CMD_VEL.schemas, latched=False, depth=1),
)
ROS_TOPICS = {row.name: row for row in _ROS_ROWS}
"""ROS 2 topics by their key under ``ros2.topics`` of the configuration."""


# ROS 2 design, "Topic and Service name mapping": letters, digits, _; no digit first.
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_NODE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# rmw/validate_full_topic_name.h, RMW_TOPIC_MAX_NAME_LENGTH.
_MAX_TOPIC_LENGTH = 247
_MAX_PREFIX_LENGTH = _MAX_TOPIC_LENGTH - len("/resume")

DEFAULT_NODE = "fasaco_edge"
# History depth of rclcpp's services.
SERVICE_DEPTH = 10
# Inputs that a follower needs: poses, and maps to compare scans with.
DRIVER_INPUTS = ("map", "map_update", "pose", topics.TF_STATIC)


def _misfit(key: str, expected: str, name: str) -> BadConfiguration:
    return BadConfiguration(f"must be {expected}, got {name!r}", key=key)


class RosTopicNames(StrictDocument, frozen=True):
    """Names of topics below the namespace; either ``pose`` or ``tf`` is used."""

    map: str = "/map"
    map_updates: str = "/map_updates"
    battery: str = "/battery_state"
    priority: str = "/floor_priority"
    keep_out_mask: str = "/keepout_filter_mask"
    scan: str = "/scan"
    pose: str = "/pose"
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    coverage_path: str = "/coverage_path"
    coverage_grid: str = "/coverage_grid"
    diagnostics: str = "/diagnostics"
    cmd_vel: str = "/cmd_vel"


class RosFrames(StrictDocument, frozen=True):
    """First and last frame of the chain of transforms; frames in between are found."""

    map: str = "map"
    robot: str = "base_link"

    def faults(self) -> Iterator[BadConfiguration]:
        for key, frame in msgspec.structs.asdict(self).items():
            # Unprintable characters may not exist in UTF-8, or be a NUL.
            printed = frame if frame.isprintable() else ""
            if not 0 < len(printed.encode()) <= MAX_STRING_BYTES:
                yield _misfit(key, "the name of a frame", frame)
        if self.map == self.robot:
            text = f"must differ from frames.map, got {self.map!r} twice"
            yield BadConfiguration(text, key="robot", others=["map"])


class Nav2Config(StrictDocument, frozen=True):
    """Nav2's controller server, used if ``follow`` is ``nav2``.

    ``controller``, ``goal_checker``, ``progress_checker`` and ``path_handler`` name its plugins, ""
    for the only one there is; ``release`` is the ROS release whose goals a server behind a bridge
    accepts. Parts of a goal's path keep ``near_m`` [m] from each other, by default 0.75 of the
    tool's width.
    """

    action: str = "/follow_path"
    release: Release = "jazzy"
    controller: str = ""
    goal_checker: str = ""
    progress_checker: str = ""
    path_handler: str = ""
    near_m: Annotated[float, Meta(ge=0.05, le=10)] | None = None

    def faults(self) -> Iterator[BadConfiguration]:
        if not _TOPIC.fullmatch(self.action):
            yield _misfit("action", "like /follow_path", self.action)
        for key in ("controller", "goal_checker", "progress_checker", "path_handler"):
            name = getattr(self, key)
            if not name.isprintable() or len(name.encode()) > MAX_STRING_BYTES:
                yield _misfit(key, "the name of a plugin", name)


class RosConfig(StrictDocument, frozen=True):
    """ROS 2 topics, in addition to the native keys.

    ``kind`` is the connection of ROS to Zenoh: the middleware rmw_zenoh, or a bridge,
    zenoh-bridge-ros2dds. ``domain`` and ``node`` are for rmw_zenoh, as a bridge has its own.
    ``pose`` is the type of the pose's topic, or "tf"; the mission's commands are services below
    ``services``. ``follow`` is what ``fasaco-edge follow`` does: drive the base itself, or send the
    path to Nav2's controller.
    """

    kind: Literal["bridge", "rmw_zenoh"]
    domain: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 0
    namespace: str = "/"
    node: str = DEFAULT_NODE
    topics: RosTopicNames = RosTopicNames()
    services: str = "/coverage"
    pose: Literal[
        "tf",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = "tf"
    frames: RosFrames = RosFrames()
    follow: Literal["own", "nav2"] = "own"
    nav2: Nav2Config = Nav2Config()

    @property
    def inputs(self) -> dict[str, RosTopic]:
        """The topics that daemon and recorder subscribe to, by their names in the daemon."""
        poses = ("tf_static", "tf") if self.pose == "tf" else ("pose",)
        names = ("map", "map_updates", "battery", "priority", *poses)
        return {ROS_TOPICS[name].topic: self.topic(name) for name in names}

    @property
    def outputs(self) -> dict[str, RosTopic]:
        """The topics that the daemon publishes, by the names of the native topics."""
        names = ("coverage_path", "coverage_grid", "diagnostics")
        return {ROS_TOPICS[name].topic: self.topic(name) for name in names}

    @property
    def commands(self) -> dict[Triggered, RosTopic]:
        """The services that command the mission, by command."""
        return {
            name: RosTopic(self.full_name(f"{self.services}/{name}"), TRIGGER, depth=SERVICE_DEPTH)
            for name in TRIGGERED
        }

    def topic(self, name: str, schema: str = "") -> RosTopic:
        """Return the topic of a key under ``topics``; ``schema``: its type, "" for the usual."""
        row = ROS_TOPICS[name]
        schema = schema or (self.pose if name == "pose" else row.schemas[0])
        return RosTopic(self.full_name(getattr(self.topics, name)), schema, row.latched, row.depth)

    def input_key(self, topic: RosTopic) -> str:
        """Return the key to subscribe to for a topic, with any type hash of rmw_zenoh."""
        if self.kind == "bridge":
            return topic.bridge_key
        return topic.rmw_key(self.domain, any_hash=True)

    def output_key(self, topic: RosTopic) -> str:
        """Return the key to publish a topic under."""
        return topic.bridge_key if self.kind == "bridge" else topic.rmw_key(self.domain)

    def rights(self) -> Role:
        """Return the rights of the role ``ros``."""
        outputs = [*map(self.output_key, self.outputs.values()), *self._driven_by]
        outputs += map(self.input_key, self.commands.values())
        inputs = [*self.inputs.values(), self.topic("keep_out_mask"), self.topic("scan")]
        return ros_rights([*map(self.input_key, inputs)], outputs, self._graph)

    def driver_rights(self) -> Role:
        """Return the rights of the role ``driver``."""
        inputs = [topic for name, topic in self.inputs.items() if name in DRIVER_INPUTS]
        outputs = [*map(self.input_key, (*inputs, self.topic("scan")))]
        return ros_rights(self._driven_by, outputs, self._graph)

    @property
    def _driven_by(self) -> list[str]:
        return [self.output_key(self.topic("cmd_vel", schema)) for schema in schemas.TWIST_SCHEMAS]

    @property
    def _graph(self) -> list[str]:
        return [] if self.kind == "bridge" else [graph_key(self.domain)]

    def faults(self) -> Iterator[BadConfiguration]:
        if self.namespace != "/" and not _TOPIC.fullmatch(self.namespace):
            yield _misfit("namespace", "/ or like /robot1", self.namespace)
        prefix = self.full_name(self.services)
        if not _TOPIC.fullmatch(self.services) or len(prefix) > _MAX_PREFIX_LENGTH:
            yield _misfit("services", "like /coverage", self.services)
        if not _NODE.fullmatch(self.node):
            yield _misfit("node", "letters, digits and _", self.node)
        if self.kind == "bridge" and (self.domain != 0 or self.node != DEFAULT_NODE):
            yield BadConfiguration(
                "domain and node are for kind rmw_zenoh: a bridge has its own",
                key="node" if self.domain == 0 else "domain",
                others=["kind"],
            )
        keys: dict[str, str] = {}
        for key in RosTopicNames.__struct_fields__:
            name: str = getattr(self.topics, key)
            if not _TOPIC.fullmatch(name) or len(self.full_name(name)) > _MAX_TOPIC_LENGTH:
                yield _misfit(f"topics.{key}", "like /robot1/map", name)
            if name in keys:
                yield BadConfiguration(
                    f"must differ from topics.{keys[name]}, got {name!r} twice",
                    key=f"topics.{key}",
                    others=[f"topics.{keys[name]}"],
                )
            keys[name] = key

    def full_name(self, topic: str) -> str:
        """Return the name of a topic, service or action in the namespace."""
        return self.namespace.rstrip("/") + topic
