"""Settings as a daemon shows them: those in force, and the ones that readers of a status use."""

from __future__ import annotations

from fasaco_edge.wire.documents.json_text import Document, tolerant

Settings = dict[str, object]
"""The configuration in force, without secrets, by sections."""


class RobotSettings(Document, frozen=True):
    """Size of robot and tool [m], speed; 0 where not sent. By what share lanes overlap."""

    radius_m: float = 0.0
    tool_width_m: float = 0.0
    overlap: float = 0.0
    speed_m_s: float = 0.0


class PlannerSettings(Document, frozen=True):
    """What the robot is given of a walk."""

    line: str = "cells"


class MapSettings(Document, frozen=True):
    """What is free and what is occupied [percent]."""

    free_at_most: int | None = None
    occupied_at_least: int | None = None


class PoseSettings(Document, frozen=True):
    """The type of poses whose sender names none."""

    schema: str = ""


Corners = tuple[tuple[float, float], ...]


class ZoneSettings(Document, frozen=True):
    """A zone that orders may name."""

    name: str = ""
    polygon: Corners = ()


class MissionSettings(Document, frozen=True):
    """How long the mission continues without a pose [s]; its zones; what it always keeps out of."""

    lost_pose_s: float = 0.0
    zones: tuple[ZoneSettings, ...] = ()
    keep_out: tuple[Corners, ...] = ()
    keep_out_mask: str = ""


class Frames(Document, frozen=True):
    """Names of the frames of map and robot."""

    map: str = ""
    robot: str = ""


class RosSettings(Document, frozen=True):
    """What poses as transforms are read by."""

    frames: Frames | None = None


class KnownSettings(Document, frozen=True):
    """The settings of a daemon that its readers use."""

    robot: RobotSettings = RobotSettings()
    planner: PlannerSettings = PlannerSettings()
    map: MapSettings = MapSettings()
    pose: PoseSettings = PoseSettings()
    mission: MissionSettings = MissionSettings()
    ros2: RosSettings = RosSettings()

    @property
    def cell_m(self) -> float:
        """Edge of a cell [m]; 0 where not sent."""
        overlap = 0.0 if self.planner.line == "cells" else self.robot.overlap
        return self.robot.tool_width_m * (1.0 - overlap)


def known_settings(config: Settings) -> KnownSettings:
    """Return the settings of a status that readers use; what does not fit keeps its default."""
    return tolerant(config, KnownSettings)
