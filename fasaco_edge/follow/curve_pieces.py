"""Pieces of a curve for Nav2's controller, each driven forward or backward as a whole.

A controller that may reverse would cut the ends of lanes where a curve turns back on itself. So a
piece ends at each change between forward and backward, where the robot comes to rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from fasaco_edge.follow.pieces import LEAST_M, Line
from fasaco_edge.grid.geometry import Point, Pose2D

# The robot changes between forward and backward at a sharper bend [rad].
REVERSAL_RAD = math.radians(120.0)


class CurveLine(Line):
    """A curve parametrised by arc length.

    Args:
        take: returns the next poses of the path, at most as many as asked for.
    """

    def __init__(self, take: Callable[[int], list[Pose2D]]) -> None:
        super().__init__(self._take_points)
        self._take_poses = take
        # Robot's heading at its beginning [rad].
        self._yaw: float | None = None

    def reversals(self, start: float, stop: float) -> list[float]:
        """Return the arc lengths between two limits where the robot turns back, in order [m]."""
        return self.bends(start, stop, REVERSAL_RAD)

    def is_back(self, way: float) -> bool:
        """Return whether the robot drives backward from an arc length on."""
        (x, y), (to_x, to_y) = self.at(0.0), self.at(LEAST_M)
        along = math.atan2(to_y - y, to_x - x) - (self._yaw or 0.0)
        return (len(self.reversals(0.0, way)) % 2 == 1) != (math.cos(along) < 0.0)

    def _take_points(self, most: int) -> list[Point]:
        poses = self._take_poses(most)
        if self._yaw is None and poses:
            self._yaw = poses[0].yaw
        return [(pose.x, pose.y) for pose in poses]
