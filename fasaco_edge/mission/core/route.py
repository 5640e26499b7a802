"""Route: the path the robot was given, the plan under way, and better paths in spare time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.events import PathUpdate, PlanBroken, PlanReady, PlanRequest
from fasaco_edge.mission.coverage.progress import PathProgress
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.sequencer import Sequencer
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.effort import HELD_CELLS
from fasaco_edge.planners.problem import CoverageProblem

# A path is replaced by a better one only if that saves this many steps, and this share of
# what is left.
LEAST_STEPS, LEAST_SHARE = 2, 0.002
# The share of time is halved at most this often.
MOST_VAIN = 4
# Where there is nothing to improve, the next look is this much later [s]: it takes a search of
# the whole lattice, and the answer rarely changes from one pose to the next.
SKIPPED_S = 1.0
# After a plan that failed [s].
BROKEN_S = 30.0

NO_CELLS: NDArray[np.int32] = np.empty((0, 2), np.int32)


class SpareTime:
    """Limits attempts at better paths to a share of a processor core; a share of 0 is none.

    While attempts at one path come to nothing, fewer and fewer are made.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._resting_until = 0.0
        # The path of the last attempt, and how many attempts at it came to nothing.
        self._revision = self._vain = 0

    def is_available(self, now: float) -> bool:
        """Tell whether another attempt may begin at ``now`` [s]."""
        return self._share > 0.0 and now >= self._resting_until

    def spend(self, seconds: float, now: float, revision: int) -> None:
        """Note that an attempt at path ``revision`` took ``seconds`` and ended at ``now`` [s]."""
        self._vain = min(self._vain + 1, MOST_VAIN) if revision == self._revision else 0
        self._revision = revision
        share = self._share / 2**self._vain
        self._resting_until = now + seconds * (1.0 / share - 1.0)

    def rest_after_failure(self, now: float) -> None:
        """Note that a plan failed at ``now`` [s]."""
        self._resting_until = max(self._resting_until, now + BROKEN_S)

    def skip(self, now: float) -> None:
        """Note that there was nothing to improve at ``now`` [s]."""
        self._resting_until = now + SKIPPED_S


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt at a better path from one of its cells on.

    Attributes:
        revision: of the path.
        index: where on it the robot is.
        joint: index of that cell.
        problem: that the rest of the path solves, the end of the one that is left.
    """

    revision: int
    index: int
    joint: int
    problem: CoverageProblem

    @classmethod
    def at(
        cls, path: PathProgress, revision: int, orders: Sequencer, number: int
    ) -> Attempt | None:
        """Return attempt ``number`` at a path; None where too little of it is left."""
        # The next cells ahead of the robot stay as they are; a shorter rest is not worth a search.
        joint = path.index + HELD_CELLS
        if joint + HELD_CELLS > len(path.cells):
            return None
        row, col = path.cells[path.index].tolist()
        try:
            problem = orders.problem((row, col), path.ahead, attempt=number).after(HELD_CELLS)
        except FasacoError:
            return None  # the map has changed: a repair is due
        return cls(revision, path.index, joint, problem)

    def joined(self, path: PathProgress, better: NDArray[np.int32]) -> NDArray[np.int32] | None:
        """Return the cells ahead on a better path, int32 (n, 2); None if it saves too little."""
        if path.index > self.joint:
            return None
        ahead = better[path.index - self.index :]
        return ahead if _is_worth_it(self.problem.cost, path.ahead, ahead) else None


def _is_worth_it(cost: CoverageCost, before: NDArray[np.int32], after: NDArray[np.int32]) -> bool:
    cost_s = cost.of_walk(before)
    least_s = max(LEAST_STEPS * cost.step_s, LEAST_SHARE * cost_s)
    return cost_s - cost.of_walk(after) >= least_s


class Route:
    """Requests plans, one at a time, and publishes paths from them. All times ``now`` are [s].

    Attributes:
        path: the published path, and how far the robot is on it.
        revision: counts the published paths.
        plans, attempts: count the plans that came back, and the attempts at better paths.
        unchanged, outdated: count those of the plans that led to no path, because they found
            the same path again, or because they no longer held.
        wanted: why a new plan is wanted; "" where none is.
        pending: the plan under way.
        published_at: when a path was last published, or confirmed by a plan.
    """

    def __init__(self, spare_share: float, map_state: MapState, orders: Sequencer) -> None:
        self.path = PathProgress(NO_CELLS)
        # What lay beyond where a map blocked the path.
        self._cut_off = NO_CELLS
        self.revision = 0
        self.plans = self.attempts = 0
        self.unchanged = self.outdated = 0
        self.wanted = ""
        self.pending: PlanRequest | None = None
        self.published_at = 0.0
        self._map = map_state
        self._orders = orders
        self._spare = SpareTime(spare_share)
        self._attempt: Attempt | None = None
        # Whether the plan under way is for an order that no longer counts.
        self._is_abandoned = False
        # Why a full plan is wanted; "" where none is.
        self._full = ""
        # What has changed since the last request, and whether that is why a plan is wanted.
        self._changed: Window | None = None
        self._is_by_map = False
        self._checked_on: ReachableArea | None = None
        # How the last plan failed, and when; "" where it did not.
        self._failure = "", 0.0

    @property
    def is_planning(self) -> bool:
        """Whether a plan that is needed is under way."""
        return self.pending is not None and self._attempt is None

    @property
    def is_improving(self) -> bool:
        """Whether the plan under way is only to improve the path."""
        return self.pending is not None and self._attempt is not None

    @property
    def path_to_keep(self) -> NDArray[np.int32]:
        """What of the path the next plan is to keep where it can, int32 (n, 2).

        Also what a map cut off: most of that still holds.
        """
        return np.concatenate((self.path.ahead, self._cut_off))

    def want(self, reason: str, changed: Window | None = None) -> None:
        """Want a plan: because the cells in a window have changed, or for another reason."""
        self.wanted = reason
        self._changed = Window.around(self._changed, changed)
        self._is_by_map = changed is not None

    def want_full(self, reason: str) -> int:
        """Want a plan for which all is searched; return its number among the plans."""
        self.wanted = self._full = reason
        self.forget_failure()
        return self.plans + (1 if self.pending is None or self.is_improving else 2)

    def drop(self) -> None:
        """Want no plan any more."""
        self.wanted = self._full = ""
        self._changed = None

    def abandon(self) -> None:
        """Want no plan any more, and discard the one under way: it is for another order."""
        self.drop()
        self.forget_failure()
        self._is_abandoned = self.pending is not None

    def request_plan(self, problem: CoverageProblem) -> PlanRequest:
        """Request the plan that is wanted."""
        changed = self._changed if self._is_by_map and not self._full else None
        problem = replace(problem, is_full=bool(self._full))
        request = self._request(problem, self._full or self.wanted, changed)
        self.drop()
        return request

    def request_improvement(self, now: float) -> PlanRequest | None:
        """Request a better path; None without spare time, or where too little of it is left."""
        if not self._spare.is_available(now):
            return None
        self._attempt = Attempt.at(self.path, self.revision, self._orders, self.attempts + 1)
        if self._attempt is None:
            self._spare.skip(now)
            return None
        return self._request(self._attempt.problem, "spare time")

    def _request(
        self, problem: CoverageProblem, reason: str, changed: Window | None = None
    ) -> PlanRequest:
        self.pending = PlanRequest(self.plans + self.attempts + 1, problem, reason, changed)
        return self.pending

    def fail(self, event: PlanBroken, now: float) -> None:
        """Note that the plan under way failed: the same problem would make it fail again."""
        self._spare.rest_after_failure(now)
        request, is_improving = self.pending, self.is_improving
        if request is None or request.number != event.number:
            return
        if not self._close_request() and not is_improving:
            self.outdated += 1
            self.want(self.wanted or request.reason, request.changed)
            self._failure = str(event.why), now

    def why_not_yet(self, now: float) -> str:
        """Return why no plan may be requested yet; "" where one may be."""
        why, since = self._failure
        if why and now - since < BROKEN_S:
            return f"{why}; tried again with the next map, or after {BROKEN_S:g} s"
        return ""

    def forget_failure(self) -> None:
        """Allow a request although the last plan failed: the problem is another."""
        self._failure = "", 0.0

    def accept(self, event: PlanReady, now: float) -> PathUpdate | None:
        """Publish a plan that was requested, unless it no longer holds."""
        if self.is_improving:
            self._spare.spend(event.seconds, now, self.revision)
        request, attempt, area = self.pending, self._attempt, self._map.area
        if request is None or request.number != event.number:
            return None
        is_abandoned = self._close_request()
        cell = self._map.robot_cell()
        if is_abandoned or cell is None or area is None:
            self.outdated += attempt is None
            return None
        if attempt is not None:
            return self._accept_better(attempt, event, area, now)
        cells = self._from_here(event.path.cells, cell, area)
        if not len(cells) or area.drivable_prefix(cells) < len(cells):
            self.outdated += 1
            self._changed = Window.around(self._changed, request.changed)
            if not self.wanted:
                self.want("the map changed while planning", request.changed)
            return None
        if np.array_equal(cells, self.path.ahead):
            # The follower has this path already.
            self.unchanged += 1
            self.published_at = now
            return None
        return self.publish(cells, request.reason, now, event, request.changed)

    def _close_request(self) -> bool:
        """Count the plan under way as come back; return whether it was abandoned."""
        self.plans += self._attempt is None
        self.attempts += self._attempt is not None
        self.pending = self._attempt = None
        is_abandoned, self._is_abandoned = self._is_abandoned, False
        return is_abandoned

    def _accept_better(
        self, attempt: Attempt, event: PlanReady, area: ReachableArea, now: float
    ) -> PathUpdate | None:
        """Publish the path with a better rest; None where that saves too little."""
        if attempt.revision != self.revision:
            return None
        cells = attempt.joined(self.path, event.path.cells)
        if cells is None or area.drivable_prefix(cells) < len(cells):
            return None
        return self.publish(cells, "better further on", now, event)

    def _from_here(
        self, cells: NDArray[np.int32], here: Cell, area: ReachableArea
    ) -> NDArray[np.int32]:
        """Return a new plan without what was covered while it was made.

        The robot drove on meanwhile: it joins the plan at the first cell that still needs a
        visit. Empty where no path leads there: the robot was carried elsewhere.
        """
        window = area.lattice.window
        still_open = window.values_at(self._orders.open_cells(window), cells, True)
        first = int(np.argmax(still_open)) if still_open.any() else len(cells) - 1
        lead = area.shortest_path(here, (int(cells[first, 0]), int(cells[first, 1])))
        return np.concatenate((lead[:-1], cells[first:])) if len(lead) else lead

    def publish(
        self,
        cells: NDArray[np.int32],
        reason: str,
        now: float,
        ready: PlanReady | None = None,
        changed: Window | None = None,
    ) -> PathUpdate:
        """Publish a path in place of the one before."""
        self.revision += 1
        self.published_at = now
        self.path, self._cut_off = PathProgress(cells), NO_CELLS
        plan, seconds = (ready.path, ready.seconds) if ready else (None, 0.0)
        return PathUpdate(self.revision, cells, reason, plan, seconds, changed)

    def follow(self, cell: Cell, has_visited: Callable[[Cell], bool]) -> None:
        """Note that the robot is in ``cell``, see ``PathProgress.driven_to``."""
        self.path = self.path.driven_to(cell, has_visited)

    def follow_line(self, index: int) -> None:
        """Note that the robot is, by its line, at a cell of the path."""
        if self.path.index < index < len(self.path.cells):
            self.path = replace(self.path, index=index)

    def stop(self, reason: str, now: float) -> PathUpdate | None:
        """Publish an empty path; None where the robot has none to drive."""
        if not len(self.path.cells):
            return None
        return self.publish(NO_CELLS, reason, now)

    def truncate(self, now: float) -> PathUpdate | None:
        """Cut a path that a new map blocks before the block, at once; a new plan follows.

        Nothing is left of it where the robot's own cell is blocked or no longer on the map.
        """
        area = self._map.area
        if area is None or area is self._checked_on:
            return None
        self._checked_on = area
        ahead = self.path.ahead
        drivable = area.drivable_prefix(ahead)
        if drivable == len(ahead):
            return None
        row, col = ahead[drivable]
        self.want(f"path blocked at cell ({row}, {col})", self._changed)
        beyond = np.concatenate((ahead[drivable:], self._cut_off))
        update = self.publish(ahead[:drivable], self.wanted, now, changed=self._changed)
        self._cut_off = beyond
        return update
