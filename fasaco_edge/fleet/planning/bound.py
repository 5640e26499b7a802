"""Lower bound on the steps of the longest of several robots' walks.

Walks of k robots that return, joined at neighbouring cells by at most 2 (k - 1) further steps, are
one tour over everything: together they have at least as many steps as that tour's bound, less the
further steps. An even share of that is a bound, and so is an even share of the visits of one colour
of a chessboard, and the way to the farthest cell and back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.problem import CoverageProblem


def longest_bound(
    lattice: CoverageLattice,
    starts: Sequence[Cell],
    reached: NDArray[np.bool_],
    away: NDArray[np.int64],
    *,
    returns: bool,
) -> int:
    """Return the bound for any division of the cells among the robots.

    Args:
        lattice: the cells where robots fit.
        starts: where they start.
        reached: bool (rows, cols), the cells to cover: connected, with the starts in them.
        away: int64 (n,), from the nearest start to each cell [steps].
        returns: whether each robot returns to its start.
    """
    cells, robots = int(np.count_nonzero(reached)), len(starts)
    least = (2 if returns else 1) * int(away.max())
    if cells > robots:
        least = max(least, _share(_all_steps(lattice, starts, reached, returns), robots, returns))
    return least


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
    # If robots stay at their starts, which they cover without a step, the others have longer walks.
    rows, cols = np.nonzero(reached)
    odd = int(np.count_nonzero((rows + cols) & 1))
    problem = CoverageProblem.of(lattice, starts[0], end=starts[0], reachable=reached)
    tour = lower_bound_steps(replace(problem, to_cover=reached))
    return max(2 * max(odd, cells - odd), tour - 2 * (robots - 1))
