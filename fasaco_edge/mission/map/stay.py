"""Stay: where the robot stays, and for how long.

Poses are noisy, so a robot stays at a place until it is farther away than a tolerance.
"""

from __future__ import annotations

import math

from fasaco_edge.grid.geometry import Point


class Stay:
    """The last place that the robot moved to.

    Args:
        within_m: distance from the place up to which the robot counts as there [m].

    Attributes:
        since: start of the time there [s].
    """

    def __init__(self, within_m: float) -> None:
        self._within_m = within_m
        self._at: Point = math.inf, math.inf
        self.since = 0.0

    def has_left(self, here: Point) -> bool:
        """Return whether a robot at ``here`` (x, y) [m] has left the place."""
        return math.dist(here, self._at) > self._within_m

    def update(self, here: Point, now: float) -> bool:
        """Take in the robot's position; return whether ``here`` is a new place."""
        has_left = self.has_left(here)
        if has_left:
            self.begin(here, now)
        return has_left

    def begin(self, here: Point, now: float) -> None:
        """Take ``here`` as the place from ``now`` [s] on."""
        self._at, self.since = here, now

    def count_from(self, at: float) -> None:
        """Count the time at the same place from ``at`` [s] on."""
        self.since = at

    def forget(self) -> None:
        """Take the next position as a new place."""
        self._at = math.inf, math.inf
