"""Goals along a path: the pieces sent to Nav2, and the robot's progress on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.follow.pieces import LEAST_M, STEP_M, Line, end_of_piece
from fasaco_edge.grid.geometry import Point

# The next goal is sent only if it extends the last one by this much [m].
GAIN_M = 0.3
# Where the path returns to itself, the next goal begins this far before the end of the last one
# [m]: the part skipped there is less than half of a tool.
TIP_M = 0.1
# If a part before that point returns to itself, the next goal begins earlier: one of these shares
# of the usual distance before the end.
SHARES = (1.0, 0.6, 0.35, 0.2)
# A goal that begins early extends beyond the last one by as much as it begins before that one's
# end, up to this [m].
AMPLE_M = 2.0
# Two paths nearer than this to each other are the same [m].
SAME_M = 0.03
# The robot is searched this far ahead along a goal [m].
LOOK_AHEAD_M = 2.0
# After its goal has ended the robot rolls on by at most this [m].
COAST_M = 0.5


@dataclass(slots=True)
class Goal:
    """A piece sent to Nav2.

    Attributes:
        id: of the goal, 16 bytes.
        start, end: on the line [m].
        next_start: where the next one may begin, infinite if it must wait for the end of this
            one; None if not computed yet [m].
    """

    id: bytes
    start: float
    end: float
    next_start: float | None = None


class PathDriven:
    """A path driven goal by goal.

    Attributes:
        line: the path.
        way: the robot's distance along it [m].
    """

    def __init__(self, line: Line, way: float) -> None:
        self.line, self.way = line, way
        # End of the last finished goal: the next one begins there, even if the robot stopped
        # elsewhere.
        self._done = -1.0

    def finish(self, goal: Goal) -> None:
        """Note that a goal is done."""
        self.way = self._done = goal.end

    def advance(self, here: Point, goal: Goal | None) -> None:
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

    def start_after(self, goal: Goal, ahead: float, near: float) -> float:
        """Return the earliest start of a piece that continues a goal; infinite if there is none.

        Args:
            goal: the last goal.
            ahead: distance before its end at which the piece begins if possible [m].
            near: least distance of a piece to itself [m].
        """
        if self.line.reversals(goal.end - LEAST_M, goal.end):
            return math.inf  # the robot has to come to rest there
        for before_m in (*(share * ahead for share in SHARES), TIP_M, 0.0):
            start = max(goal.end - before_m, goal.start)
            # A goal that begins early ends sooner: it must last until the next one arrives.
            gain_m = max(min(before_m, AMPLE_M), GAIN_M)
            if end_of_piece(self.line, start, near) >= goal.end + gain_m:
                return start
        return math.inf

    def heading_after(self, goal: Goal) -> float | None:
        """Return the heading in which the line leads on after a goal [rad]; None at its end."""
        if self.line.length(goal.end + STEP_M) < goal.end + STEP_M:
            return None
        if self.line.reversals(goal.end - LEAST_M, goal.end):
            return None
        (x, y), (to_x, to_y) = self.line.at(goal.end), self.line.at(goal.end + STEP_M)
        turned = math.pi if self.line.is_back(goal.end) else 0.0
        return math.remainder(math.atan2(to_y - y, to_x - x) + turned, math.tau)

    def is_near_end(self, here: Point, goal: Goal, within: float) -> bool:
        """Return whether the robot is within a distance of the end of its goal [m].

        Nav2 ends a goal by this distance, also where the robot has cut a bend before the end.
        """
        is_last_part = goal.end - self.way <= COAST_M
        return is_last_part and math.dist(here, self.line.at(goal.end)) <= within

    def shift_to(self, line: Line, way: float, goal: Goal) -> float | None:
        """Return the offset of a goal's rest along another line [m].

        Args:
            line: the other line.
            way: the robot's distance along it [m].
            goal: of this line.

        Returns:
            None if the other line diverges before the goal's end.
        """
        was, far = self.line.nearest(line.at(way), self.way, goal.end)
        left = goal.end - was
        if far > SAME_M or line.length(way + left) < way + left - SAME_M:
            return None
        same = all(
            math.dist(self.line.at(was + part), line.at(way + part)) <= SAME_M
            for part in _parts(left)
        )
        return way - was if same else None


def _parts(length: float) -> list[float]:
    count = max(math.ceil(length / (2 * STEP_M)), 1)
    return [length * part / count for part in range(count + 1)]
