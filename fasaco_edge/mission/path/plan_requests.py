"""Plan requests: needed plans, one at a time, and attempts at a better path in spare time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.events import PlanBroken, PlanRequest
from fasaco_edge.mission.path.path_progress import PathProgress
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.walk_before import HELD_CELLS

# Retry period after a failed plan [s].
BROKEN_S = 30.0
# Reason of a request for a better path.
SPARE_TIME = "spare time"
# Longest time of an attempt: by repairs, and by a search of the whole path ahead [s].
REPAIR_S, SEARCH_S = 0.05, 0.3
# A better path replaces the path only if it saves this many steps and this share of the cost.
LEAST_STEPS, LEAST_SHARE = 2, 0.002
# A walk from a full search has to save this share, as its line is made and polished again.
NEW_WALK_SHARE = 0.01
# The share of time is halved at most this many times.
MOST_VAIN = 4
# Pause after a check that found nothing to improve [s]: a check may search the whole lattice, and
# its result rarely changes between poses.
SKIPPED_S = 1.0


def most_s(problem: CoverageProblem) -> float:
    """Return how long an attempt at a better path may take [s]."""
    return SEARCH_S if problem.is_full else REPAIR_S


class SpareTime:
    """Limits attempts at better paths to a share of a processor core; 0 for none.

    The share is halved with each vain attempt at the same walk.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._resting_until = 0.0
        # The walk of the last attempt, and the number of vain attempts at it.
        self._walk = self._vain = 0
        # Duration and end of the last attempt [s].
        self._last = 0.0, 0.0

    def is_available(self, now: float, walk: int) -> bool:
        """Return whether another attempt, at walk ``walk``, may start at ``now`` [s]."""
        if not self._share or now < self._resting_until:
            return False
        seconds, ended_at = self._last
        share = self._share / (1 << self._vain if walk == self._walk else 1)
        return now >= ended_at + seconds * (1.0 / share - 1.0)

    def spend(self, seconds: float, now: float, walk: int) -> None:
        """Note that an attempt at walk ``walk`` took ``seconds`` and ended at ``now`` [s]."""
        self._vain = min(self._vain + 1, MOST_VAIN) if walk == self._walk else 0
        self._walk, self._last = walk, (seconds, now)

    def rest(self, now: float, seconds: float = SKIPPED_S) -> None:
        """Make no attempt for ``seconds`` from ``now`` [s]: there was nothing to improve, or a plan
        failed."""
        self._resting_until = max(self._resting_until, now + seconds)


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt to improve the path from one of its cells on.

    Attributes:
        numbering: number of the path that ``index`` and ``joint`` refer to.
        index: the robot's index on the path.
        joint: index of the cell where the improved rest begins.
        problem: the problem that the rest of the path solves.
    """

    numbering: int
    index: int
    joint: int
    problem: CoverageProblem

    @classmethod
    def at(
        cls,
        path: PathProgress,
        numbering: int,
        orders: Sequencer,
        number: int,
        *,
        is_full: bool = False,
    ) -> Attempt | None:
        """Return attempt ``number`` to improve a path; None if too little of it is left.

        ``is_full``: whether to search the whole rest, see ``CoverageProblem``.
        """
        # The next cells ahead of the robot stay fixed; a shorter rest is not worth a search.
        joint = path.index + HELD_CELLS
        if joint + HELD_CELLS > len(path.cells):
            return None
        row, col = path.cells[path.index].tolist()
        try:
            whole = orders.part.problem((row, col), path.ahead, orders.goal(), attempt=number)
            problem = replace(whole.after(HELD_CELLS), is_full=is_full)
        except FasacoError:
            return None  # the map has changed: a repair is due
        return cls(numbering, path.index, joint, problem)

    def improved(self, path: PathProgress, better: NDArray[np.int32]) -> NDArray[np.int32] | None:
        """Return the improved cells ahead, int32 (n, 2); None if they save too little.

        Args:
            path: the current path.
            better: the improved path, int32 (n, 2).
        """
        if path.index > self.joint:
            return None
        ahead = better[path.index - self.index :]
        problem, share = self.problem, NEW_WALK_SHARE if self.problem.is_full else LEAST_SHARE
        cost_us = problem.price_us(path.ahead)
        least_us = max(LEAST_STEPS * problem.cost.step_us, share * cost_us)
        return ahead if cost_us - problem.price_us(ahead) >= least_us else None


class PlanRequests:
    """Requests plans, one at a time: needed plans, and attempts at better paths.

    Attributes:
        plans, attempts: count the returned plans, and the attempts at better paths.
        wanted: why a new plan is wanted; "" if none is.
        pending: the request under way.
        attempt: the attempt that the pending plan belongs to; None for a needed plan.
        changed: window of the cells that changed since the last request.
    """

    def __init__(self) -> None:
        self.plans = self.attempts = 0
        self.wanted = ""
        self.pending: PlanRequest | None = None
        self.attempt: Attempt | None = None
        # Whether the result of the pending plan is to be discarded.
        self._is_abandoned = False
        # Why a full plan is wanted; "" if none is.
        self._full = ""
        self.changed: Window | None = None
        # Whether ``wanted`` is for the changed cells.
        self._is_by_map = False
        # Why the last plan failed, "" if it did not, and when [s].
        self._failure = "", 0.0
        # Number of plans that failed in a row; whether a map has come since the last failure.
        self._failures = 0
        self._has_map = False

    def continue_from(self, before: PlanRequests) -> None:
        """Continue the counts of a predecessor; its pending plan is discarded."""
        self.plans, self.attempts = before.plans, before.attempts
        self.pending, self.attempt = before.pending, before.attempt
        self.discard_pending()

    @property
    def is_planning(self) -> bool:
        """Whether a needed plan is pending."""
        return self.pending is not None and self.attempt is None

    @property
    def is_improving(self) -> bool:
        """Whether the pending plan is only an attempt at a better path."""
        return self.pending is not None and self.attempt is not None

    def want(self, reason: str, changed: Window | None = None) -> None:
        """Note that a plan is wanted, as cells in a window have changed, or for another reason."""
        self.wanted = reason
        self.changed = Window.around(self.changed, changed)
        self._is_by_map = changed is not None

    def want_instead(self, reason: str, changed: Window | None) -> None:
        """Note that a plan is wanted in place of an outdated plan; an earlier reason stays."""
        self.changed = Window.around(self.changed, changed)
        if not self.wanted:
            self.want(reason, changed)

    def want_full(self, reason: str) -> int:
        """Note that a full search is wanted; return its number among the plans."""
        self.wanted = self._full = reason
        self.forget_failure()
        return self.plans + (1 if self.pending is None or self.is_improving else 2)

    def want_none(self) -> None:
        """Note that no plan is wanted any more."""
        self.wanted = self._full = ""
        self.changed = None

    def discard_pending(self) -> None:
        """Discard the result of the pending plan, if any."""
        self._is_abandoned = self.pending is not None

    def abandon(self) -> None:
        """Drop the wanted plan, and discard the pending plan: they are for another order."""
        self.want_none()
        self.forget_failure()
        self.discard_pending()

    def pause(self) -> None:
        """Discard the pending plan; it is requested again, with its reason, after the pause."""
        if self.pending is not None and self.is_planning and not self._is_abandoned:
            if self.pending.problem.is_full:
                self._full = self.pending.reason
            self.want(self.wanted or self.pending.reason, self.pending.changed)
        self.discard_pending()

    def request_plan(self, problem: CoverageProblem) -> PlanRequest:
        """Request the wanted plan."""
        changed = self.changed if self._is_by_map and not self._full else None
        problem = replace(problem, is_full=bool(self._full) or problem.is_full)
        request = self._request(problem, self._full or self.wanted, changed)
        self.want_none()
        return request

    def request_attempt(self, attempt: Attempt) -> PlanRequest:
        self.attempt = attempt
        return self._request(attempt.problem, SPARE_TIME)

    def _request(
        self, problem: CoverageProblem, reason: str, changed: Window | None = None
    ) -> PlanRequest:
        self.pending = PlanRequest(self.plans + self.attempts + 1, problem, reason, changed)
        return self.pending

    def close(self) -> bool:
        """Count the pending plan as returned; return whether it was abandoned."""
        self.plans += self.attempt is None
        self.attempts += self.attempt is not None
        self.pending = self.attempt = None
        is_abandoned, self._is_abandoned = self._is_abandoned, False
        return is_abandoned

    def close_failed(self, event: PlanBroken, now: float) -> bool:
        """Close the pending plan as failed at ``now`` [s]; return whether it was needed.

        The same problem would fail again, so it is not requested again at once.
        """
        request, is_improving = self.pending, self.is_improving
        if request is None or request.number != event.number:
            return False
        if self.close() or is_improving:
            return False
        self.want(self.wanted or request.reason, request.changed)
        self._failure, self._has_map = (str(event.why), now), False
        self._failures += 1
        return True

    def why_not_yet(self, now: float) -> str:
        """Return why no plan may be requested yet; "" if one may be."""
        why, since = self._failure
        # A new map is a new problem, but the pause grows if the planner fails with every map.
        pause_s = min(2.0 ** (self._failures - 1) - 1.0, BROKEN_S)
        if not why or now - since >= (pause_s if self._has_map else BROKEN_S):
            return ""
        with_map = f"with a map after {pause_s:g} s" if pause_s else "with the next map"
        sooner = f"{with_map}, or " if pause_s < BROKEN_S else ""
        return f"{why}; tried again {sooner}after {BROKEN_S:g} s"

    def receive_map(self) -> None:
        """Take in another map: a plan that failed with the previous map may succeed now."""
        self._has_map = True

    def forget_failure(self) -> None:
        """Forget the failed plan: a command requests a new plan, or a plan has succeeded since."""
        self._failure, self._failures = ("", 0.0), 0
