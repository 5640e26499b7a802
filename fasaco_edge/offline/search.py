"""Search of an offline plan: for walks, and for the line along the best of them, within a budget.

A line is laid along each of two walks and annealed three times; then the better line is improved
until the budget ends. The first walk and line are always completed, unless Ctrl-C cuts them. The
steps do not depend on the budget, so a larger budget never gives a worse line (by its seconds, plus
the price of unswept floor). If a share of the floor is requested, the first line is always annealed
three times, to find out how much unswept floor must cost for this share. A planner without local
search searches for one walk until the budget ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

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
    ColonySnapshot,
    CoveragePlanner,
    Observer,
    SearchProgress,
    StoppingCriterion,
    WorkLimit,
    ignore,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import planner_of

# Limit on the proposals per cell of a walk's search: with more, searching for the line gains more.
# Limit on all proposals of the first walk, which has no budget: some five seconds.
PROPOSALS_A_CELL, FIRST_PROPOSALS = 10_000, 25_000_000
# Number of stages after which two lines are compared.
COMPARED = 3
# Bit that differs in the seed of the second walk.
SECOND_SEED = 1 << 20


class SearchEnd:
    """Decides when the searches for walks, and for the line along one, end.

    Args:
        stop: ends all searches; None for never.
        budget: ends all searches but those for the first walk and the line along it; None for no
            limit.
        watch: called with the progress.
        bound: see below.

    Attributes:
        by: what ended the searches.
        bound: the problem's lower bound, for planners that do not compute it.
        is_walk_limited: whether the limit on proposals ended the last search for a walk.
        is_walk_cut: whether ``budget`` or ``stop`` ended it.
    """

    def __init__(
        self,
        stop: StoppingCriterion | None,
        budget: StoppingCriterion | None,
        watch: Callable[[SearchProgress], None],
        bound: LowerBound | None,
    ) -> None:
        self.by, self.bound = "the search", bound
        self.is_walk_limited = self.is_walk_cut = False
        self._watch, self._stop, self._budget, self._is_first = watch, stop, budget, False
        self._progress: SearchProgress | None = None
        self._limit: StoppingCriterion | None = None

    def limit_walk(self, proposals: int, *, is_first: bool) -> None:
        """End the next search for a walk after ``proposals``; the first has no budget."""
        self._limit = WorkLimit(SearchWork(proposals=proposals))
        self.is_walk_limited = self.is_walk_cut = False
        self._is_first = is_first

    def is_walk_over(self, progress: SearchProgress) -> bool:
        """Return whether the search for a walk is over."""
        if self.bound is not None:
            progress = replace(progress, lower_bound_cost_s=self.bound.cost_s)
        self._progress = progress
        self.is_walk_cut = self._is_over(progress)
        if self.is_walk_cut:
            return True
        self.is_walk_limited = self._limit is not None and self._limit(progress)
        return self.is_walk_limited

    def is_interrupted(self) -> bool:
        """Return whether ``stop`` ends the plan even within the first stage of the first line."""
        if self._progress is not None:
            self._watch(self._progress)
        is_cut = bool(getattr(self._stop, "cuts_first_line", False))
        self.by = "Ctrl-C" if is_cut else self.by
        return is_cut

    def is_stopped(self) -> bool:
        """Return whether ``stop`` ends the search for the first line, which has no budget."""
        return self._progress is not None and self._is_over(self._progress)

    def is_line_over(self) -> bool:
        """Return whether the search for a line is over; without a budget it ends at once."""
        self._is_first = False
        return self._budget is None or self._progress is None or self._is_over(self._progress)

    def _is_over(self, progress: SearchProgress) -> bool:
        self._watch(progress)
        if self._stop is not None and self._stop(progress):
            self.by = "Ctrl-C"
            return True
        if self._budget is not None and not self._is_first and self._budget(progress):
            self.by = "budget"
            return True
        return False


@dataclass(frozen=True, slots=True)
class _Laid:
    """A walk, the running search for the line along it, and the colony's pheromone."""

    path: CoveragePath
    line: LineSearch
    pieces: Iterator[None]
    snapshots: list[ColonySnapshot]

    def complete(self, stages: int, stop: Callable[[], bool] = lambda: False) -> bool:
        """Search to the end of stage number ``stages``; return False if stopped earlier.

        Stopped within the first stage, it keeps the line of that moment.
        """
        for _ in self.pieces:
            if self.line.stages >= stages:
                return True
            if stop():
                if self.line.best is None:
                    self.line.keep()
                return False
        return True

    def improve(self, stop: Callable[[], bool]) -> None:
        """Search until stopped, or until no moves are left."""
        if not stop():
            for _ in self.pieces:
                if stop():
                    return


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
        if line == CELLS:
            path = self._walk(self._search.seed, self._observe)
            return path, line_through(self._ground.lattice, path.cells)
        laid = self._begin(line, robot)
        laid.improve(self._ending.is_line_over)
        for snapshot in laid.snapshots:
            self._observe(snapshot)
        assert laid.line.best is not None
        return laid.path, laid.line.best.xy

    def _begin(self, line: str, robot: RobotConfig) -> _Laid:
        """Return the walk with the better line of two walks.

        Without local search, or if the first search ended by itself, there is only one walk.
        """
        search, ending = self._search, self._ending
        has_two = search.has_local_search
        most = PROPOSALS_A_CELL * self._problem.cells
        ending.limit_walk(min(most, FIRST_PROPOSALS) if has_two else most, is_first=has_two)
        best = self._lay(line, robot, search.seed, is_one_of_two=has_two)
        best.complete(1, ending.is_interrupted)
        if search.swept is not None:
            best.complete(COMPARED, ending.is_stopped)
        may_go_on = has_two and ending.is_walk_limited and not ending.is_line_over()
        if not may_go_on or not best.complete(COMPARED, ending.is_line_over):
            return best
        ending.limit_walk(most, is_first=False)
        other = self._lay(line, robot, search.seed ^ SECOND_SEED, is_one_of_two=True)
        is_laid = not ending.is_walk_cut and other.complete(COMPARED, ending.is_line_over)
        return other if is_laid and other.line.rank < best.line.rank else best

    def _lay(self, line: str, robot: RobotConfig, seed: int, *, is_one_of_two: bool) -> _Laid:
        """Search for a walk, and prepare the search for the line along it.

        With two walks, the pheromone is shown once the better walk is known.
        """
        snapshots: list[ColonySnapshot] = []
        is_shown_later = is_one_of_two and self._observe is not ignore
        path = self._walk(seed, snapshots.append if is_shown_later else self._observe)
        ends, swept = self._problem.end is not None, self._search.swept
        search = self._ground.line_search(path.cells, line, robot, ends=ends, swept=swept)
        return _Laid(path, search, search.run(), snapshots)

    def _walk(self, seed: int, observe: Observer) -> CoveragePath:
        """Search for a walk; a planner without a lower bound is given one for its path."""
        search, bound = self._search, self._ending.bound
        planner: CoveragePlanner = (
            OwnPlanner(self._own, seed, OWN_BUDGET_S if search.most_s is None else search.most_s)
            if self._own
            else planner_of(search.planner, replace(search.colony(), seed=seed), search.threads)
        )
        path = planner.plan(self._problem, self._ending.is_walk_over, observe)
        path = replace(path, seed=search.seed)
        if bound is not None:
            path = replace(path, lower_bound_steps=bound.steps, lower_bound_cost_s=bound.cost_s)
        return path
