"""Restarts: walks of ants from which a search continues when perturbations gain nothing.

The ants' trail is strengthened along the best walk so far, by equation (8), so they start from good
solutions.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.graph import Graph
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Colony, groups_of, snapshot_of
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.planners.problem import CoverageProblem

# Sources of restarts: the colony's next ants; ants on a trail that is not strengthened; none.
ANTS, FLAT, NEVER = "ants", "flat", "never"


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of the ants, and the planner's name.

    Attributes:
        planner: planner name in paths.
        colony: configuration of the ants.
        threads: number of threads of the ants.
        restarts: ANTS, FLAT or NEVER.
    """

    planner: str
    colony: ColonyConfig
    threads: int
    restarts: str


class Restarts:
    """The colony of a search, whose groups of ants walk one after the other.

    Attributes:
        ants: number of ants so far.
    """

    def __init__(
        self,
        settings: SearchSettings,
        problem: CoverageProblem,
        graph: Graph,
        pool: ThreadPoolExecutor,
    ) -> None:
        self._settings, self._problem, self._graph, self._pool = settings, problem, graph, pool
        self._groups = groups_of(settings.colony, problem.cells)
        # Allocated when the first ants walk, as its memory is large.
        self._colony: Colony | None = None
        self._cohort, self._velocity = 0, settings.colony.velocities[0]
        self.ants = 0

    def next_walk(self, best: NDArray[np.int32], best_us: int) -> NDArray[np.int32] | None:
        """Let the next group walk; return its walk of the fewest seconds; None without ants.

        Args:
            best: the best walk so far, flat cells int32 (n,).
            best_us: its cost [us].
        """
        group = next(self._groups, None)
        if group is None:
            return None
        colony = self._colony_of_ants()
        if self._settings.restarts == ANTS:
            colony.offer(best, best_us)
            colony.strengthen()
        self._cohort, self._velocity = group.cohort, group.velocity
        self.ants += len(group.streams)
        walk, _ = colony.walk(group.velocity, group.streams)
        return walk

    def snapshot(self, best: NDArray[np.int32], best_us: int, ants: int) -> ColonySnapshot:
        """Return the trail at the end of a search, strengthened along the best walk.

        Args:
            best, best_us: as for ``next_walk``.
            ants: number of walks in the search so far.
        """
        colony = self._colony_of_ants()
        colony.offer(best, best_us)
        colony.strengthen()
        cohort, velocity, steps = self._cohort, self._velocity, best.size - 1
        return snapshot_of(self._problem, colony.trail, cohort, velocity, ants, steps)

    def _colony_of_ants(self) -> Colony:
        if self._colony is None:
            settings = self._settings
            self._colony = Colony(
                settings.colony, self._problem, self._graph, self._pool, settings.threads
            )
        return self._colony
