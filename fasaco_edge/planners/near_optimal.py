"""FaSACO with local search: a complete walk at once, then ever better ones.

1. An ant without a trail walks: the first complete walk, within milliseconds.
2. Local search improves it, region by region where the ground is large.
3. Kicks, each followed by local search, go on from there.
4. Where kicks gain nothing any more, the next ants of the colony walk; the walk of
   the best of them goes through 2 and 3, and the trail is strengthened along the
   best walk of all, by equation (8): ants begin where the search has been good.

The search ends when it is told to, when the walk meets its lower bound, when all
ants have walked, or on a large ground, where no ants start over, when kicks gain
nothing any more. Its work is counted; the same counts give the same walk.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import Observer, ignore
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.repair import can_repair, repaired
from fasaco_edge.planners.search import ANTS, Search, SearchPlan
from fasaco_edge.planners.stopping import StoppingCriterion, never

# A repaired walk with more steps than this above its bound is not worth keeping, unless
# a search finds no better one.
POOR_GAP = 0.25


def is_poor(path: CoveragePath) -> bool:
    """Tell whether a repaired walk is so long that a new one is to be looked for."""
    return path.gap is not None and path.gap > POOR_GAP


@dataclass(frozen=True, slots=True)
class NearOptimal:
    """The colony with local search; ants walk on ``threads`` threads.

    Attributes:
        restarts: see ``search.RESTARTS``; other values than the default are there to
            measure what ants and their trail are worth.
    """

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    restarts: str = ANTS
    name: str = "fasaco"

    def plan(
        self,
        problem: CoverageProblem,
        stop: StoppingCriterion = never,
        observe: Observer = ignore,
    ) -> CoveragePath:
        """Return the cheapest walk found; see ``CoveragePlanner.plan``.

        A walk that was still to be driven (``problem.before``) is repaired; only where
        that leaves it far above its bound the colony searches anew.
        """
        path = None
        if can_repair(problem):
            path = repaired(problem, self.name, self.config.seed, stop)
            if problem.only_better or not is_poor(path):
                return path
        found = self._search(problem, stop, observe)
        return found if path is None or found.cost_s < path.cost_s else path

    def _search(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        with ThreadPoolExecutor(self.threads) as pool:
            plan = SearchPlan(self.config, self.threads, self.restarts, self.name)
            search = Search(plan, problem, pool, observe)
            for _ in search.run():
                if stop(search.progress()):
                    break
            path = search.path()
            if observe is not ignore:
                search.show()
            return path
