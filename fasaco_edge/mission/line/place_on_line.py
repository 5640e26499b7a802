"""Place on line: where on its line the robot is, in which cells, and the line that it set aside.

Lengths are in pixels of the fine raster, as the line's points, float64 (n, 2).

Line aside: the rest of a polished line, kept while the robot drives an errand or makes way.

Alignment of a line with its walk: the cell of the walk that each point stands for.

The polisher moves, removes and inserts points, and its lanes may differ from those of the walk; so
the cells are found again by place (dynamic time warping, Sakoe and Chiba 1978).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.line.offset import CORNER_M, Beside
from fasaco_edge.mission.line.polyline import Line, Numbers, Points, Walk

# The robot is searched for this far ahead on its line, or as far as it can have driven [m]: farther
# ahead, another lane may be as near.
LOOK_AHEAD_M = 0.8
# Distance to the end of its line at which a robot has arrived [m]; it has also arrived if the tool
# covers the end and this many poses come no nearer, as a robot may drive beside its line.
ARRIVED_M, STANDING_POSES = 0.05, 10
# Cosine of the largest angle between a robot that cannot turn on the spot and the edge it is on:
# its curve crosses itself within the distance in which it is searched for.
ALONG = math.cos(math.radians(40.0))


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

    def find(
        self, points: Points, tool: float, look: float, along: Points | None = None
    ) -> int | None:
        """Search for the robot along the line, and update ``along``.

        Args:
            points: points of the line.
            tool: half of the tool's width, the greatest distance from the line.
            look: how far ahead it is searched for.
            along: unit vector of its heading, (2,), if it is only on edges along that, either way.

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
            is_across = along is not None and abs(float(np.dot(edge, along))) < ALONG * length
            if apart < nearest - 1e-6 and (number == 0 or not is_across):
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


@dataclass(frozen=True, slots=True, eq=False)
class LineAside:
    """A line on the raster on which it will be resumed; empty if there is none.

    Attributes:
        walk: int32 (n, 2), its cells.
        line: its points, beginning where the robot left it.
        touched: window of the raster that maps may have changed since; None for none.
    """

    walk: Walk = field(default_factory=lambda: np.empty((0, 2), np.int32))
    line: Line = field(default_factory=Line)
    touched: Window | None = None

    @classmethod
    def of(cls, walk: Walk, line: Line, cell: int, place: Points) -> LineAside:
        """Set a line aside.

        Args:
            walk, line: the walk and the line along it.
            cell: index of the robot's cell in the walk.
            place: the robot's place on the first edge, (2,).
        """
        points = line.points.copy()
        points[0] = place
        return cls(walk[cell:], Line(points, np.maximum(line.cells - cell, 0), line.state))

    def moved(self, by: tuple[int, int]) -> LineAside:
        """Return this line shifted by rows and columns of the raster."""
        touched = self.touched and self.touched.moved(*by)
        return LineAside(self.walk, self.line.moved(by), touched)

    def on_map(self, touched: Window) -> LineAside:
        """Return this line on another map, which differs within a window."""
        return replace(self, touched=Window.around(self.touched, touched))


# Squared distance to a cell without a stand [pixels2]: more than any other.
NOWHERE_PX2 = 1e12


def aligned(points: Points, stands: Points) -> Numbers:
    """Return the index of each point's stand, ascending; ends belong to ends.

    The sum of the squared distances between points and their stands is the least.

    Args:
        points: float64 (n, 2): y, x [pixels], n of 2 or more.
        stands: float64 (m, 2), the same, NaN where a cell has none; m of 1 or more.

    Returns:
        int64 (n,).
    """
    apart = (points[:, :1] - stands[:, 0]) ** 2 + (points[:, 1:] - stands[:, 1]) ** 2
    apart[np.isnan(apart)] = NOWHERE_PX2
    # Least sums of the points up to now, by the last point's stand.
    sums = np.empty_like(apart)
    sums[0] = np.inf
    sums[0, 0] = 0.0
    for number in range(1, len(points)):
        np.minimum.accumulate(sums[number - 1], out=sums[number])
        sums[number] += apart[number]
    found = np.empty(len(points), np.int64)
    found[-1] = len(stands) - 1
    for number in range(len(points) - 2, -1, -1):
        found[number] = np.argmin(sums[number, : found[number + 1] + 1])
    return found


def by_distance(place: Points, stands: Points) -> NDArray[np.intp]:
    """Return the indices of stands by their distance to a place, (2,); NaN stands last."""
    apart: NDArray[np.float64] = ((stands - place) ** 2).sum(axis=1)
    return np.argsort(apart, kind="stable")
