"""Place on line: the robot's place on its line, the cells of the line's points, and the offset.

Lengths are in pixels of the fine raster, as the line's points, float64 (n, 2).

Alignment: assigns a cell of the walk to each point of the line. The polisher moves, removes and
inserts points, so their cells are found again by distance (dynamic time warping, Sakoe and Chiba
1978).

Offset: tracking errors at corners and after a push are to both sides. A constant offset shows a
fault: the base steers another point along the line than the point of the pose, or it pulls to one
side.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point
from fasaco_edge.mission.line.polyline import Numbers, Points

# The robot's place on its line is searched for up to this far ahead, or as far as it may have
# driven [m]: farther ahead, another lane may be as near.
LOOK_AHEAD_M = 0.8
# A robot has arrived within ARRIVED_M of the end of its line [m]. A robot beside its line has
# arrived once its tool covers the end, and STANDING_POSES in a row come no nearer.
ARRIVED_M, STANDING_POSES = 0.05, 10
# Cosine of the largest angle between an edge and the heading of a robot that cannot turn on the
# spot. Such a robot is on no other edge, even where its curve crosses itself.
LEAST_COSINE = math.cos(math.radians(40.0))

# The offset is sampled every STEP_M, at least CORNER_M from corners. Poses farther apart than
# JUMP_M are a jump [m].
STEP_M, CORNER_M, JUMP_M = 0.05, 0.25, 1.0
# A bend of more than this is a corner [rad].
BEND_RAD = math.radians(10.0)
# Most samples kept, of 10 m of driving; fewest samples needed, of 5 m.
MOST_SAMPLES, LEAST_SAMPLES = 200, 100
# The least offset that counts is TOOL_SHARE of the tool's width, but not less than LEAST_M [m], the
# accuracy of a follower.
TOOL_SHARE, LEAST_M = 0.1, 0.03
# Least share of the samples on one side.
ONE_SIDE = 0.8


class Beside(NamedTuple):
    """A robot's offset from its line.

    Attributes:
        left_m: distance to the left of the line, negative to its right [m].
        heading: direction of the line there [rad].
        bend: angle from this direction to a point on the line ``CORNER_M`` ahead [rad].
    """

    left_m: float
    heading: float
    bend: float


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
        """Return whether the robot is on the line, within ``tool``, half the tool's width."""
        return len(points) > 1 and math.hypot(*(self.on(points) - self.here)) <= tool

    def beside(self, points: Points, unit_m: float) -> Beside | None:
        """Return the robot's offset from its line; None at the end of the line.

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
            look: the distance ahead that is searched.
            along: unit vector of the robot's heading, (2,), to search only edges along it, in
                either direction; None for all edges.

        Returns:
            The index of the nearest edge; None if no edge is within ``tool``.
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
            is_across = (
                along is not None and abs(float(np.dot(edge, along))) < LEAST_COSINE * length
            )
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


class Offset:
    """Collects offsets of the robot from its line, and judges them."""

    def __init__(self, tool_m: float) -> None:
        """Begin; ``tool_m``: width of the tool [m]."""
        self._limit_m = max(TOOL_SHARE * tool_m, LEAST_M)
        self._left_m: deque[float] = deque(maxlen=MOST_SAMPLES)
        # The last position, and the line's heading there; distance driven since the last corner,
        # and since the last sample.
        self._last: tuple[Point, float] | None = None
        self._straight_m = self._since_m = 0.0

    def continue_from(self, before: Offset) -> None:
        """Take over the samples of a predecessor."""
        self._left_m = before._left_m

    def record(self, at: Point, beside: Beside | None) -> None:
        """Record a pose at x, y [m] beside its line; None for no line there."""
        before, self._last = self._last, (at, beside.heading) if beside else None
        if beside is None or before is None:
            self._straight_m = 0.0
            return
        driven_m, turned = math.dist(before[0], at), beside.heading - before[1]
        if abs(math.remainder(turned, math.tau)) > BEND_RAD or driven_m > JUMP_M:
            self._straight_m = 0.0
            return
        self._straight_m += driven_m
        self._since_m += driven_m
        is_straight = self._straight_m >= CORNER_M and abs(beside.bend) <= BEND_RAD
        if is_straight and self._since_m >= STEP_M:
            self._left_m.append(beside.left_m)
            self._since_m = 0.0

    @property
    def why(self) -> str:
        """The robot's constant offset from its line, in words; "" for none."""
        if len(self._left_m) < LEAST_SAMPLES:
            return ""
        middle_m = median(self._left_m)
        same = sum(left_m * middle_m > 0.0 for left_m in self._left_m)
        if abs(middle_m) < self._limit_m or same < ONE_SIDE * len(self._left_m):
            return ""
        side = "left" if middle_m > 0.0 else "right"
        return f"drives {100 * abs(middle_m):.0f} cm {side} of its line"


# Squared distance to a cell without a stand [pixels2]: more than any other.
NOWHERE_PX2 = 1e12


def aligned(points: Points, stands: Points) -> Numbers:
    """Return the index of each point's stand, ascending, from the first stand to the last.

    Minimises the sum of the squared distances between points and their stands.

    Args:
        points: float64 (n, 2): y, x [pixels], n of 2 or more.
        stands: float64 (m, 2): y, x [pixels], NaN for a cell without a stand; m of 1 or more.

    Returns:
        int64 (n,).
    """
    apart = (points[:, :1] - stands[:, 0]) ** 2 + (points[:, 1:] - stands[:, 1]) ** 2
    apart[np.isnan(apart)] = NOWHERE_PX2
    # Least sum over the points so far, for each stand of the last point.
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
