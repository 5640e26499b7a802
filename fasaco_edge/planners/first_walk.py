"""A complete walk at once: what a search improves on, and what there is if it must stop."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.colony import FEWEST_OPEN, Rules, walk_ants
from fasaco_edge.kernels.ants.growth import Graph
from fasaco_edge.kernels.costs import walk_cost
from fasaco_edge.planners.baselines import SpanningTree, spiral_stc, zigzag
from fasaco_edge.planners.graph import flat_cells, flat_end, flat_start, scratch_for
from fasaco_edge.planners.problem import CoverageProblem

# An ant of this velocity goes straight on as long as it can.
STRAIGHT_ON = 64

# Room for a walk to begin with.
STEPS_PER_CELL = 2


def first_walks(problem: CoverageProblem, graph: Graph) -> Iterator[tuple[NDArray[np.int32], int]]:
    """Yield complete walks, flat cells int32 (n,), each with its cost [us].

    The first is that of an ant which always goes where the fewest open neighbours
    are left, Warnsdorff's rule. Where turns count, there follow an ant that goes
    straight on, the spiral, the zigzag and the walk around a spanning tree: each is
    best on some grids.
    """
    cost = problem.cost
    for walk in _walks(problem, graph):
        yield walk, walk_cost(walk, cost.step_us, cost.quarter_turn_us)


def _walks(problem: CoverageProblem, graph: Graph) -> Iterator[NDArray[np.int32]]:
    yield _ant(problem, graph, velocity=1)
    if problem.cost.quarter_turn_us:
        yield _ant(problem, graph, velocity=STRAIGHT_ON)
        yield spiral_stc().walk(problem, graph)
        yield zigzag().walk(problem, graph)
        yield flat_cells(problem, SpanningTree().plan(problem).cells)


def _ant(problem: CoverageProblem, graph: Graph, velocity: int) -> NDArray[np.int32]:
    """Let one ant walk that knows no trail and draws no lots."""
    cost = problem.cost
    rules = Rules(
        q0=1.0,
        alpha=0.0,
        tau0=1.0,
        end=flat_end(problem),
        step_us=cost.step_us,
        quarter_turn_us=cost.quarter_turn_us,
        visibility=FEWEST_OPEN,
        powers=1.0 / np.arange(1.0, max(velocity, 4) + 1.0),
    )
    trail, scratch = np.ones((graph.steps.size, 4)), scratch_for(graph)
    lengths = np.full(1, STEPS_PER_CELL * problem.cells + 2)
    walks = np.empty((1, 0), np.int32)
    while walks.shape[1] < lengths[0]:
        # The first try, or too little room: the same ant again, with more.
        walks = np.empty((1, int(lengths[0])), np.int32)
        stream = np.ones((1, 4), np.int64)
        walk_ants(
            graph, trail, rules, scratch, flat_start(problem), velocity, stream, walks, lengths
        )
    return walks[0, : lengths[0]].copy()
