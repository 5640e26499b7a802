"""Docking state: whether the robot is in its dock, and whether its battery charges there.

No single message decides: levels rise slowly and in coarse steps, some batteries report the wrong
power supply status, and a bad contact is intermittent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.mission.core.charging import RISE, BatteryGauge
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.text import percent

# Tolerances to the dock's pose, and to the pose in front of the dock [m].
DOCKED_M, NEAR_M = 0.1, 0.5
# Largest difference between the headings of a docked robot and the dock [rad]. Contacts and
# localiser allow about ten degrees; a robot that passes the dock differs by more than this limit.
DOCKED_RAD = math.radians(30.0)


@dataclass(frozen=True, slots=True)
class InDock:
    """Compares pose and battery with the dock, or with the home of a robot that charges there."""

    map: MapState
    gauge: BatteryGauge

    def holds(self, *, is_charging: bool) -> bool:
        """Return whether the robot is in its dock.

        The dock may be in a cell that is not coverable: the base drives the last part by itself.

        Args:
            is_charging: whether the mission already counts the robot as docked.
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


# The level of a docked battery has to rise within FLAT_S [s], as most batteries gain 1 % in less
# than ten minutes; without a report of charging, within PATIENCE_S [s].
PATIENCE_S, FLAT_S = 45.0, 600.0
# A battery does not charge if its level falls by more than this. A fall of 1 % is noise: one step
# of a coarse gauge.
FALL = 0.0125
CHARGES = ("charging", "full")


class DockCurrent:
    """Tracks the battery level of a docked robot; all times are [s]."""

    def __init__(self, gauge: BatteryGauge) -> None:
        self._gauge = gauge
        # Time of docking, and the time since which no message reports charging.
        self._docked_at: float | None = None
        self._unclaimed_at: float | None = None
        # The last extreme of the level: the highest while it rises, the lowest while it falls.
        self._extreme: float | None = None
        self._falls = False
        # The highest level before the present fall.
        self._from = 0.0
        self._rose_at: float | None = None

    @property
    def is_docked(self) -> bool:
        """Whether the robot was docked at the last update."""
        return self._docked_at is not None

    def continue_from(self, before: DockCurrent) -> None:
        """Take over the state of a predecessor."""
        vars(self).update(vars(before) | {"_gauge": self._gauge})

    def update(self, now: float, *, is_docked: bool) -> None:
        """Follow level and power supply at ``now``; to be called in each step."""
        if not is_docked:
            self._docked_at = self._unclaimed_at = self._extreme = self._rose_at = None
            self._falls = False
            return
        self._docked_at = now if self._docked_at is None else self._docked_at
        if self._gauge.power in CHARGES:
            self._unclaimed_at = None
        elif self._unclaimed_at is None:
            self._unclaimed_at = now
        if (level := self._gauge.level) is not None:
            self._update_extreme(level, now)

    def _update_extreme(self, level: float, now: float) -> None:
        extreme = self._extreme
        if extreme is None:
            self._extreme = level
        elif level > extreme + (FALL if self._falls else RISE):
            self._extreme, self._falls, self._rose_at = level, False, now
        elif self._falls:
            self._extreme = min(level, extreme)
        elif level < extreme - FALL:
            self._extreme, self._falls, self._from = level, True, extreme

    def why_none(self, now: float) -> str:
        """Return the evidence that a docked battery does not charge; "" for none."""
        docked_at, level = self._docked_at, self._gauge.level
        if docked_at is None or level is None:
            return ""
        if self._falls:
            return f"its level falls, from {percent(self._from, 0)} to {percent(level, 0)}"
        since = docked_at if self._rose_at is None else self._rose_at
        unclaimed = self._unclaimed_at
        if unclaimed is not None and now - unclaimed >= PATIENCE_S:
            has_risen = self._rose_at is not None and self._rose_at >= unclaimed
            if now - since >= (FLAT_S if has_risen else PATIENCE_S):
                return f"it reports {self._gauge.power!r}, and its level does not rise"
        if now - since >= FLAT_S:
            return f"its level has not risen for {FLAT_S / 60:g} minutes"
        return ""
