"""Plan requests: why a plan is wanted, which one is pending, and how the last one failed."""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.core.events import SPARE, PlanBroken, PlanRequest
from fasaco_edge.mission.core.spare_time import Attempt
from fasaco_edge.planners.problem import CoverageProblem

# Retry period after a failed plan [s].
BROKEN_S = 30.0


class PlanRequests:
    """Requests plans, one at a time: needed plans, and attempts at better paths.

    Attributes:
        plans, attempts: count the returned plans, and the attempts at better paths.
        wanted: why a new plan is wanted; "" where none is.
        pending: the request under way.
    """

    def __init__(self) -> None:
        self.plans = self.attempts = 0
        self.wanted = ""
        self.pending: PlanRequest | None = None
        # The attempt that the pending plan belongs to; None for a needed plan.
        self._attempt: Attempt | None = None
        # Whether the pending plan is for an order that no longer counts.
        self._is_abandoned = False
        # Why a full plan is wanted; "" where none is.
        self._full = ""
        # What changed since the last request; and whether that change is the reason for the plan.
        self._changed: Window | None = None
        self._is_by_map = False
        # How the last plan failed, and when; "" where it did not. How many have failed in a row,
        # and whether another map has come since the last.
        self._failure = "", 0.0
        self._failures = 0
        self._has_map = False

    @property
    def is_planning(self) -> bool:
        """Whether a needed plan is pending."""
        return self.pending is not None and self._attempt is None

    @property
    def is_improving(self) -> bool:
        """Whether the pending plan is only an attempt at a better path."""
        return self.pending is not None and self._attempt is not None

    def want(self, reason: str, changed: Window | None = None) -> None:
        """Want a plan: because the cells in a window have changed, or for another reason."""
        self.wanted = reason
        self._changed = Window.around(self._changed, changed)
        self._is_by_map = changed is not None

    def want_full(self, reason: str) -> int:
        """Want a full search; return its number among the plans."""
        self.wanted = self._full = reason
        self.forget_failure()
        return self.plans + (1 if self.pending is None or self.is_improving else 2)

    def drop(self) -> None:
        """Want no plan."""
        self.wanted = self._full = ""
        self._changed = None

    def discard_pending(self) -> None:
        """Discard the result of the pending plan, if any."""
        self._is_abandoned = self.pending is not None

    def abandon(self) -> None:
        """Want no plan, and discard the pending one: it is for another order."""
        self.drop()
        self.forget_failure()
        self.discard_pending()

    def pause(self) -> None:
        """Discard the pending plan; it is requested again, with its reason, on continuing."""
        if self.pending is not None and self.is_planning and not self._is_abandoned:
            if self.pending.problem.is_full:
                self._full = self.pending.reason
            self.want(self.wanted or self.pending.reason, self.pending.changed)
        self.discard_pending()

    def request_plan(self, problem: CoverageProblem) -> PlanRequest:
        """Request the wanted plan."""
        changed = self._changed if self._is_by_map and not self._full else None
        problem = replace(problem, is_full=bool(self._full) or problem.is_full)
        request = self._request(problem, self._full or self.wanted, changed)
        self.drop()
        return request

    def _request_attempt(self, attempt: Attempt) -> PlanRequest:
        self._attempt = attempt
        return self._request(attempt.problem, SPARE)

    def _request(
        self, problem: CoverageProblem, reason: str, changed: Window | None = None
    ) -> PlanRequest:
        self.pending = PlanRequest(self.plans + self.attempts + 1, problem, reason, changed)
        return self.pending

    def _close_request(self) -> bool:
        """Count the pending plan as returned; return whether it was abandoned."""
        self.plans += self._attempt is None
        self.attempts += self._attempt is not None
        self.pending = self._attempt = None
        is_abandoned, self._is_abandoned = self._is_abandoned, False
        return is_abandoned

    def _close_failed(self, event: PlanBroken, now: float) -> bool:
        """Close the pending plan as failed at ``now`` [s]; return whether it was needed.

        The same problem would fail again, so it is not requested again at once.
        """
        request, is_improving = self.pending, self.is_improving
        if request is None or request.number != event.number:
            return False
        if self._close_request() or is_improving:
            return False
        self.want(self.wanted or request.reason, request.changed)
        self._failure, self._has_map = (str(event.why), now), False
        self._failures += 1
        return True

    def why_not_yet(self, now: float) -> str:
        """Return why no plan may be requested yet; "" if one may be."""
        why, since = self._failure
        # Each map is another problem; a planner that fails with every map gets requests less often.
        pause_s = min(2.0 ** (self._failures - 1) - 1.0, BROKEN_S)
        if not why or now - since >= (pause_s if self._has_map else BROKEN_S):
            return ""
        with_map = f"with a map after {pause_s:g} s" if pause_s else "with the next map"
        sooner = f"{with_map}, or " if pause_s < BROKEN_S else ""
        return f"{why}; tried again {sooner}after {BROKEN_S:g} s"

    def note_map(self) -> None:
        """Note another map: a plan that failed with the previous map may succeed now."""
        self._has_map = True

    def forget_failure(self) -> None:
        """Forget the failed plan: a command requests one, or one has succeeded since."""
        self._failure, self._failures = ("", 0.0), 0
