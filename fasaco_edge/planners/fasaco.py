"""FaSACO: Algorithm 1 of Carr and Wang 2022.

Line 1: for each cohort, in the order of ``ColonyConfig.velocities``; lines 2 to
5: every ant walks until all cells are visited (``kernels.colony.walk_ants``);
line 7: the best walk so far is strengthened by equation (8); line 9: the
cheapest walk is returned, which is the shortest where only steps cost. A colony
whose only velocity is 1 is plain ACO.

Deviations: delta phi of equation (8) is what the cells would cost at a step each
over what the walk costs. For steps alone that is ``cells / steps``, proportional
to 1 over the length as the paper has it and about 1 at best on any map, so that
tau0 needs no tuning to the map's size. A walk may have to end in a given cell:
ants go there by a shortest way when all is covered.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from fasaco_edge.planners.ants import Colony, snapshot_of, streams_of
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.graph import cells_of, graph_of
from fasaco_edge.planners.observation import Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class Fasaco:
    """Fast-spanning ant colony optimisation, on ``threads`` threads."""

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    name: str = "fasaco"

    def plan(
        self,
        problem: CoverageProblem,
        stop: StoppingCriterion = never,
        observe: Observer = ignore,
    ) -> CoveragePath:
        """Return the cheapest walk the colony found; see ``CoveragePlanner.plan``."""
        began = time.perf_counter()
        config = self.config
        graph = graph_of(problem)
        first_walk_s = 0.0
        with ThreadPoolExecutor(self.threads) as pool:
            colony = Colony(config, problem, graph, pool, self.threads)
            walked = 0
            for number, cohort in enumerate(config.cohorts()):
                streams = streams_of(config.seed, number, cohort.ants)
                for first in range(0, cohort.ants, colony.group):
                    ants = streams[first : first + colony.group]
                    colony.walk(cohort.velocity, ants)
                    first_walk_s = first_walk_s or time.perf_counter() - began
                    walked += len(ants)
                    if stop(colony.progress(walked)):
                        return self._path(problem, colony, walked, first_walk_s)
                colony.strengthen()
                if observe is not ignore:
                    steps = colony.best.size - 1
                    observe(
                        snapshot_of(problem, colony.trail, number, cohort.velocity, walked, steps)
                    )
            return self._path(problem, colony, walked, first_walk_s)

    def _path(
        self, problem: CoverageProblem, colony: Colony, walked: int, first_walk_s: float
    ) -> CoveragePath:
        progress = colony.progress(walked)
        return CoveragePath(
            cells_of(problem, colony.best),
            planner=self.name,
            seed=self.config.seed,
            work=progress.work,
            cost_s=progress.cost_s,
            first_walk_s=first_walk_s,
        )
