"""How the simulated robot moves, sees and publishes."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from fasaco_edge.errors import BadConfiguration


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """The robot, its scanner and its rates. Times and rates are in simulated time.

    The defaults are a TurtleBot3 Waffle with an LDS-01 scanner, rounded.

    Attributes:
        speed_m_s: driving speed [m/s].
        turn_rad_s: turning speed in place [rad/s].
        acceleration_m_s2: of driving, up and down [m/s^2].
        turn_acceleration_rad_s2: of turning, up and down [rad/s^2].
        robot_radius_m: radius that the planner uses [m].
        padding_m: what that radius has in excess of the hull [m]. The hull is what
            collides: a robot as wide as its corridor would touch at the first rounding error.
        range_m: reach of the scanner [m].
        free_at_most: occupancy values up to this are free [percent].
        map_chunk_m: the published map grows by blocks of about this size [m].
        tick_s: the simulation's time step [s].
        scan_hz, map_hz, pose_hz: rates [Hz]; their periods are rounded to whole ticks.
    """

    speed_m_s: float = 0.25
    turn_rad_s: float = 1.8
    acceleration_m_s2: float = 0.5
    turn_acceleration_rad_s2: float = 3.2
    robot_radius_m: float = 0.2
    padding_m: float = 0.02
    range_m: float = 3.5
    free_at_most: int = 25
    map_chunk_m: float = 1.0
    tick_s: float = 0.02
    scan_hz: float = 5.0
    map_hz: float = 2.0
    pose_hz: float = 10.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            may_be_zero = field.name in ("padding_m", "free_at_most")
            if not math.isfinite(value) or value < 0 or (value == 0 and not may_be_zero):
                least = "at least 0" if may_be_zero else "above 0"
                raise BadConfiguration(f"{field.name} must be {least}, got {value}")
        if self.padding_m >= self.robot_radius_m:
            raise BadConfiguration(
                f"padding_m must be below robot_radius_m ({self.robot_radius_m}), "
                f"got {self.padding_m}"
            )

    @property
    def hull_radius_m(self) -> float:
        """Radius of the disc that collides [m]."""
        return self.robot_radius_m - self.padding_m

    @property
    def tick_ns(self) -> int:
        """The time step [ns]."""
        return round(self.tick_s * 1e9)

    def period_ticks(self, rate_hz: float) -> int:
        """Return the period of a rate in ticks, at least 1."""
        return max(1, round(1.0 / (rate_hz * self.tick_s)))
