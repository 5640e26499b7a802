"""Place on line: the robot's place on its line, between two points, and its arrival.

Lengths are in pixels of the fine raster, as the line's points, float64 (n, 2).
"""

from __future__ import annotations

import math

import numpy as np

from fasaco_edge.mission.line.offset import CORNER_M, Beside
from fasaco_edge.mission.line.polyline import Points

# The robot is searched for this far ahead on its line, or as far as it can have driven [m]: farther
# on, the next lane may be as near.
LOOK_AHEAD_M = 0.8
# Distance to the end of its line at which a robot has arrived [m]; it has also arrived if the tool
# covers the end, and this many poses come no nearer: it may drive beside its line.
ARRIVED_M, STANDING_POSES = 0.05, 10


class PlaceOnLine:
    """The robot's position, and its place on a line that begins at the last point behind it.

    Attributes:
        here: the position, (2,).
        along: fraction of the first edge that is driven.
    """

    def __init__(self) -> None:
        self.here = np.zeros(2)
        self.along = 0.0
        # Least distance to the end of the line, and number of later poses that came no nearer.
        self._nearest, self._poses_there = math.inf, 0

    def on(self, points: Points) -> Points:
        """Return the robot's place on a line of two points or more, (2,)."""
        a, b = points[:2]
        place: Points = a + self.along * (b - a)
        return place

    def is_on(self, points: Points, tool: float) -> bool:
        """Return whether the robot is on the line, within half the tool."""
        return len(points) > 1 and math.hypot(*(self.on(points) - self.here)) <= tool

    def beside(self, points: Points, unit_m: float) -> Beside | None:
        """Return where the robot is beside its line; None at its end.

        ``points`` is as for ``find``; ``unit_m``: edge of a pixel [m].
        """
        if len(points) < 2:
            return None
        far, left = self.on(points), CORNER_M / unit_m
        for number in range(1, len(points)):
            way = points[number] - far
            length = math.hypot(*way)
            far = points[number] if length <= left else far + way * (left / length)
            left -= length
            if left <= 0.0:
                break
        (dy, dx), (ahead_y, ahead_x) = points[1] - points[0], far - self.on(points)
        length = math.hypot(dy, dx)
        if not length or not math.hypot(ahead_y, ahead_x):
            return None
        off_y, off_x = self.here - points[0]
        heading = math.atan2(dy, dx)
        bend = math.remainder(math.atan2(ahead_y, ahead_x) - heading, math.tau)
        return Beside((dx * off_y - dy * off_x) / length * unit_m, heading, bend)

    def find(self, points: Points, tool: float, look: float) -> int | None:
        """Search for the robot along the line, and update ``along``.

        Args:
            points: points of the line.
            tool: half of the tool's width, the greatest distance from the line.
            look: how far ahead it is searched for.

        Returns:
            The index of the nearest edge; None if none is within that distance.
        """
        nearest, at = tool, None
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
        """Return whether the robot is at the end of its line; to be called once for each pose.

        Args:
            points, tool: as for ``find``.
            left_m: length of the rest of the line [m].
            unit_m: edge of a pixel [m].
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
