"""Path checks: whether the robot is still on its path, and whether the path is worth driving."""

from __future__ import annotations

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.core.standing import PATIENCE_S

# Period of ``_check_worth`` and ``_check_time`` [s].
WORTH_S = 1.0
# While poses are too far apart, a path ends after this long without a newly covered cell [s].
VAIN_S = 60.0
FAR_APART = "poses are too far apart"


class PathChecks:
    """Requests a new plan if the path no longer serves the driving robot.

    Nothing is checked while a plan is wanted or being made.
    """

    def __init__(self, parts: MissionParts) -> None:
        self._ledger, self._monitor, self._orders = parts.ledger, parts.monitor, parts.orders
        self._route, self._line, self._standing = parts.route, parts.line, parts.standing
        self._company = parts.company
        self._orders.describe_floor_by(self._sum_up)
        self._worth_at = self._timed_at = self._homeward_at = float("-inf")
        # The number of plans at the last path that was found to lead only home.
        self._homeward = -1
        # Number of covered cells, and when it was counted [s], while poses are too far apart.
        self._progress: tuple[int, float] | None = None

    def check(self, cell: Cell, now: float, *, is_covering: bool) -> None:
        """Check the path of a robot in ``cell``."""
        while_covering = (
            *(self._check_worth, self._check_time, self._check_room),
            self._check_way_home,
        )
        for check in (self._check_deviation, *(while_covering if is_covering else ())):
            if self._route.requests.pending is not None or self._route.requests.wanted:
                return
            check(cell, now)

    def _check_deviation(self, cell: Cell, now: float) -> None:
        """Ask for a new plan for a robot that is off its path or at the path's end."""
        route, monitor, path = self._route, self._monitor, self._route.path
        waited = self._standing.has_waited
        if self._drives_in_vain(now):
            self._end_path(now, FAR_APART)
            return
        if monitor.doubt:
            doubted = route.published_at < monitor.doubt_since
            if doubted and list(cell) in path.ahead[:2].tolist():
                monitor.clear_doubt()  # the pose was wrong for a moment
            elif waited and now - monitor.doubt_since >= PATIENCE_S:
                route.requests.want(monitor.doubt)
            return
        last = tuple(path.cells[-1].tolist()) if len(path.cells) else None
        has_visited = last is not None and self._ledger.current.has_visited(last)
        # If a path ends in the robot's cell, the robot may still be turning to drive it.
        has_stopped = waited and not self._standing.turns
        at_end = path.finished and (has_visited or has_stopped)
        if at_end or (has_stopped and self._standing.is_at(last)):
            self._line.left.open_missed()
            self._end_path(now)
        elif waited and (path.is_far(cell) or self._standing.is_beside_path):
            route.requests.want("robot left the path")

    def _end_path(self, now: float, why: str = "") -> None:
        if self._orders.scope.is_first_done:
            self._route.requests.want("floor planned first is done: the rest")
        elif self._orders.part.record_path_end(why):
            self._orders.advance(now)
        else:
            self._route.requests.want(self._line.left.share.why or "cells left over")

    def _drives_in_vain(self, now: float) -> bool:
        """Return whether poses are too far apart to cover new cells, so that no path would end."""
        if not self._monitor.are_poses_far_apart:
            self._progress = None
            return False
        # Time at rest, for instance in a pause, does not count.
        if (
            self._progress is not None
            and now - max(self._progress[1], self._route.begun_at) < VAIN_S
        ):
            return False
        before, covered = self._progress, self._orders.part.done
        self._progress = covered, now
        return before is not None and covered <= before[0]

    def _sum_up(self) -> str:
        """Return figures for the end of an order, as the end of a sentence; "" for none."""
        floor = self._line.left.sum_up()
        if not self._monitor.are_poses_far_apart:
            return floor
        return f"{floor}; {FAR_APART}, and what lies between them does not count"

    def _check_worth(self, _: Cell, now: float) -> None:
        """Ask for a new plan for a robot of a fleet if others have swept all cells ahead."""
        route = self._route
        is_due = self._company.has_members and now - self._worth_at >= WORTH_S
        if not is_due or len(route.path.ahead) <= 1:
            return
        self._worth_at = now
        if not self._line.left.is_worth_driving and not self._orders.scope.is_any_planned_left:
            route.requests.want("others have swept the floor ahead")

    def _check_room(self, cell: Cell, _: float) -> None:
        """Ask for a new plan if new rooms show that the robot has another room to finish first."""
        if self._orders.scope.is_in_other_room(cell):
            self._route.requests.want("rooms have changed: another room first")

    def _check_way_home(self, _: Cell, now: float) -> None:
        """Ask for a new plan for the missing floor of a share before the path leads home."""
        orders, plans, share = self._orders, self._route.requests.plans, self._line.left.share
        is_due = share.share is not None and orders.order_state.returns_home_next
        if not is_due or plans == self._homeward or now - self._homeward_at < WORTH_S:
            return
        self._homeward_at = now
        if not orders.cells.left():
            self._homeward = plans
            if self._line.left.open_missed():
                self._route.requests.want(share.why)

    def _check_time(self, _: Cell, now: float) -> None:
        """Ask for a new plan with the most worthwhile floor first if time or battery do not suffice
        for all."""
        orders, route = self._orders, self._route
        is_limited = orders.scope.worth.may_work_s < float("inf")
        is_due = is_limited and now - self._timed_at >= WORTH_S
        if not is_due or len(route.path.ahead) <= 1:
            return
        self._timed_at = now
        figures = self._line.ahead()
        ahead_s = orders.scope.walk_s(route.path.ahead) if figures is None else figures.seconds
        if orders.scope.puts_other_first(ahead_s):
            route.requests.want("not all can be done in time: the most worthwhile floor first")
