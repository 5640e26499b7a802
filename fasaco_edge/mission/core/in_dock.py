"""In dock: whether the robot is in its dock, by its pose and its battery."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.mission.core.charging import BatteryGauge
from fasaco_edge.mission.map.map_state import MapState

# Tolerances to the dock's pose, and to the pose in front of the dock [m].
DOCKED_M, NEAR_M = 0.1, 0.5
# Largest difference between a docked robot's heading and the dock's [rad]: contacts allow less, the
# error of a localiser is about ten degrees; a robot that passes the dock or turns differs by more.
DOCKED_RAD = math.radians(30.0)


@dataclass(frozen=True, slots=True)
class InDock:
    """Compares pose and battery with the dock, or with the home of a robot that charges there."""

    map: MapState
    gauge: BatteryGauge

    def holds(self, *, is_charging: bool) -> bool:
        """Return whether the robot is in its dock, also after its base drove it in.

        The cell there need not be coverable.

        Args:
            is_charging: whether the mission already counts it as docked.
        """
        place, stamped = self.map.places.place("charge"), self.map.pose
        if place is None or stamped is None:
            return False
        pose, yaw = stamped.pose, place.stand.yaw
        is_there = math.hypot(pose.x - place.x_m, pose.y - place.y_m) <= DOCKED_M
        if is_there and abs(math.remainder(pose.yaw - yaw, math.tau)) <= DOCKED_RAD:
            return True
        return (is_charging or self.gauge.power == "charging") and self.is_near()

    def is_near(self) -> bool:
        """Return whether the robot is near enough to the dock for its base to have driven it in."""
        place, stamped = self.map.places.place("charge"), self.map.pose
        if place is None or stamped is None:
            return False
        pose, stand = stamped.pose, place.stand
        reach_m = math.hypot(place.x_m - stand.x, place.y_m - stand.y) + NEAR_M
        return math.hypot(pose.x - stand.x, pose.y - stand.y) <= reach_m
