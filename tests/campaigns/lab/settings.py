"""Settings of a lab's mission: robot, noise, people, rates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec

from fasaco_edge.config.config import DaemonConfig, PlannerConfig, ScanConfig
from fasaco_edge.config.robot import RobotConfig

TICK_S = 0.05
"""A tick of the simulated time [s]: all rates are whole numbers of it."""

RESOLUTION_M = 0.05
"""Edge of a pixel of the robot's map [m]."""

BEAMS, LEAST_RANGE_M, MOST_RANGE_M = 241, 0.12, 8.0
"""Beams of the lidar, and its ranges [m]."""

# A mission over so much floor takes at most so many times as long as driving at full speed without
# turns and overlap; half of that time is usual.
LONGEST = 4.0


@dataclass(frozen=True, slots=True)
class LabSettings:
    """How a mission is made.

    Attributes:
        seed: of all noise.
        people: how many walk about.
        walk: the rectangle they walk in: x1, y1, x2, y2 [m]; None for the middle of the building.
        ideal: without slip of the wheels and drift of odometry.
        scan: whether the follower gets scans.
        noise_m: scatter of the lidar [m].
        radius_m: of the robot's disc by the product's configuration, and to the judge [m].
        hull_m: of the hull that collides [m].
        clearance_m: what its lines keep beside that where they can [m].
        seconds: limit of simulated time [s]; 0 for as many as the building's floor may take.
        pose_hz, scan_hz: rates of poses, and of scans that are offered to the mapper [1/s].
        speed_m_s, tool_m: speed of the robot, and width of its tool.
        own: noise of the project's own mapper, see ``own.NOISES``; "" for a simulator and a scan
            matcher of others.
        turn_radius_m: of the base's tightest arc [m]; 0 if it turns on the spot. Of the own base.
        left_m: how far the robot is to the left of where its follower takes it to be [m].
        swept: ``planner.swept`` of the product's configuration; 0 for null.
    """

    seed: int = 1
    people: int = 0
    walk: tuple[float, float, float, float] | None = None
    ideal: bool = False
    scan: bool = False
    noise_m: float = 0.012
    radius_m: float = 0.18
    hull_m: float = 0.17
    clearance_m: float = 0.0
    seconds: float = 0.0
    pose_hz: float = 20.0
    scan_hz: float = 2.5
    speed_m_s: float = 0.35
    tool_m: float = 0.3
    own: str = ""
    turn_radius_m: float = 0.0
    left_m: float = 0.0
    swept: float = 0.0

    def __post_init__(self) -> None:
        """Check rates and lengths.

        Raises:
            ValueError: one cannot be.
        """
        for name in ("pose_hz", "scan_hz"):
            if not 0.0 < getattr(self, name) <= 1.0 / TICK_S:
                raise ValueError(f"{name} must be above 0 and at most {1.0 / TICK_S:g}")
        if not self.seconds >= 0.0:
            raise ValueError("seconds must be at least 0")

    def ticks(self, rate_hz: float) -> int:
        """Return every how many ticks something of this rate is due."""
        return max(round(1.0 / (rate_hz * TICK_S)), 1)

    def limit_s(self, free_m2: float) -> float:
        """Return the limit of simulated time over so much free floor [s]."""
        return self.seconds or LONGEST * free_m2 / (self.tool_m * self.speed_m_s)

    @property
    def robot(self) -> RobotConfig:
        """The product's configuration of the robot."""
        return RobotConfig(
            radius_m=self.radius_m,
            clearance_m=self.clearance_m,
            tool_width_m=self.tool_m,
            speed_m_s=self.speed_m_s,
            acceleration_m_s2=0.5,
            turn_deg_s=80.0,
            turn_deg_s2=180.0,
            turn_radius_m=self.turn_radius_m,
        )

    @property
    def config(self) -> DaemonConfig:
        """The product's configuration."""
        scan = ScanConfig() if self.scan else msgspec.UNSET
        planner = PlannerConfig(swept=self.swept or None)
        return DaemonConfig(robot=self.robot, planner=planner, scan=scan)


def stamp_ns(now: float) -> int:
    """Return the stamp of a simulated time; 0 would be an unknown one."""
    return 1_000_000_000 + math.floor(now * 1e9)
