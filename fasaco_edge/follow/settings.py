"""Settings of the follower, passed between processes as plain JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from fasaco_edge.follow.estimate import BaseLimits
from fasaco_edge.wire.schemas import TWIST


@dataclass(frozen=True, slots=True)
class PoseSource:
    """A key on which poses are received.

    Attributes:
        key: key expression to subscribe to.
        schema: message type, for samples that do not name it; "" if they do.
        latched, depth: whether late joiners get the newest samples, and how many.
        is_static: whether these are static transforms.
    """

    key: str
    schema: str = ""
    latched: bool = False
    depth: int = 1
    is_static: bool = False


@dataclass(frozen=True, slots=True)
class FollowSettings:
    """Settings of the follower.

    Attributes:
        robot, base: name of the robot, and prefix of its keys.
        connect: endpoints of the bus.
        secured: credentials, a part of Zenoh's configuration.
        limits: limits of the base.
        pose_schema: message type of poses, for samples that do not name it.
        pose_age_s: timeout of the newest pose [s].
        poses: keys of poses.
        frames: names of the map's and the robot's frame in ROS 2, for poses from transforms.
        schema: message type of the velocities, one of ``TWIST_SCHEMAS``.
        frame: name of the robot's frame, for a TwistStamped.
        cmd_key: key of the velocities.
        ros: kind, domain, namespace, name of the node and topic, if ``cmd_key`` is ROS 2's.
        nav2: if Nav2's controller drives: name of its action, release, names of plugins, and the
            least distance between separate stretches of one goal's path [m].
        scan: if scans are used: pose of the lidar (``mount``), ``lost_s``, ``free_at_most``,
            ``most_pixels`` of a map, and further topics of scans, maps and updates: name, key,
            whether it is latched, depth.
        radius_m: radius of the robot's disc [m]; 0 if unknown.
        pace: simulated seconds per second.
        dry_run: report commands instead of sending them.
    """

    robot: str
    base: str
    connect: tuple[str, ...]
    limits: BaseLimits
    pose_schema: str
    poses: tuple[PoseSource, ...]
    cmd_key: str
    pose_age_s: float = 0.5
    frames: tuple[str, str] | None = None
    schema: str = TWIST
    frame: str = "base_link"
    ros: Mapping[str, Any] = field(default_factory=dict)
    nav2: Mapping[str, Any] = field(default_factory=dict)
    scan: Mapping[str, Any] = field(default_factory=dict)
    secured: Mapping[str, Any] = field(default_factory=dict, repr=False)
    radius_m: float = 0.0
    pace: float = 1.0
    dry_run: bool = False

    def encode(self) -> bytes:
        """Return the settings as JSON."""
        return json.dumps(asdict(self)).encode()

    @classmethod
    def decode(cls, document: bytes) -> FollowSettings:
        """Return the settings in a document of ``encode``."""
        members = json.loads(document)
        members["poses"] = tuple(PoseSource(**source) for source in members["poses"])
        members["limits"] = BaseLimits(**members["limits"])
        members["connect"] = tuple(members["connect"])
        members["frames"] = tuple(members["frames"]) if members["frames"] else None
        return cls(**members)
