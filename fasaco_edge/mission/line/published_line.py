"""Published line: the line as last published, and the decision when to publish a changed line.

Maps, plans and polishing change the line all the time, mostly far ahead of the robot. A change
waits until the robot comes near it, as a later change may undo it. The next metres of the published
line are not polished.

A new path for a robot that stands is published at once, as the robot comes no nearer to the change.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.events import PathUpdate
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import POLISHED, Points
from fasaco_edge.mission.map.stay import Stay
from fasaco_edge.mission.path.route import Route

# A change nearer than NEAR_M [m], or NEAR_S [s] of driving, is published at once, unless the robot
# can drive on along the published line: the robot needs that much to stop.
NEAR_M, NEAR_S = 1.0, 1.0
# A change nearer than DUE_M [m], or DUE_S [s] of driving, waits up to PATIENCE_S [s] for a plan or
# for polish: a line that a map has cut off gets a new plan within that time.
DUE_M, DUE_S, PATIENCE_S = 2.0, 1.0, 1.0
# Length of the published line ahead of the robot that is no longer polished [m].
HELD_M = 4.0
# Number of points compared; they reach farther than HELD_M.
COMPARED_POINTS = 128
# Points within this distance are the same [m]: a change of the raster rounds their coordinates.
SAME_M = 1e-3
NONE: NDArray[np.float64] = np.empty((0, 2))


class PublishedLine:
    """Compares the line with the published line.

    Args:
        speed_m_s: speed of the robot.
    """

    def __init__(self, speed_m_s: float) -> None:
        self._near_m = NEAR_M + NEAR_S * speed_m_s
        self._due_m = DUE_M + DUE_S * speed_m_s
        # The published points; the indices of the next point ahead of the robot, and of the last
        # point that is held.
        self._xy: Points = NONE
        self._next = self._last_held = 0
        # At the last comparison: the number of points, after the line's first, that equal published
        # points, and the distance to the last of them [m]; infinite if all are equal.
        self._common, self.differs_m = 0, 0.0
        self._due_since = math.inf

    def compare(self, xy: Points) -> None:
        """Compare the line from the robot on, float64 (n, 2): x, y [m]; its first
        ``COMPARED_POINTS`` points suffice."""
        ahead, known = xy[1:COMPARED_POINTS], self._xy[self._next :]
        self._common, self.differs_m = 0, 0.0
        if len(xy) and len(self._xy) and not len(ahead) and not len(known):
            self.differs_m = math.inf  # both end where the robot is
        if not len(ahead) or not len(known):
            return
        at = np.flatnonzero(_are_same(known[:COMPARED_POINTS], ahead[0]))
        if not len(at):
            return
        self._next += int(at[0])
        known = known[int(at[0]) :][: len(ahead) + 1]
        most = min(len(known), len(ahead))
        same = _are_same(known[:most], ahead[:most])
        self._common = most if same.all() else int(np.argmin(same))
        ends_alike = len(known) == len(ahead) or len(xy) > COMPARED_POINTS
        if self._common == len(ahead) and ends_alike:
            self.differs_m = math.inf
        else:
            ways = np.diff(xy[: self._common + 1], axis=0)
            self.differs_m = float(np.hypot(*ways.T).sum())

    @property
    def held(self) -> int:
        """Number of the line's first points that are not to be polished."""
        return min(self._last_held - self._next + 2, self._common + 1)

    @property
    def is_near(self) -> bool:
        """Whether the robot is near the first change."""
        return self.differs_m <= self._due_m

    def is_due(self, now: float, is_settled: bool, leads_on: Callable[[Points], bool]) -> bool:
        """Return whether the line of the last comparison has to be published.

        Args:
            now: [s].
            is_settled: whether neither a plan nor polish is about to change the next metres.
            leads_on: whether the robot can drive along the next points of the published line,
                float64 (n, 2): x, y [m], while a plan is made.
        """
        if not self.is_near:
            self._due_since = math.inf
            return False
        self._due_since = min(self._due_since, now)
        if is_settled or now - self._due_since >= PATIENCE_S:
            return True
        return self.differs_m <= self._near_m and not leads_on(self._near())

    def _near(self) -> Points:
        rest = self._xy[self._next :][:COMPARED_POINTS]
        ways = np.hypot(*np.diff(rest, axis=0).T) if len(rest) > 1 else np.empty(0)
        return rest[: int(np.searchsorted(np.cumsum(ways), self._near_m)) + 2]

    def record_published(self, xy: Points, polished: int) -> None:
        """Record a line as published, with the number of its polished points."""
        self._xy, self._next, self._due_since = xy, 1, math.inf
        ways = np.hypot(*np.diff(xy[:COMPARED_POINTS], axis=0).T) if len(xy) > 1 else np.empty(0)
        held = int(np.searchsorted(np.cumsum(ways), HELD_M)) + 1
        self._last_held = min(held, polished - 1)
        self._common, self.differs_m = max(len(xy) - 1, 0), math.inf

    def reset(self) -> None:
        """Forget the line: the robot has no line, or another line."""
        self.record_published(NONE, 0)


def _are_same(points: Points, others: Points) -> NDArray[np.bool_]:
    same: NDArray[np.bool_] = np.abs(points - others).max(axis=1) <= SAME_M
    return same


# A robot stands if it moves less than STANDING_M [m] in STANDING_S [s]; turns take less time.
STANDING_M, STANDING_S = 0.05, 3.0


class Publication:
    """Keeps back paths that may wait.

    Attributes:
        line: the line as last published.

    Args:
        route: numbers the paths.
        speed_m_s: speed of the robot.
    """

    def __init__(self, route: Route, speed_m_s: float) -> None:
        self._route = route
        self.line = PublishedLine(speed_m_s)
        # The newest path that waits; the newest reason for a change of the line alone.
        self._waiting: PathUpdate | None = None
        self._why = ""
        self._stay = Stay(STANDING_M)

    def compare(self, ahead: LineAhead) -> int:
        """Compare the line with the published line; return how many of its points are held."""
        self.line.compare(ahead.next_xy(COMPARED_POINTS))
        return self.line.held

    def finish(
        self, ahead: LineAhead, update: PathUpdate | None, reason: str, now: float, *, is_way: bool
    ) -> PathUpdate | None:
        """Return the update to publish now, with its line; None if there is none, or if it waits.

        Args:
            ahead: the line, as at the last comparison.
            update: the new path, if there is one.
            reason: why the line changes; "" if it does not change, or only by polishing.
            now: [s].
            is_way: whether the path is only a way: then nothing waits.
        """
        route, waiting = self._route, self._waiting
        stands = not self._stay.update(ahead.here, now) and now - self._stay.since > STANDING_S
        if update is None and not len(route.path.cells):
            self._waiting = None
            return None
        if update is None or (update.may_wait and len(update.cells)):
            if update is not None:
                route.keep_back()
                plan = waiting.plan if waiting and update.plan is None else update.plan
                waiting = self._waiting = replace(update, plan=plan)
            is_due = self.line.is_due(
                now, self._is_settled(ahead), lambda xy: route.is_cut and ahead.leads_on(xy)
            )
            is_due = is_due or (stands and waiting is not None)
            if not (waiting or reason if is_way else is_due):
                self._why = reason or self._why
                return None
            update = route.publish_line(reason or self._why or "line polished", now)
            if waiting is not None:
                update = replace(waiting, revision=update.revision, cells=update.cells)
        self._waiting, self._why = None, ""
        if update.xy is not None:
            self.line.reset()
            return update  # a way out, along no cells
        if not len(update.cells):
            self.line.reset()
            return replace(update, xy=NONE)
        polished = ahead.line.first_below(POLISHED)
        self.line.record_published(ahead.next_xy(len(ahead.line) + 1), polished)
        return replace(update, xy=ahead.xy())

    def _is_settled(self, ahead: LineAhead) -> bool:
        """Whether no plan and no polishing under way can change the next metres."""
        route = self._route
        is_planned = not route.requests.wanted and (
            route.requests.pending is None or route.requests.is_improving
        )
        rough, lengths = ahead.line.first_below(POLISHED), ahead.lengths(HELD_M)
        return is_planned and (rough >= len(lengths) - 1 or float(lengths[rough]) > HELD_M)
