"""Who plans for a replay: at once, with counted work, and as it was recorded where it was."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.daemon.replay_run import RecordedPath, RecordedRun
from fasaco_edge.mission.events import PlanReady, PlanRequest
from fasaco_edge.planners.planner import CoveragePlanner, ignore
from fasaco_edge.planners.stopping import AnyOf, WorkLimit
from fasaco_edge.planners.work import SearchWork

# Of a plan that was not recorded: about what a small computer does in a tenth of a second.
PROPOSALS = 200_000
# A recorded plan came at most this long after its budget [s].
LATE_S = 2.0


@dataclass(frozen=True, slots=True)
class _UnderWay:
    ready: PlanReady
    due: float


class ReplayPlanner:
    """Takes the place of the daemon's planning thread.

    Args:
        planner: the daemon's.
        run: what was recorded.
        budget_s: the time its plans had [s].
        work: proposals of each plan; None for what was recorded.
    """

    def __init__(
        self, planner: CoveragePlanner, run: RecordedRun, budget_s: float, work: int | None
    ) -> None:
        self._planner = planner
        self._run = run
        self._budget_s = budget_s
        self._work = work
        self._under_way: _UnderWay | None = None

    @property
    def due(self) -> float | None:
        """When the plan under way will be there; None where there is none."""
        return self._under_way.due if self._under_way else None

    def ask(self, request: PlanRequest, revision: int, now: float) -> None:
        """Make a plan that would be published as path ``revision``."""
        recorded = self._recorded(request, revision, now)
        due = now + self._budget_s
        if recorded is not None:
            due = max(1e-9 * recorded.at_ns, now)
        limit = self._limit(recorded)
        path = self._planner.plan(request.problem, limit, ignore)
        self._under_way = _UnderWay(PlanReady(request.number, path, due - now), due)

    def take(self, now: float) -> list[PlanReady]:
        """Return the plan that is there by ``now``, if any."""
        if self._under_way is None or self._under_way.due > now:
            return []
        ready, self._under_way = self._under_way.ready, None
        return [ready]

    def _recorded(self, request: PlanRequest, revision: int, now: float) -> RecordedPath | None:
        """Return the recorded path that comes of the same request, as far as one can tell."""
        path = self._run.paths.get(revision)
        if path is None or path.work is None or path.reason != request.reason:
            return None
        after = 1e-9 * path.at_ns - now
        return path if abs(after) <= self._budget_s + LATE_S else None

    def _limit(self, recorded: RecordedPath | None) -> AnyOf:
        if self._work is not None:
            return AnyOf(WorkLimit(SearchWork(proposals=self._work)))
        if recorded is None or recorded.work is None:
            return AnyOf(WorkLimit(SearchWork(proposals=PROPOSALS)))
        # On another ground the same counts may never be met.
        most = SearchWork(proposals=2 * recorded.work.proposals + PROPOSALS)
        return AnyOf(WorkLimit(recorded.work), WorkLimit(most))
