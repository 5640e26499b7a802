"""Planner of the user's own, with the interface of the registry's planners."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from fasaco_edge.planners.own.loading import UserCode
from fasaco_edge.planners.own.problem import posed, walked
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import Observer, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class OwnPlanner:
    """A user's code as a planner.

    Attributes:
        code: the code.
        seed: passed to it.
        most_s: time that it may take [s]; None for no limit.
    """

    code: UserCode
    seed: int = 0
    most_s: float | None = None

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return the code's walk; only ``most_s`` ends it, and ``observe`` is not called.

        Raises:
            PlannerFailed: the code raised, or took longer.
            IllegalWalk: the result is not a walk, or does not solve the problem.
        """
        given, began = posed(problem, self.seed), time.perf_counter()
        cells = walked(self.code, given, self.most_s)
        taken_s = time.perf_counter() - began
        window = problem.lattice.window
        cells = cells + np.array((window.row0, window.col0), np.int32)
        cost_s = problem.cost.of_walk(cells)
        return CoveragePath(cells, self.code.name, self.seed, cost_s=cost_s, first_walk_s=taken_s)
