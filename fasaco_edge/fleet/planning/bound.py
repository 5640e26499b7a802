"""Lower bound on the steps of the longest of several robots' walks.

*Tour.* Walks of k robots that return, joined at neighbouring cells by at most 2 (k - 1) further
steps, are one tour over everything: they have at least as many steps as its bound, less these. An
even share of them is a bound, and so is an even share of the visits of one colour of a chessboard.

*Layers.* The cells at least d steps away from the nearest start fall into connected parts; those d
steps away are a layer of each (``kernels.fleet.layers``). A robot that goes beyond a layer passes
each one on its way out, and again on its way back. If no walk is longer than M, it has at most
M - 2 d - 1 visits left beyond. So if there are v visits beyond a layer, at least v / (M - 2 d - 1)
robots go there, and pass the layer twice each, however few cells it has: from the farthest layers
inward this counts the visits that all of a part takes. If all parts take more together than k
walks of M steps have, M is too low.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels.fleet.layers import layers_of, longest_by_layers
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.problem import CoverageProblem


def longest_bound(
    lattice: CoverageLattice,
    starts: Sequence[Cell],
    reached: NDArray[np.bool_],
    distances: NDArray[np.int32],
    *,
    returns: bool,
) -> int:
    """Return the bound, whatever the robots' cells are.

    Args:
        lattice: the cells where robots fit.
        starts: where they start.
        reached: bool (rows, cols), the cells to cover: connected, with the starts in them.
        distances: int32 (k, rows * cols), from each start to each cell [steps].
        returns: whether each returns to its start.
    """
    cells, robots = int(np.count_nonzero(reached)), len(starts)
    away = distances.min(axis=0)[reached.ravel()]
    times = 2 if returns else 1
    least = times * int(away.max())
    if cells > robots:
        least = max(least, _share(_all_steps(lattice, starts, reached, returns), robots, returns))
    inward = np.flatnonzero(reached)[np.argsort(-away, kind="stable")]
    cols = lattice.steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    layers = layers_of(lattice.steps.ravel(), offsets, inward, distances.min(axis=0))
    return longest_by_layers(layers, robots, least, times)


def _share(steps: int, robots: int, returns: bool) -> int:
    """Return an even share of steps, in whole walks."""
    share = -(-steps // robots)
    return share + share % 2 if returns else share


def _all_steps(
    lattice: CoverageLattice, starts: Sequence[Cell], reached: NDArray[np.bool_], returns: bool
) -> int:
    """Return a bound on the steps of all walks together."""
    robots, cells = len(starts), int(np.count_nonzero(reached))
    if not returns:
        return cells - robots
    # Where robots stay and cover their starts without a step, the others have longer walks.
    rows, cols = np.nonzero(reached)
    odd = int(np.count_nonzero((rows + cols) & 1))
    problem = CoverageProblem.of(lattice, starts[0], end=starts[0], reachable=reached)
    tour = lower_bound_steps(replace(problem, to_cover=reached))
    return max(2 * max(odd, cells - odd), tour - 2 * (robots - 1))
