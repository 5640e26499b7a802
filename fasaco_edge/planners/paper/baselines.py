"""Walks by fixed rules: the paper's baselines, and the first walks of a search.

Spanning-tree coverage, Gabriely and Rimon 2001 (``kernels.ants.baselines`` for any grid), is a
closed walk. With no end cell, the walk stops at the last cell to cover. With an end cell other than
the start, a shortest path to it is appended. The cheaper of the walk and its reverse is returned.

Spiral-STC and ZigZag are as the paper's authors ran them. Their Spiral-STC is a backtracking
spiral: it follows the wall on its right, counter-clockwise, until no open cell is adjacent, and
continues from the nearest open cell. Their ZigZag tries the directions in one fixed order at every
cell, and also continues from the nearest open cell. At dead ends the authors' code makes extra
steps, included in Table I; this code does not make them, see ``tests/benchmarks/RESULTS.md``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.baselines import spanning_tree_walk, sweep
from fasaco_edge.kernels.ants.graph import Graph
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Colony
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import Observer, StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem, graph_of, scratch_for

# Directions in the order of trying, relative to the heading: right, straight on, left, back.
RIGHT_HAND = (3, 0, 1, 2)
# Absolute directions, along the rows first: west, east, south, north.
ROWS_FIRST = (2, 0, 3, 1)
# Along the columns first: south, north, west, east.
COLUMNS_FIRST = (3, 1, 2, 0)
# An ant of this velocity goes straight on for as long as possible.
STRAIGHT_ON = 64


@dataclass(frozen=True, slots=True)
class FixedRule:
    """A deterministic planner, by a fixed rule.

    Attributes:
        name: name of the planner.
        walk: returns the walk over a problem's graph, flat cells int32 (n,).
    """

    name: str
    walk: Callable[[CoverageProblem, Graph], NDArray[np.int32]]

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion = never, observe: Observer = ignore
    ) -> CoveragePath:
        """Return the walk; ``stop`` is not called, as this takes little time."""
        began = time.perf_counter()
        cells = problem.cells_of(self.walk(problem, graph_of(problem)))
        return CoveragePath(
            cells,
            planner=self.name,
            seed=0,
            cost_s=problem.cost.without_prices.of_walk(cells),
            first_walk_s=time.perf_counter() - began,
        )


def _around_tree(problem: CoverageProblem, graph: Graph) -> NDArray[np.int32]:
    """Return the walk around a tree that spans blocks of 2 x 2 cells."""
    lattice = problem.lattice
    # The tree spans covered cells too: the cells to cover need not be connected.
    reachable = reachable_from(lattice.steps, *lattice.local(problem.start))
    walk = spanning_tree_walk(lattice.steps, reachable, problem.flat_start)
    if problem.end is None:
        return _needed_part(problem, walk)
    if problem.closed:
        return walk
    readings = (problem.led_to_end(_needed_part(problem, way)) for way in (walk, walk[::-1]))
    return min(readings, key=problem.cost_us)


def _needed_part(problem: CoverageProblem, walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the walk up to its last cell to cover."""
    first_visits = np.unique(walk, return_index=True)[1]
    needed = problem.to_cover.ravel()[walk[first_visits]]
    return walk[: int(first_visits[needed].max()) + 1]


def _sweep(
    order: tuple[int, int, int, int], turns_along: bool, problem: CoverageProblem, graph: Graph
) -> NDArray[np.int32]:
    """Return a walk by an order of directions; see ``kernels.ants.baselines``."""
    scratch, start, end = scratch_for(graph), problem.flat_start, problem.flat_end
    length = capacity = 2 * problem.cells
    while length >= capacity:
        capacity = 2 * length
        walk = np.empty(capacity, np.int32)
        length = sweep(graph, scratch, start, order, turns_along, end, walk)
    return walk[:length]


def stc(*unused: object) -> FixedRule:
    """Return spanning-tree coverage; like the two below it uses neither colony nor threads."""
    return FixedRule("stc", _around_tree)


def spiral_stc(*unused: object) -> FixedRule:
    """Return the backtracking spiral."""
    return FixedRule("spiral-stc", partial(_sweep, RIGHT_HAND, True))


def zigzag(*unused: object) -> FixedRule:
    """Return the sweep in a fixed order of directions."""
    return FixedRule("zigzag", partial(_sweep, ROWS_FIRST, False))


def first_walks(problem: CoverageProblem, graph: Graph) -> Iterator[NDArray[np.int32]]:
    """Yield complete walks, flat cells int32 (n,).

    For the first, an ant always enters the cell with the fewest open neighbours (Warnsdorff).
    If turns cost, four more follow, each the best on some grids: an ant that goes straight on, the
    spiral, the zigzag, the spanning tree. If a direction of lanes is preferred, the last walk is a
    zigzag in this direction.
    """
    yield _ant(problem, graph, velocity=1)
    if problem.cost.quarter_turn_us:
        yield _ant(problem, graph, velocity=STRAIGHT_ON)
        for rule in (spiral_stc(), zigzag(), stc()):
            yield rule.walk(problem, graph)
    if problem.cost.has_lanes:
        order = COLUMNS_FIRST if problem.cost.row_s else ROWS_FIRST
        yield _sweep(order, False, problem, graph)


def _ant(problem: CoverageProblem, graph: Graph, velocity: int) -> NDArray[np.int32]:
    """Let one ant walk without trail and randomness."""
    config = ColonyConfig(
        ants=1, velocities=(velocity,), q0=1.0, tau0=1.0, visibility="fewest-open", beta=1.0
    )
    with ThreadPoolExecutor(1) as pool:
        walk, _ = Colony(config, problem, graph, pool, 1).walk(velocity, np.ones((1, 4), np.int64))
    return walk
