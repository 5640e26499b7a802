"""Publication of the line: at once, or together with later changes once the robot comes near.

A new path for a robot that stands never waits: it may come near nothing for long.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fasaco_edge.mission.core.events import PathUpdate
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import POLISHED
from fasaco_edge.mission.line.published_line import HELD_M, SEEN_POINTS, PublishedLine

# A robot stands if it has moved less than this in this time [m], [s]; a turn on the spot is faster.
STANDING_M, STANDING_S = 0.05, 3.0


class Publication:
    """Keeps back paths that may wait.

    Args:
        route: numbers the paths.
        speed_m_s: of the robot.
    """

    def __init__(self, route: Route, speed_m_s: float) -> None:
        self._route = route
        self._line = PublishedLine(speed_m_s)
        # The newest path that waits, and the newest reason for which the line alone changed.
        self._waiting: PathUpdate | None = None
        self._why = ""
        # Where the robot was last seen to move, x, y [m], and until when [s].
        self._at, self._moved_at = (math.inf, math.inf), -math.inf

    def look(self, ahead: LineAhead) -> int:
        """Compare the line with the published one; return how many of its points are held."""
        self._line.look(ahead.next_xy(SEEN_POINTS))
        return self._line.held

    def forget(self) -> None:
        """Note that the robot has no line, or another one."""
        self._line.forget()

    def finish(
        self, ahead: LineAhead, update: PathUpdate | None, reason: str, now: float, *, is_way: bool
    ) -> PathUpdate | None:
        """Return the update to publish now, with its line; None if there is none, or if it waits.

        Args:
            ahead: the line, as at the last look.
            update: the new path, if there is one.
            reason: why the line changes; "" if it does not, or is polished.
            now: [s].
            is_way: whether the path is only a way, on which nothing waits.
        """
        route, waiting = self._route, self._waiting
        stands = self._stands(ahead, now)
        if update is None and not len(route.path.cells):
            self._waiting = None
            return None
        if update is None or (update.may_wait and len(update.cells)):
            if update is not None:
                route.keep_back()
                plan = waiting.plan if waiting and update.plan is None else update.plan
                waiting = self._waiting = replace(update, plan=plan)
            is_due = self._line.is_due(now, self._is_settled(ahead), ahead.leads_on)
            is_due = is_due or (stands and waiting is not None)
            if not (waiting or reason if is_way else is_due):
                self._why = reason or self._why
                return None
            update = route.publish_line(reason or self._why or "line polished", now)
            if waiting is not None:
                update = replace(waiting, revision=update.revision, cells=update.cells)
        self._waiting, self._why = None, ""
        if update.xy is not None:
            self.forget()
            return update  # a way out, along no cells
        polished = ahead.line.first_below(POLISHED)
        self._line.take(ahead.next_xy(len(ahead.line) + 1), polished)
        return replace(update, xy=ahead.xy())

    def _stands(self, ahead: LineAhead, now: float) -> bool:
        """Note the robot's place; return whether it stands."""
        here = ahead.here
        if math.dist(here, self._at) > STANDING_M:
            self._at, self._moved_at = here, now
        return now - self._moved_at > STANDING_S

    def _is_settled(self, ahead: LineAhead) -> bool:
        """Whether neither a plan nor polish is under way that changes the next metres."""
        route = self._route
        is_planned = not route.wanted and (route.pending is None or route.is_improving)
        rough, lengths = ahead.line.first_below(POLISHED), ahead.lengths(HELD_M)
        return is_planned and (rough >= len(lengths) - 1 or float(lengths[rough]) > HELD_M)
