"""Who answers a mission's requests for a plan, at once and with a counted amount of work.

A daemon's planner works until its time is up; here it works until it has tried so many moves,
so that the same mission can be had again on any machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fasaco_edge.bench.online_watch import Elapsed, Stopwatch
from fasaco_edge.bench.quality_plan import planner_for
from fasaco_edge.mission.events import PlanReady, PlanRequest
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.stopping import WorkLimit
from fasaco_edge.planners.work import SearchWork

# Takes the place of the daemon's planning thread.
PlannerSeat = Callable[[PlanRequest], PlanReady]

# A reference has so many proposals a cell, and so many in all at least.
REFERENCE_PER_CELL, REFERENCE_LEAST = 10_000, 5_000_000


@dataclass(frozen=True, slots=True)
class CountedPlanning:
    """The daemon's planner, with work for a budget.

    Attributes:
        seed: of all random streams.
        proposals: moves that a search may try; a repair ends long before.
    """

    seed: int
    proposals: int

    def __call__(self, request: PlanRequest) -> PlanReady:
        """Answer a request."""
        path, elapsed = self.timed(request.problem)
        return PlanReady(request.number, path, 1e-3 * elapsed.wall_ms)

    def timed(self, problem: CoverageProblem) -> tuple[CoveragePath, Elapsed]:
        """Return a plan and how long it took."""
        limit = WorkLimit(SearchWork(proposals=self.proposals))
        stopwatch = Stopwatch()
        path = planner_for(self.seed).plan(problem, limit)
        return path, stopwatch.read()


def near_optimal(problem: CoverageProblem) -> CoveragePath:
    """Return the walk of a robot that knew the building: what missions are measured against."""
    proposals = max(REFERENCE_PER_CELL * problem.cells, REFERENCE_LEAST)
    return planner_for(0).plan(problem, WorkLimit(SearchWork(proposals=proposals)))
