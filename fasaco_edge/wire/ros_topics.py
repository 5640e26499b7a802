"""Table of ROS 2 topics: one row for each key under ``ros2.topics`` of the configuration."""

from __future__ import annotations

from typing import Literal, NamedTuple

from fasaco_edge.wire import schemas, topics

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
