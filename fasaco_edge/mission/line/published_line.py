"""Published line: the part of the line that the robot has, and when it needs the newest line.

Maps, plans and polish change the line all the time, mostly far ahead of the robot. A change waits
until the robot comes near it; so it may yet be taken back, and is published with others. What is
published stays as it is for the next metres: polish begins beyond.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.line.polyline import Points

# A change this near is published at once: the robot needs a metre to stop, and a second [m], [s].
NEAR_M, NEAR_S = 1.0, 1.0
# One that is less than this ahead is published, once nothing is under way that changes the line
# there, or after the patience [m], [s]. So is a line that is cut off nearer than that, if the robot
# can drive on along the published one: a cell was lost, and a plan is there within that time.
DUE_M, DUE_S, PATIENCE_S = 2.0, 1.0, 1.0
# Length of a published line ahead of the robot that is no longer polished [m].
HELD_M = 4.0
# Points that are looked at: they reach farther than that.
SEEN_POINTS = 128
# A point is where it was if it is this near [m]: rasters are shifted.
SAME_M = 1e-3
NONE: NDArray[np.float64] = np.empty((0, 2))


class PublishedLine:
    """Compares the line with the published one.

    Args:
        speed_m_s: of the robot.
    """

    def __init__(self, speed_m_s: float) -> None:
        self._near_m = NEAR_M + NEAR_S * speed_m_s
        self._due_m = DUE_M + DUE_S * speed_m_s
        # The published points, of which one is the next ahead of the robot, and which of them is
        # the last that is held.
        self._xy: Points = NONE
        self._next = self._last_held = 0
        # Of the line at the last look: how many points after its first one are as published, and
        # how far it is to the last one of these; infinite if all are [m].
        self._common, self.differs_m = 0, 0.0
        self._due_since = math.inf

    def look(self, xy: Points) -> None:
        """Compare the line, float64 (n, 2): x, y [m], of which the first ``SEEN_POINTS`` points are
        enough; it begins at the robot."""
        ahead, known = xy[1:SEEN_POINTS], self._xy[self._next :]
        self._common, self.differs_m = 0, 0.0
        if len(xy) and len(self._xy) and not len(ahead) and not len(known):
            self.differs_m = math.inf  # both end where the robot is
        if not len(ahead) or not len(known):
            return
        at = np.flatnonzero(_are_same(known[:SEEN_POINTS], ahead[0]))
        if not len(at):
            return
        self._next += int(at[0])
        known = known[int(at[0]) :][: len(ahead) + 1]
        most = min(len(known), len(ahead))
        same = _are_same(known[:most], ahead[:most])
        self._common = most if same.all() else int(np.argmin(same))
        ends_alike = len(known) == len(ahead) or len(xy) > SEEN_POINTS
        if self._common == len(ahead) and ends_alike:
            self.differs_m = math.inf
        else:
            ways = np.diff(xy[: self._common + 1], axis=0)
            self.differs_m = float(np.hypot(*ways.T).sum())

    @property
    def held(self) -> int:
        """How many points of the line, from its first one on, are not to be polished."""
        return min(self._last_held - self._next + 2, self._common + 1)

    def is_due(self, now: float, is_settled: bool, leads_on: Callable[[Points], bool]) -> bool:
        """Return whether the line has to be published, as it was at the last look.

        Args:
            now: [s].
            is_settled: whether nothing is under way that changes the next metres.
            leads_on: whether the robot can drive along the next points of the published line,
                float64 (n, 2): x, y [m], of which the first is behind it, while a plan is made.
        """
        if self.differs_m > self._due_m:
            self._due_since = math.inf
            return False
        self._due_since = min(self._due_since, now)
        if is_settled or now - self._due_since >= PATIENCE_S:
            return True
        return self.differs_m <= self._near_m and not leads_on(self._near())

    def _near(self) -> Points:
        """Return the points around the next metre of the published line."""
        rest = self._xy[max(self._next - 1, 0) :][:SEEN_POINTS]
        ways = np.hypot(*np.diff(rest[1:], axis=0).T) if len(rest) > 1 else np.empty(0)
        return rest[: int(np.searchsorted(np.cumsum(ways), self._near_m)) + 3]

    def take(self, xy: Points, polished: int) -> None:
        """Note that a line is published, and the number of its polished points."""
        self._xy, self._next, self._due_since = xy, 1, math.inf
        ways = np.hypot(*np.diff(xy[:SEEN_POINTS], axis=0).T) if len(xy) > 1 else np.empty(0)
        held = int(np.searchsorted(np.cumsum(ways), HELD_M)) + 1
        self._last_held = min(held, polished - 1)
        self._common, self.differs_m = max(len(xy) - 1, 0), math.inf

    def forget(self) -> None:
        """Note that the robot has no line, or another one."""
        self.take(NONE, 0)


def _are_same(points: Points, others: Points) -> NDArray[np.bool_]:
    same: NDArray[np.bool_] = np.abs(points - others).max(axis=1) <= SAME_M
    return same
