"""Goals along a path: the pieces of it that Nav2 is given, and how far the robot is on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.follow.pieces import STEP_M, Line, end_of_piece
from fasaco_edge.grid.geometry import Point

# The next goal is sent only if it leads on by so much [m].
GAIN_M = 0.3
# Where the path comes back to itself, the next goal begins so far before the end of the one before
# [m]: what is left out there is less than half of a tool.
TIP_M = 0.1
# Where two paths are as near as this to each other they are the same [m].
SAME_M = 0.03
# Along a goal the robot is looked for so far ahead [m].
LOOK_AHEAD_M = 2.0
# After its goal was ended it rolls on by no more [m].
COAST_M = 0.5


@dataclass(slots=True)
class Goal:
    """A piece that Nav2 was given.

    Attributes:
        id: of the goal, 16 bytes.
        start, end: on the line [m].
        next_start: where the next one may begin, infinite where it has to wait for the end of this
            one; None as long as nobody looked [m].
    """

    id: bytes
    start: float
    end: float
    next_start: float | None = None


class PathDriven:
    """A path that is driven goal by goal.

    Attributes:
        line: the path.
        way: how far the robot is along it [m].
    """

    def __init__(self, line: Line, way: float) -> None:
        self.line, self.way = line, way
        # Where the last goal was done: from there the next one goes on, wherever the robot stopped.
        self._done = -1.0

    def finish(self, goal: Goal) -> None:
        """Note that a goal is done."""
        self.way = self._done = goal.end

    def advance(self, here: Point, goal: Goal | None) -> None:
        """Find the robot along the line: never back, and not beyond the goal it has, if any."""
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
        """Return how early a piece may begin that leads on from a goal; infinite if none does.

        Args:
            goal: the one before.
            ahead: how far before its end the piece begins where it can [m].
            near: how near a piece may not come to itself [m].
        """
        for before_m in (ahead, TIP_M, 0.0):
            start = max(goal.end - before_m, goal.start)
            if end_of_piece(self.line, start, near) >= goal.end + GAIN_M:
                return start
        return math.inf

    def shift_to(self, line: Line, way: float, goal: Goal) -> float | None:
        """Return how much further what is left of a goal is along another line [m].

        Args:
            line: the other line.
            way: how far the robot is along it [m].
            goal: of this line.

        Returns:
            None where the other line leads elsewhere before the goal's end.
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
