"""The lab's planner: the product's own, whose time is counted in pieces of work, not by a clock.

A search asks after each piece of work whether to stop. The lab lets a number of pieces take a
second, whatever the machine: the same mission is had again, bit for bit. A plan is made at once,
and is there when as much simulated time has passed.
"""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.config.config import PlannerConfig
from fasaco_edge.mission.events import PlanReady, PlanRequest
from fasaco_edge.mission.path.plan_requests import most_s
from fasaco_edge.planners.planner import CoveragePlanner, SearchProgress, StopRecorder, ignore
from fasaco_edge.planners.registry import planner_of

# Times measured in an office of 40 m2 on a core of 3 GHz [s]: of a move that is tried, of a piece
# of work without moves (a window, an ant), and of a plan beside its pieces.
MOVE_S, PIECE_S, PLAN_S = 30e-9, 0.0015, 0.004


@dataclass(slots=True)
class CountedTime:
    """Stops after some simulated seconds of work.

    Attributes:
        seconds: the limit.
        spent_s: what was spent so far [s].
    """

    seconds: float
    spent_s: float = PLAN_S
    _moves: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        """Count a piece of work; return whether to stop."""
        # A repair that is followed by a search begins to count anew.
        moves = progress.work.proposals - self._moves
        self._moves = progress.work.proposals
        self.spent_s += max(moves, 0) * MOVE_S or PIECE_S
        return self.spent_s >= self.seconds


class LockStepPlanning:
    """Plans one request at a time, in place of the daemon's planning thread.

    Attributes:
        planner: the product's.
        plans: how many were made.
    """

    def __init__(self, config: PlannerConfig) -> None:
        self.planner: CoveragePlanner = planner_of(config.name, config.colony(), config.threads)
        self.plans = 0
        self._budget_s = config.budget_s
        # The plan that is under way, and when it is there [s].
        self._under_way: tuple[PlanReady, float] | None = None

    def submit(self, request: PlanRequest, now: float) -> None:
        """Plan ``request``, from ``now`` [s] on."""
        problem = request.problem
        budget_s = most_s(problem) if problem.only_better else self._budget_s
        spent = CountedTime(budget_s)
        stop = StopRecorder(spent)
        path = self.planner.plan(problem, stop, ignore)
        ready = PlanReady(request.number, path, spent.spent_s, tuple(stop.stops))
        self._under_way = ready, now + spent.spent_s
        self.plans += 1

    def interrupt(self, now: float) -> None:
        """Have the plan under way now, if there is one: a newer request waits."""
        if self._under_way is not None:
            self._under_way = self._under_way[0], now

    def take(self, now: float) -> list[PlanReady]:
        """Return the plan that is there at ``now`` [s], if any."""
        if self._under_way is None or self._under_way[1] > now:
            return []
        (ready, _), self._under_way = self._under_way, None
        return [ready]
