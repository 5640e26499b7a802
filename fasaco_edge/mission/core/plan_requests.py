"""Requests for plans: why one is wanted, which one is under way, and how the last one failed."""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.core.events import PlanBroken, PlanRequest
from fasaco_edge.mission.core.spare_time import Attempt
from fasaco_edge.planners.problem import CoverageProblem

# After a plan that failed [s].
BROKEN_S = 30.0


class PlanRequests:
    """Requests plans, one at a time: those that are needed, and attempts at better paths.

    Attributes:
        plans, attempts: count the plans that came back, and the attempts at better paths.
        wanted: why a new plan is wanted; "" where none is.
        pending: the plan under way.
    """

    def __init__(self) -> None:
        self.plans = self.attempts = 0
        self.wanted = ""
        self.pending: PlanRequest | None = None
        # Of the plan under way, if that is only to improve the path.
        self._attempt: Attempt | None = None
        # Whether the plan under way is for an order that no longer counts.
        self._is_abandoned = False
        # Why a full plan is wanted; "" where none is.
        self._full = ""
        # What has changed since the last request, and whether that is why a plan is wanted.
        self._changed: Window | None = None
        self._is_by_map = False
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

    def discard_pending(self) -> None:
        """Discard the plan under way, if any, once it comes."""
        self._is_abandoned = self.pending is not None

    def abandon(self) -> None:
        """Want no plan any more, and discard the one under way: it is for another order."""
        self.drop()
        self.forget_failure()
        self.discard_pending()

    def pause(self) -> None:
        """Discard the plan under way; what it was for is planned once the robot continues."""
        self.forget_failure()
        if self.pending is not None and self.is_planning and not self._is_abandoned:
            if self.pending.problem.is_full:
                self._full = self.pending.reason
            self.want(self.wanted or self.pending.reason, self.pending.changed)
        self.discard_pending()

    def request_plan(self, problem: CoverageProblem) -> PlanRequest:
        """Request the plan that is wanted."""
        changed = self._changed if self._is_by_map and not self._full else None
        problem = replace(problem, is_full=bool(self._full))
        request = self._request(problem, self._full or self.wanted, changed)
        self.drop()
        return request

    def _request_attempt(self, attempt: Attempt) -> PlanRequest:
        self._attempt = attempt
        return self._request(attempt.problem, "spare time")

    def _request(
        self, problem: CoverageProblem, reason: str, changed: Window | None = None
    ) -> PlanRequest:
        self.pending = PlanRequest(self.plans + self.attempts + 1, problem, reason, changed)
        return self.pending

    def _close_request(self) -> bool:
        """Count the plan under way as come back; return whether it was abandoned."""
        self.plans += self._attempt is None
        self.attempts += self._attempt is not None
        self.pending = self._attempt = None
        is_abandoned, self._is_abandoned = self._is_abandoned, False
        return is_abandoned

    def _close_failed(self, event: PlanBroken, now: float) -> bool:
        """Close the plan under way as failed, at ``now`` [s]; return whether it was needed.

        The same problem would make it fail again: it is not requested again at once.
        """
        request, is_improving = self.pending, self.is_improving
        if request is None or request.number != event.number:
            return False
        if self._close_request() or is_improving:
            return False
        self.want(self.wanted or request.reason, request.changed)
        self._failure = str(event.why), now
        return True

    def why_not_yet(self, now: float) -> str:
        """Return why no plan may be requested yet; "" where one may be."""
        why, since = self._failure
        if why and now - since < BROKEN_S:
            return f"{why}; tried again with the next map, or after {BROKEN_S:g} s"
        return ""

    def forget_failure(self) -> None:
        """Allow a request although the last plan failed: the problem is another."""
        self._failure = "", 0.0
