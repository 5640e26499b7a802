"""Spanning-tree coverage, Gabriely and Rimon 2001; see ``kernels.spanning`` for any grid.

The walk is closed. Where it may end anywhere, it ends with the last cell that still
wants a visit; from there a shortest way leads to an end that is not the start. Read
backwards the same walk may come out nearer to that end: the cheaper reading is taken.

Spiral-STC and ZigZag as the paper's authors ran them, its baselines.

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

from fasaco_edge.kernels.ants.baselines import spanning_tree_walk, sweep
from fasaco_edge.kernels.ants.growth import Graph
from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk
from fasaco_edge.planners.graph import cells_of, flat_end, flat_start, graph_of, scratch_for
from fasaco_edge.planners.observation import Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class SpanningTree:
    """Once around a tree that spans blocks of 2 x 2 cells."""

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion = never, observe: Observer = ignore
    ) -> CoveragePath:
        """Return the walk around the tree; it takes too little time to be stopped."""
        began = time.perf_counter()
        lattice = problem.lattice
        row, col = lattice.local(problem.start)
        # The tree spans covered ground too: what is left of it need not hang together.
        ground = reachable_from(lattice.steps, row, col)
        walk = spanning_tree_walk(lattice.steps, ground, row, col)
        if problem.end is None:
            walk = walk[: _last_needed(problem, walk) + 1]
        elif not problem.closed:
            readings = (_led_to_end(problem, walk), _led_to_end(problem, walk[::-1]))
            walk = min(readings, key=problem.cost.of_walk)
        cells = walk + np.array((lattice.window.row0, lattice.window.col0), np.int32)
        return CoveragePath(
            cells,
            planner="stc",
            seed=0,
            cost_s=problem.cost.of_walk(cells),
            first_walk_s=time.perf_counter() - began,
        )


def _led_to_end(problem: CoverageProblem, walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a walk up to the last cell that is needed, and from there on to the end."""
    assert problem.end is not None
    needed = walk[: _last_needed(problem, walk) + 1]
    lattice = problem.lattice
    # Plain integers, or the kernel is compiled a second time for numpy's.
    row, col = needed[-1].tolist()
    way = shortest_walk(lattice.steps, (row, col), lattice.local(problem.end))
    return np.concatenate((needed, way[1:]))


def _last_needed(problem: CoverageProblem, walk: NDArray[np.int32]) -> int:
    """Return the index of the walk's last first visit to a cell that is to be covered."""
    flat = walk[:, 0].astype(np.int64) * problem.to_cover.shape[1] + walk[:, 1]
    first_visits = np.unique(flat, return_index=True)[1]
    wanted = problem.to_cover[walk[first_visits, 0], walk[first_visits, 1]]
    return int(first_visits[wanted].max())


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
