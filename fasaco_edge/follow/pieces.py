"""Pieces of a path that neither cross nor approach themselves, as poses for a controller.

A coverage path crosses and touches itself. A controller with the whole path would continue at the
nearest part, and finish wherever the end is near. So it gets a simple piece at a time: two poses
further apart along the piece than ``APART`` times ``near`` have a distance of at least ``near``.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable

from fasaco_edge.follow.route import apart
from fasaco_edge.grid.geometry import Point, Pose2D

# Spacing of the poses of a piece [m]: controllers search the nearest one.
STEP_M = 0.05
# Poses that are up to this many times ``near`` apart along a piece may be near each other, as in a
# bend of up to 120 degrees.
APART = 2.0
# At a sharper bend the robot turns on the spot: a piece preferably ends there [rad].
CORNER_RAD = math.radians(60.0)
# Longest piece [m].
MOST_M = 20.0
# A robot that cannot turn on the spot changes between forward and backward at a sharper bend [rad].
REVERSAL_RAD = math.radians(120.0)
# Points nearer to each other than this count as one [m].
LEAST_M = 1e-3


class Line:
    """A path parametrised by arc length, from 0 at its start.

    Args:
        poses: of the path, read as they are needed.
        is_curved: whether the robot cannot turn on the spot, and may drive backward.
    """

    def __init__(self, poses: Iterable[Pose2D], *, is_curved: bool = False) -> None:
        self._coming = apart(poses, LEAST_M)
        self._is_curved = is_curved
        # Robot's heading at its beginning [rad].
        self._yaw = 0.0
        self._points: list[Point] = []
        self._ways: list[float] = []

    def length(self, most: float) -> float:
        """Return its length, at most ``most`` [m]."""
        while not self._ways or self._ways[-1] < most:
            pose = next(self._coming, None)
            if pose is None:
                return self._ways[-1] if self._ways else 0.0
            point = pose.x, pose.y
            if self._points:
                self._ways.append(self._ways[-1] + math.dist(self._points[-1], point))
            else:
                self._yaw = pose.yaw
                self._ways.append(0.0)
            self._points.append(point)
        return most

    def at(self, way: float) -> Point:
        """Return the point at an arc length [m]; the end or begin for values beyond."""
        self.length(way)
        index = bisect_right(self._ways, way)
        if not 0 < index < len(self._ways):
            return self._points[0 if index == 0 else -1]
        (x, y), (to_x, to_y) = self._points[index - 1 : index + 1]
        share = (way - self._ways[index - 1]) / (self._ways[index] - self._ways[index - 1])
        return x + share * (to_x - x), y + share * (to_y - y)

    def nearest(self, here: Point, start: float, stop: float) -> tuple[float, float]:
        """Return the arc length between two limits nearest to a point, and the distance [m].

        Of equally near ones the first counts.
        """
        self.length(stop)
        best, best_m = start, math.dist(self.at(start), here)
        index = bisect_right(self._ways, start)
        while True:
            end = min(self._ways[index], stop) if index < len(self._ways) else start
            if end <= start:
                return best, best_m
            (ax, ay), (bx, by) = self.at(start), self.at(end)
            length = end - start
            along = ((here[0] - ax) * (bx - ax) + (here[1] - ay) * (by - ay)) / length
            way = start + min(max(along, 0.0), length)
            far = math.dist(self.at(way), here)
            if far < best_m - LEAST_M:
                best, best_m = way, far
            start, index = end, index + 1

    def corners(self, start: float, stop: float) -> list[float]:
        """Return the arc lengths of sharp bends between two limits, in order [m]."""
        return self.bends(start, stop, CORNER_RAD)

    def reversals(self, start: float, stop: float) -> list[float]:
        """Return the arc lengths between two limits where the robot turns back, in order [m].

        A piece ends there: the robot comes to rest, and a controller that may reverse would cut
        the ends of lanes. One that turns on the spot always drives forward.
        """
        return self.bends(start, stop, REVERSAL_RAD) if self._is_curved else []

    def is_back(self, way: float) -> bool:
        """Return whether the robot drives backward from an arc length on."""
        if not self._is_curved:
            return False
        (x, y), (to_x, to_y) = self.at(0.0), self.at(LEAST_M)
        along = math.atan2(to_y - y, to_x - x) - self._yaw
        return (len(self.reversals(0.0, way)) % 2 == 1) != (math.cos(along) < 0.0)

    def bends(self, start: float, stop: float, least: float) -> list[float]:
        """Return the arc lengths of bends of more than ``least`` [rad] between two limits [m]."""
        self.length(stop + LEAST_M)
        first = max(bisect_right(self._ways, start), 1)
        found = []
        for index in range(first, len(self._ways) - 1):
            if self._ways[index] > stop:
                break
            (ax, ay), (bx, by), (cx, cy) = self._points[index - 1 : index + 2]
            turn = math.atan2(cy - by, cx - bx) - math.atan2(by - ay, bx - ax)
            if abs(math.remainder(turn, math.tau)) > least:
                found.append(self._ways[index])
        return found

    def ways(self, start: float, stop: float) -> list[float]:
        """Return arc lengths between two, ``STEP_M`` apart and at each corner [m]."""
        first, last = bisect_right(self._ways, start), bisect_right(self._ways, stop)
        bends = [way for way in self._ways[first:last] if start < way < stop]
        ways = [start]
        for bend in (*bends, stop):
            parts = max(math.ceil((bend - ways[-1]) / STEP_M - 1e-9), 1)
            begin = ways[-1]
            ways += [begin + (bend - begin) * part / parts for part in range(1, parts)]
            ways.append(bend)
        return ways


def end_of_piece(line: Line, start: float, near: float) -> float:
    """Return the end of a piece that begins at ``start``, as arc length [m].

    If it must end before the line does, it ends at a corner of the last ``APART`` times
    ``near``, if there is one: the robot stops there anyway.

    Args:
        line: the path.
        start: where the piece begins [m].
        near: least distance of the piece to itself [m].
    """
    stop = line.length(start + MOST_M)
    stop = min([stop, *line.reversals(start + LEAST_M, stop)])
    ways = line.ways(start, stop)
    seen: dict[tuple[int, int], list[int]] = {}
    points = [line.at(way) for way in ways]
    # Poses that are far enough behind to count are added as the piece grows.
    filed = 0
    for index, (way, point) in enumerate(zip(ways, points, strict=True)):
        while way - ways[filed] > APART * near:
            seen.setdefault(_cell(points[filed], near), []).append(filed)
            filed += 1
        if (other := _touched(seen, points, point, near)) is not None:
            corners = line.corners(max(ways[other], start), ways[index - 1])
            late = [corner for corner in corners if corner >= way - 2.0 * APART * near]
            return late[-1] if late and late[-1] > start + LEAST_M else ways[index - 1]
    return stop


def _touched(
    seen: dict[tuple[int, int], list[int]], points: list[Point], point: Point, near: float
) -> int | None:
    """Return the last stored point that a point is too near to."""
    column, row = _cell(point, near)
    touched = [
        other
        for east in (-1, 0, 1)
        for north in (-1, 0, 1)
        for other in seen.get((column + east, row + north), ())
        if math.dist(points[other], point) < near
    ]
    return max(touched, default=None)


def _cell(point: Point, near: float) -> tuple[int, int]:
    return math.floor(point[0] / near), math.floor(point[1] / near)
