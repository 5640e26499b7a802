"""Spanning-tree coverage, Gabriely and Rimon 2001; see ``kernels.spanning`` for any grid.

The walk is closed. Where it need not return, it ends with the last cell that
still wants a visit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fasaco_edge.kernels.spanning import spanning_tree_walk
from fasaco_edge.kernels.walks import reachable_from
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
        lattice = problem.lattice
        row, col = lattice.local(problem.start)
        # The tree spans covered ground too: what is left of it need not hang together.
        ground = reachable_from(lattice.steps, row, col)
        walk = spanning_tree_walk(lattice.steps, ground, row, col)
        if not problem.return_home:
            walk = walk[: _last_needed(problem, walk) + 1]
        corner = np.array((lattice.window.row0, lattice.window.col0), np.int32)
        return CoveragePath(walk + corner, planner="stc", seed=0)


def _last_needed(problem: CoverageProblem, walk: np.ndarray) -> int:
    """Return the index of the walk's last first visit to a cell that is to be covered."""
    flat = walk[:, 0].astype(np.int64) * problem.to_cover.shape[1] + walk[:, 1]
    first_visits = np.unique(flat, return_index=True)[1]
    wanted = problem.to_cover[walk[first_visits, 0], walk[first_visits, 1]]
    return int(first_visits[wanted].max())
