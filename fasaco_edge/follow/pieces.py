"""Pieces of a path that neither cross nor approach themselves: the goals of Nav2's controller.

A coverage path crosses and touches itself. A controller with the whole path would continue at the
nearest part, and finish wherever the end is near. So it gets one simple piece at a time: two poses
of a piece whose distance along it exceeds ``APART`` times ``near`` are at least ``near`` apart.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from fasaco_edge.follow.legs import apart
from fasaco_edge.grid.geometry import Point, Pose2D

# Largest spacing of the poses of a piece [m].
STEP_M = 0.05
# Distance along a piece up to which poses may be near each other, as in a bend of up to 120 degrees
# [``near``].
APART = 2.0
# Angle of a bend above which the robot turns on the spot, so that a piece preferably ends there
# [rad].
CORNER_RAD = math.radians(60.0)
# Longest piece [m].
MOST_M = 20.0
# Angle of a bend above which a robot that cannot turn on the spot changes between forward and
# backward [rad].
REVERSAL_RAD = math.radians(120.0)
# Points nearer to each other than this count as one [m].
LEAST_M = 1e-3


class PathByLength:
    """A path parametrised by arc length, from 0 at its start, and read lazily."""

    def __init__(self, poses: Iterable[Pose2D], *, is_curved: bool = False) -> None:
        self._coming = apart(poses, LEAST_M)
        # Whether the robot cannot turn on the spot, and may drive backward.
        self._is_curved = is_curved
        # Heading of the robot at the beginning [rad].
        self._yaw = 0.0
        self._points: list[Point] = []
        self._ways: list[float] = []

    def length(self, most: float) -> float:
        """Return its length, or ``most`` if it is longer [m]."""
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
        """Return the point at an arc length [m]; outside the path, its beginning or end."""
        self.length(way)
        index = bisect_right(self._ways, way)
        if not 0 < index < len(self._ways):
            return self._points[0 if index == 0 else -1]
        (x, y), (to_x, to_y) = self._points[index - 1 : index + 1]
        share = (way - self._ways[index - 1]) / (self._ways[index] - self._ways[index - 1])
        return x + share * (to_x - x), y + share * (to_y - y)

    def nearest(self, here: Point, start: float, stop: float) -> tuple[float, float]:
        """Return the arc length of the point nearest to ``here`` between two limits, and the
        distance [m]; of equally near points, the first."""
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
        the ends of lanes. A robot that turns on the spot always drives forward.
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
        """Return arc lengths from ``start`` to ``stop``, up to ``STEP_M`` apart, with bends [m]."""
        first, last = bisect_right(self._ways, start), bisect_right(self._ways, stop)
        bends = [way for way in self._ways[first:last] if start < way < stop]
        ways = [start]
        for bend in (*bends, stop):
            parts = max(math.ceil((bend - ways[-1]) / STEP_M - 1e-9), 1)
            begin = ways[-1]
            ways += [begin + (bend - begin) * part / parts for part in range(1, parts)]
            ways.append(bend)
        return ways


def end_of_piece(line: PathByLength, start: float, near: float) -> float:
    """Return the end of a piece that begins at ``start``, as arc length [m].

    A piece that cannot reach the line's end stops at the last corner, if that is near: the robot
    stops there anyway.

    Args:
        line: the path.
        start: arc length where the piece begins [m].
        near: least distance between separate stretches of the piece [m].
    """
    stop = line.length(start + MOST_M)
    stop = min([stop, *line.reversals(start + LEAST_M, stop)])
    ways = line.ways(start, stop)
    points = [line.at(way) for way in ways]
    # Earlier poses that are far enough away along the piece to count, by square of the plane.
    seen: dict[tuple[int, int], list[int]] = {}
    filed = 0
    for index, (way, (x, y)) in enumerate(zip(ways, points, strict=True)):
        while way - ways[filed] > APART * near:
            square = math.floor(points[filed][0] / near), math.floor(points[filed][1] / near)
            seen.setdefault(square, []).append(filed)
            filed += 1
        col, row = math.floor(x / near), math.floor(y / near)
        around = [(col + right, row + up) for right in (-1, 0, 1) for up in (-1, 0, 1)]
        others = [other for square in around for other in seen.get(square, ())]
        touched = [other for other in others if math.dist(points[other], (x, y)) < near]
        if touched:
            corners = line.corners(max(ways[max(touched)], start), ways[index - 1])
            late = [corner for corner in corners if corner >= way - 2.0 * APART * near]
            return late[-1] if late and late[-1] > start + LEAST_M else ways[index - 1]
    return stop


# The next goal is sent only if it extends the last goal by this much [m].
GAIN_M = 0.3
# Where the path returns to itself, the next goal begins this far before the end of the last goal
# [m]: the part skipped there is less than half of a tool.
TIP_M = 0.1
# Distances before the end of the last goal at which the next goal may begin, in order of
# preference, as shares of the largest.
SHARES = (1.0, 0.6, 0.35, 0.2)
# The earlier a goal begins before the end of the last goal, the farther it must extend beyond that
# end: by the same distance, up to this [m].
AMPLE_M = 2.0
# Two paths nearer than this to each other are the same [m].
SAME_M = 0.03
# Largest progress of the robot along a goal from one pose to the next [m].
LOOK_AHEAD_M = 2.0
# After its goal has ended, the robot rolls on by at most this [m].
COAST_M = 0.5


@dataclass(slots=True)
class SentPiece:
    """A piece sent to Nav2, from ``start`` to ``end`` on the line [m]."""

    id: bytes
    start: float
    end: float
    # Where the next goal may begin [m]: infinite if it must wait for the end of this goal; None
    # until it is computed.
    next_start: float | None = None


class PathDriven:
    """A path driven goal by goal: its line, and the robot's distance along it [m]."""

    def __init__(self, line: PathByLength, way: float) -> None:
        self.line, self.way = line, way
        # End of the last finished goal: the next goal begins there, wherever the robot stopped.
        self._done = -1.0

    def finish(self, goal: SentPiece) -> None:
        """Note that a goal is done."""
        self.way = self._done = goal.end

    def advance(self, here: Point, goal: SentPiece | None) -> None:
        """Update the robot's distance along the line: never backward nor beyond its goal."""
        if goal is not None:
            end = min(goal.end, self.way + LOOK_AHEAD_M)
        elif self.way != self._done:
            end = self.line.length(self.way + COAST_M)
            end = min([end, *self.line.corners(self.way + STEP_M, end)])
        else:
            return
        if end > self.way:
            self.way, _ = self.line.nearest(here, self.way, end)

    def start_after(self, goal: SentPiece, ahead: float, near: float) -> float:
        """Return the earliest start of a piece that continues a goal; infinite if there is none.

        Args:
            goal: the last goal.
            ahead: distance before its end at which the piece begins if possible [m].
            near: least distance between separate stretches of a piece [m].
        """
        if self.line.reversals(goal.end - LEAST_M, goal.end):
            return math.inf  # the robot has to come to rest there
        for before_m in (*(share * ahead for share in SHARES), TIP_M, 0.0):
            start = max(goal.end - before_m, goal.start)
            # A goal that begins early also ends early: it must last until the next goal arrives.
            gain_m = max(min(before_m, AMPLE_M), GAIN_M)
            if end_of_piece(self.line, start, near) >= goal.end + gain_m:
                return start
        return math.inf

    def heading_after(self, goal: SentPiece) -> float | None:
        """Return the heading of the line beyond a goal [rad]; None at the line's end, or where the
        robot turns back."""
        if self.line.length(goal.end + STEP_M) < goal.end + STEP_M:
            return None
        if self.line.reversals(goal.end - LEAST_M, goal.end):
            return None
        (x, y), (to_x, to_y) = self.line.at(goal.end), self.line.at(goal.end + STEP_M)
        turned = math.pi if self.line.is_back(goal.end) else 0.0
        return math.remainder(math.atan2(to_y - y, to_x - x) + turned, math.tau)

    def is_near_end(self, here: Point, goal: SentPiece, within: float) -> bool:
        """Return whether the robot is within a distance of the end of its goal [m].

        Nav2 ends a goal by this distance, even if the robot has cut a bend before the end.
        """
        is_last_part = goal.end - self.way <= COAST_M
        return is_last_part and math.dist(here, self.line.at(goal.end)) <= within

    def shift_to(self, line: PathByLength, way: float, goal: SentPiece) -> float | None:
        """Return the offset of another line's arc lengths from this line's [m]; None if the lines
        differ before the goal ends.

        ``way``: the robot's distance along the other line [m].
        """
        was, far = self.line.nearest(line.at(way), self.way, goal.end)
        left = goal.end - was
        if far > SAME_M or line.length(way + left) < way + left - SAME_M:
            return None
        count = max(math.ceil(left / (2 * STEP_M)), 1)
        parts = (left * part / count for part in range(count + 1))
        at, there = self.line.at, line.at
        is_same = all(math.dist(at(was + part), there(way + part)) <= SAME_M for part in parts)
        return way - was if is_same else None
