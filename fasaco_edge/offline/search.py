"""Search of an offline plan: for a walk, and for the line along it, within a budget.

The walk is searched for first, then the line is annealed until the budget ends. The walk and the
first stage of the line are always completed, unless Ctrl-C cuts them. The steps do not depend on
the budget, so a larger budget never gives a worse line (by its seconds, plus the price of unswept
floor). If a share of the floor is requested, the line is always annealed three times, to find out
how much unswept floor must cost for this share. A planner without local search searches for a walk
until the budget ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.offline.ground import Line, PlanGround, line_through
from fasaco_edge.offline.settings import CELLS, Search
from fasaco_edge.planners.bound import LowerBound
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.line import LineSearch
from fasaco_edge.planners.own.loading import UserCode
from fasaco_edge.planners.own.problem import OwnPlanner
from fasaco_edge.planners.own.time_limit import OWN_BUDGET_S
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import (
    CoveragePlanner,
    Observer,
    SearchProgress,
    StoppingCriterion,
    WorkLimit,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import planner_of

# Limits on the proposals of a walk's search, per cell and in all: with more, searching for the line
# gains more, and the walk has no budget (some five seconds).
PROPOSALS_A_CELL, MOST_PROPOSALS = 10_000, 25_000_000
# Number of stages that a line with a requested share always gets.
PRICED_STAGES = 3


class SearchEnd:
    """Decides when the searches for a walk, and for the line along it, end.

    Args:
        stop: ends both searches; None for never.
        budget: ends both, but neither a walk with a limit nor the first stage of the line; None for
            no limit.
        watch: called with the progress.
        bound: see below.

    Attributes:
        by: what ended the searches.
        bound: the problem's lower bound, for planners that do not compute it.
    """

    def __init__(
        self,
        stop: StoppingCriterion | None,
        budget: StoppingCriterion | None,
        watch: Callable[[SearchProgress], None],
        bound: LowerBound | None,
    ) -> None:
        self.by, self.bound = "the search", bound
        self._watch, self._stop, self._budget = watch, stop, budget
        self._progress: SearchProgress | None = None
        self._limit: StoppingCriterion | None = None

    def limit_walk(self, proposals: int) -> None:
        """End the search for a walk after a number of proposals, not by the budget."""
        self._limit = WorkLimit(SearchWork(proposals=proposals))

    def is_walk_over(self, progress: SearchProgress) -> bool:
        """Return whether the search for a walk is over."""
        if self.bound is not None:
            progress = replace(progress, lower_bound_cost_s=self.bound.cost_s)
        self._progress = progress
        if self._limit is None:
            return self._is_over(progress, self._budget)
        return self._is_over(progress, None) or self._limit(progress)

    def is_interrupted(self) -> bool:
        """Return whether ``stop`` ends the plan even within the first stage of its line."""
        if self._progress is not None:
            self._watch(self._progress)
        is_cut = bool(getattr(self._stop, "cuts_first_line", False))
        self.by = "Ctrl-C" if is_cut else self.by
        return is_cut

    def is_stopped(self) -> bool:
        """Return whether ``stop`` ends the search for the line, regardless of the budget."""
        return self._progress is not None and self._is_over(self._progress, None)

    def is_line_over(self) -> bool:
        """Return whether the search for a line is over; without a budget it ends at once."""
        if self._budget is None or self._progress is None:
            return True
        return self._is_over(self._progress, self._budget)

    def _is_over(self, progress: SearchProgress, budget: StoppingCriterion | None) -> bool:
        self._watch(progress)
        if self._stop is not None and self._stop(progress):
            self.by = "Ctrl-C"
            return True
        if budget is not None and budget(progress):
            self.by = "budget"
            return True
        return False


class Planning:
    """The searches of a plan.

    Args:
        problem: what to cover.
        ground: its floor.
        search: settings.
        own: a planner of the user's own in place of the search; None for none.
        ending: what ends the searches.
        observe: called with the colony's pheromone.
    """

    def __init__(
        self,
        problem: CoverageProblem,
        ground: PlanGround,
        search: Search,
        own: UserCode | None,
        ending: SearchEnd,
        observe: Observer,
    ) -> None:
        self._problem, self._ground, self._search = problem, ground, search
        self._own, self._ending, self._observe = own, ending, observe

    def run(self, line: str, robot: RobotConfig) -> tuple[CoveragePath, Line]:
        """Return a walk and the line along it.

        Args:
            line: CELLS, or one of ``planners.line.LINES``.
            robot: its driving parameters.
        """
        search, ending = self._search, self._ending
        if line != CELLS and search.has_local_search:
            most = PROPOSALS_A_CELL * self._problem.cells
            ending.limit_walk(min(most, MOST_PROPOSALS))
        path = self._walk()
        if line == CELLS:
            return path, line_through(self._ground.lattice, path.cells)
        ends = self._problem.end is not None
        laid = self._ground.line_search(path.cells, line, robot, ends=ends, swept=search.swept)
        self._improve(laid)
        assert laid.best is not None
        return path, laid.best.xy

    def _improve(self, line: LineSearch) -> None:
        """Search for the line along a walk, as long as that may go on.

        Stopped within the first stage, the search keeps the line of that moment.
        """
        ending = self._ending
        for _ in line.run():
            if not line.stages:
                is_over = ending.is_interrupted()
            elif line.stages < PRICED_STAGES and self._search.swept is not None:
                is_over = ending.is_stopped()
            else:
                is_over = ending.is_line_over()
            if is_over:
                break
        if line.best is None:
            line.keep()

    def _walk(self) -> CoveragePath:
        """Search for a walk; a planner without a lower bound is given one for its path."""
        search, bound = self._search, self._ending.bound
        most_s = OWN_BUDGET_S if search.most_s is None else search.most_s
        planner: CoveragePlanner = (
            OwnPlanner(self._own, search.seed, most_s)
            if self._own
            else planner_of(search.planner, search.colony(), search.threads)
        )
        path = planner.plan(self._problem, self._ending.is_walk_over, self._observe)
        path = replace(path, seed=search.seed)
        if bound is not None:
            path = replace(path, lower_bound_steps=bound.steps, lower_bound_cost_s=bound.cost_s)
        return path
