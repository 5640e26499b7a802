"""Spiral-STC and ZigZag as the paper's authors ran them, its baselines.

The authors' Spiral-STC is a backtracking spiral: it keeps to the wall on its
right, counter-clockwise, until nothing open is beside it, and goes on from the
nearest open cell. Their ZigZag tries the directions in one fixed order at every
cell and leaves dead ends the same way. Both are given here without the extra
steps that their code makes at dead ends, which Table I counts too; see
``fasaco_edge/bench/RESULTS.md``.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.search import Graph
from fasaco_edge.kernels.sweeps import sweep
from fasaco_edge.planners.graph import cells_of, flat_end, flat_start, graph_of, scratch_for
from fasaco_edge.planners.observation import Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem

# From the heading: to the right, straight on, to the left, back.
RIGHT_HAND = (3, 0, 1, 2)
# Along the rows first: west, east, south, north.
ROWS_FIRST = (2, 0, 3, 1)


@dataclass(frozen=True, slots=True)
class _Sweep:
    """A walk by a fixed rule; nothing in it is drawn at random."""

    name: str
    order: tuple[int, int, int, int]
    turns_along: bool

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion = never, observe: Observer = ignore
    ) -> CoveragePath:
        """Return the one walk there is; it takes too little time to be stopped."""
        began = time.perf_counter()
        cells = cells_of(problem, self.walk(problem, graph_of(problem)))
        return CoveragePath(
            cells,
            planner=self.name,
            seed=0,
            cost_s=problem.cost.of_walk(cells),
            first_walk_s=time.perf_counter() - began,
        )

    def walk(self, problem: CoverageProblem, graph: Graph) -> NDArray[np.int32]:
        """Return the walk as flat cells, int32 (n,)."""
        scratch, start, end = scratch_for(graph), flat_start(problem), flat_end(problem)
        length = room = 2 * problem.cells
        while length >= room:
            room = 2 * length
            walk = np.empty(room, np.int32)
            length = sweep(graph, scratch, start, self.order, self.turns_along, end, walk)
        return walk[:length]


def spiral_stc() -> _Sweep:
    """Return the backtracking spiral."""
    return _Sweep("spiral-stc", RIGHT_HAND, turns_along=True)


def zigzag() -> _Sweep:
    """Return the sweep in a fixed order of directions."""
    return _Sweep("zigzag", ROWS_FIRST, turns_along=False)
