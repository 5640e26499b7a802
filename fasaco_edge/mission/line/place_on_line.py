"""The robot's place on its line: how far it is between two points of it, and whether it arrived.

Lengths are in pixels of the fine raster that the line's points, float64 (n, 2), are on.
"""

from __future__ import annotations

import math

import numpy as np

from fasaco_edge.mission.line.pieces import Points

# The robot is looked for so far ahead on its line [m]: further on, the next lane may lie as near.
LOOK_AHEAD_M = 0.8
# So near to the end of its line a robot has arrived [m]; or where it comes no nearer for so many
# poses, and the tool is over the end: it drives beside its line, maybe.
ARRIVED_M, STANDING_POSES = 0.05, 10


class PlaceOnLine:
    """Where the robot is, and where on the line that begins with the last point behind it.

    Attributes:
        here: where it is, (2,).
        along: how far it is on the way from the first point to the next, a share.
    """

    def __init__(self) -> None:
        self.here = np.zeros(2)
        self.along = 0.0
        # How near the robot came to the end of its line, and for how many poses no nearer.
        self._nearest, self._poses_there = math.inf, 0

    def on(self, points: Points) -> Points:
        """Return the place on a line of two points or more where the robot should be, (2,)."""
        a, b = points[:2]
        place: Points = a + self.along * (b - a)
        return place

    def is_on(self, points: Points, tool: float) -> bool:
        """Tell whether the robot is on the line, within half the tool."""
        return len(points) > 1 and math.hypot(*(self.on(points) - self.here)) <= tool

    def find(self, points: Points, tool: float, unit_m: float) -> int | None:
        """Look for the robot along the line, and note how far along an edge it is.

        Args:
            points: of the line.
            tool: half of the tool's width: further off it is not on the line.
            unit_m: a pixel [m].

        Returns:
            The number of the edge that it is nearest to; None where it is on none.
        """
        nearest, at = tool, None
        look = LOOK_AHEAD_M / unit_m
        for number in range(len(points) - 1):
            edge = points[number + 1] - points[number]
            length = max(math.hypot(*edge), 1e-9)
            low = self.along if number == 0 else 0.0
            high = min(1.0, low + look / length)
            share = float(np.dot(self.here - points[number], edge)) / length**2
            share = min(max(share, low), high)
            apart = math.hypot(*(points[number] + share * edge - self.here))
            if apart < nearest - 1e-6:
                nearest, at = apart, (number, share)
            look -= (high - low) * length
            if look <= 0.0:
                break
        if at is None:
            return None
        self.along = at[1]
        return at[0]

    def has_arrived(self, points: Points, left_m: float, tool: float, unit_m: float) -> bool:
        """Tell whether the robot is at the end of its line; to be asked once for each pose.

        Args:
            points, tool, unit_m: as for ``find``.
            left_m: what is left of the line [m].
        """
        apart = math.hypot(*(points[-1] - self.here))
        if len(points) == 2 and apart * unit_m <= ARRIVED_M:
            return True
        if apart > tool or left_m > tool * unit_m:
            self._nearest, self._poses_there = math.inf, 0
        elif apart < self._nearest - 1e-6:
            self._nearest, self._poses_there = apart, 0
        else:
            self._poses_there += 1
        return self._poses_there >= STANDING_POSES
