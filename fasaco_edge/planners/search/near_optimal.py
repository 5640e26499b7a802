"""The planner colony-search: local search with ants, and repair of an existing walk.

``search`` finds a walk, ``repair`` repairs one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fasaco_edge.planners.bound import GLANCE, lower_bound_of, lower_bound_steps
from fasaco_edge.planners.cost import MICROSECONDS, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import (
    AnyOf,
    Observer,
    StoppingCriterion,
    WorkLimit,
    ignore,
    never,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.repair import repaired
from fasaco_edge.planners.search.search import ColonySearch

# Optimality gap in steps above which a search follows a repair.
POOR_GAP = 0.25
# Proposals of the search after a poor repair: a fixed number, plus a number per cell. On 103
# problems of fleets, they save 83 % of what a million proposals save, in a tenth of the time.
SHORT_SEARCH, SHORT_SEARCH_PER_CELL = 50_000, 300


def is_poor(problem: CoverageProblem, path: CoveragePath) -> bool:
    """Return whether a repaired walk is so long that a search should follow."""
    most = 1.0 + POOR_GAP
    if path.steps <= most * (problem.cells - 1):
        return False  # one step per cell is a lower bound
    least = path.lower_bound_steps or lower_bound_steps(problem)
    return least > 0 and path.steps > most * least


@dataclass(frozen=True, slots=True)
class NearOptimal:
    """Local search in which ants make every other perturbation; one thread is used.

    Attributes:
        has_ants: False for searches and repairs without ants, for comparison.
    """

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    has_ants: bool = True
    name: str = "colony-search"

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion = never, observe: Observer = ignore
    ) -> CoveragePath:
        """Return the cheapest walk found; see ``CoveragePlanner.plan``.

        A previous walk (``problem.before``) is repaired; if the repaired walk is far above its
        bound, a short search follows. Without a previous walk, or for a full search, the colony
        walks until stopped; it starts from the previous walk if that costs no more than the first
        simple walk.
        """
        path = _with_lead(problem, self._plan(problem, stop, observe))
        if not problem.cost.is_priced:
            return path
        return replace(path, cost_s=problem.cost.without_prices.of_walk(path.cells))

    def _plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        if not problem.can_repair:
            return self._search(problem, stop, observe)
        path = repaired(problem, self.name, self.config, stop, has_ants=self.has_ants)
        if problem.only_better or not is_poor(problem, path):
            return path
        proposals = SHORT_SEARCH + SHORT_SEARCH_PER_CELL * problem.cells
        short = WorkLimit(SearchWork(proposals=proposals))
        found = self._search(problem, AnyOf(stop, short), observe)
        return found if found.cost_s < path.cost_s else path

    def _search(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        search = ColonySearch(self.name, self.config, problem, observe, has_ants=self.has_ants)
        for _ in search.run():
            if stop(search.progress()):
                break
        path = search.path()
        if observe is not ignore:
            search.show()
        return path


def _with_lead(problem: CoverageProblem, path: CoveragePath) -> CoveragePath:
    """Return a path with its lead; steps, cost and bound are of the whole problem."""
    whole = problem.whole
    if whole is None:
        return path
    cells = np.concatenate((problem.lead, path.cells))
    cost_s = whole.cost.of_walk(cells)
    # A path that is no better is dropped, so its bound is not needed.
    before_s = None if problem.before is None else problem.price_us(problem.before) / MICROSECONDS
    if before_s is not None and path.cost_s >= before_s:
        return replace(path, cells=cells, cost_s=cost_s, lower_bound_steps=0, lower_bound_cost_s=0)
    bound = lower_bound_of(whole, GLANCE)
    return replace(
        path,
        cells=cells,
        cost_s=cost_s,
        lower_bound_steps=bound.steps,
        lower_bound_cost_s=bound.cost_s,
    )
