"""Settings that readers of a daemon's status use."""

from __future__ import annotations

from fasaco_edge.wire.documents.json_text import (
    Angle,
    Coordinate,
    Corners,
    Document,
    Settings,
    tolerant,
)


class RobotSettings(Document, frozen=True):
    """Size of robot and tool [m], speed; 0 if not sent. Overlap of lanes as a share.

    ``time_scale``: simulated seconds per second.
    """

    radius_m: float = 0.0
    tool_width_m: float = 0.0
    overlap: float = 0.0
    speed_m_s: float = 0.0
    time_scale: float = 1.0


class PlannerSettings(Document, frozen=True):
    """Name of the planner; the form of the published path."""

    name: str = ""
    line: str = "cells"


class MapSettings(Document, frozen=True):
    """Thresholds of free and occupied [percent]."""

    free_at_most: int | None = None
    occupied_at_least: int | None = None


class PoseSettings(Document, frozen=True):
    """The message type of poses whose samples name none."""

    schema: str = ""


class ZoneSettings(Document, frozen=True):
    """A zone that orders may name."""

    name: str = ""
    polygon: Corners = ()


class MissionSettings(Document, frozen=True):
    """Timeout of the pose [s]; the named zones; the keep-out zones of all orders."""

    lost_pose_s: float = 0.0
    zones: tuple[ZoneSettings, ...] = ()
    keep_out: tuple[Corners, ...] = ()
    keep_out_mask: str = ""


class Frames(Document, frozen=True):
    """Names of the frames of map and robot."""

    map: str = ""
    robot: str = ""


class RosSettings(Document, frozen=True):
    """Settings for poses from transforms."""

    frames: Frames | None = None


class FleetSettings(Document, frozen=True):
    """Name of the fleet, "" without one; pose of the map's origin in the fleet's frame."""

    name: str = ""
    x_m: Coordinate = 0.0
    y_m: Coordinate = 0.0
    yaw_deg: Angle = 0.0


class KnownSettings(Document, frozen=True):
    """The settings of a daemon that its readers use."""

    robot: RobotSettings = RobotSettings()
    planner: PlannerSettings = PlannerSettings()
    map: MapSettings = MapSettings()
    pose: PoseSettings = PoseSettings()
    mission: MissionSettings = MissionSettings()
    ros2: RosSettings = RosSettings()
    fleet: FleetSettings = FleetSettings()

    @property
    def pace(self) -> float:
        """Factor of rates that count the robot's time: 1, or above for a faster simulation."""
        return max(self.robot.time_scale, 1.0)

    @property
    def cell_m(self) -> float:
        """Edge of a cell [m]; 0 if not sent."""
        overlap = 0.0 if self.planner.line == "cells" else self.robot.overlap
        return self.robot.tool_width_m * (1.0 - overlap)


def known_settings(config: Settings) -> KnownSettings:
    """Return the settings of a status that readers use; unfit members keep their defaults."""
    return tolerant(config, KnownSettings)
