"""Settings of the recorder: where to write, what to listen to, how much disk to leave free."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from fasaco_edge.bus.session import BusSettings
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.schemas import POSE_STAMPED
from fasaco_edge.wire.transforms import DEFAULT_FRAMES

MEGABYTE = 1_000_000


@dataclass(frozen=True, slots=True)
class RosInput:
    """A topic of ROS 2 that the mission subscribes to.

    Attributes:
        topic: what it is for the mission: "map", "map_update", "pose" or "tf_static".
        key: Zenoh's; may hold wildcards.
        schema: type of its messages, which ROS does not send.
        latched: whether who joins late gets the last samples.
        depth: how many.
    """

    topic: str
    key: str
    schema: str
    latched: bool = False
    depth: int = 1


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """How to record one robot.

    Attributes:
        out: folder for the recordings; made if missing.
        robot: name of the robot.
        base: what all keys begin with.
        bus: how to join the bus.
        ros: topics of ROS 2 to listen to beside the native keys.
        frames: the map's and the robot's, where poses come as transforms.
        pose_schema: message type of poses that come without one, as under ROS 2.
        part_bytes: a part larger than this is followed by the next.
        part_s: and so is one that is older [s]; 0 for never. Until the footer of a part is written
            rerun's index of it grows by a megabyte a minute.
        quota_bytes: about the most that the recordings of this robot in ``out`` take: the oldest
            parts are deleted, never the one being written; 0 for no limit.
        least_free_bytes: recording pauses while less than this is free on the disk.
        serve: address and port to serve live viewers at; None for nowhere.
        queue_bytes: samples waiting to be written take at most this much memory.

    Raises:
        BadConfiguration: a size is impossible, or a name is no key.
    """

    out: Path
    robot: str = "robot"
    base: str = "fasaco"
    bus: BusSettings = field(default_factory=BusSettings)
    ros: tuple[RosInput, ...] = ()
    frames: tuple[str, str] = DEFAULT_FRAMES
    pose_schema: str = POSE_STAMPED
    part_bytes: int = 64 * MEGABYTE
    part_s: float = 600.0
    quota_bytes: int = 0
    least_free_bytes: int = 50 * MEGABYTE
    serve: tuple[str, int] | None = None
    queue_bytes: int = 32 * MEGABYTE

    def __post_init__(self) -> None:
        for name, least in (("part_bytes", 1), ("least_free_bytes", 0), ("queue_bytes", 1)):
            if getattr(self, name) < least:
                raise BadConfiguration(
                    f"{name} must be at least {least}, got {getattr(self, name)}"
                )
        for name in ("part_s", "quota_bytes"):
            # Negated, so that NaN is caught, too.
            if not getattr(self, name) >= 0:
                raise BadConfiguration(f"{name} must be at least 0, got {getattr(self, name)}")
        if 0 < self.quota_bytes < 2 * self.part_bytes:
            raise BadConfiguration(
                f"quota_bytes must be 0 or at least two parts, {2 * self.part_bytes}, "
                f"got {self.quota_bytes}"
            )
        Keys(self.robot, self.base)

    @property
    def keys(self) -> Keys:
        """The robot's keys."""
        return Keys(self.robot, self.base)
