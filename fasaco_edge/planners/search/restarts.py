"""The ants that a search restarts from where perturbations gain nothing any more.

They walk on a trail that is strengthened along the best walk so far, by equation (8): so they begin
where the search has been good.
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

# What a search restarts from: the colony's next ants; the same on a trail that nothing strengthens;
# or nothing.
ANTS, FLAT, NEVER = RESTARTS = ("ants", "flat", "never")


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How ants search, and in whose name.

    Attributes:
        planner: the name that paths carry.
        colony: of the ants.
        threads: that ants walk on.
        restarts: one of ``RESTARTS``.
    """

    planner: str
    colony: ColonyConfig
    threads: int
    restarts: str


class Restarts:
    """The colony of a search, whose groups of ants walk one after the other.

    Attributes:
        ants: how many have walked.
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
        # Its memory is large: it is there once ants walk.
        self._colony: Colony | None = None
        self._cohort, self._velocity = 0, settings.colony.velocities[0]
        self.ants = 0

    def next_walk(
        self, best: NDArray[np.int32], best_us: int
    ) -> tuple[NDArray[np.int32], int] | None:
        """Let the next group walk; return its cheapest walk and its cost [us], None without ants.

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
        return colony.walk(group.velocity, group.streams)

    def snapshot(self, best: NDArray[np.int32], best_us: int, ants: int) -> ColonySnapshot:
        """Return the trail at the end of a search, strengthened along the best walk.

        Args:
            best, best_us: as for ``next_walk``.
            ants: how many walks the search has seen.
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
