"""Parts of a ground, one for each robot: connected, with its start in it, and of similar load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.parts import MOST_ROBOTS, balance_parts
from fasaco_edge.planners.search.walk_region import stream_of

# Proposals per cell; limits on them, and on the tries, of which the most even one counts.
PROPOSALS, MOST_PROPOSALS, TRIES = 800, 4_000_000, 3
# Limits of the kernel on the cells.
MOST_CELLS = 2**22


def can_part(robots: int, cells: int) -> bool:
    """Tell whether so many robots and cells can be taken."""
    return 2 <= robots <= MOST_ROBOTS and cells < MOST_CELLS


def owners_of_parts(
    lattice: CoverageLattice,
    reached: NDArray[np.bool_],
    starts: Sequence[int],
    distances: NDArray[np.int32],
    seed: tuple[int, ...],
) -> NDArray[np.int32]:
    """Return the robot of each cell, int32 (rows * cols,), -1 off the ground.

    Args:
        lattice: the cells where robots fit.
        reached: bool (rows, cols), the ground: connected cells.
        starts: flat cells, as many as ``can_part`` allows.
        distances: int32 (k, rows * cols), from each start to each cell [steps].
        seed: of the random numbers.
    """
    cells, cols = np.flatnonzero(reached), reached.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    nearest = np.where(reached.ravel(), np.int64(1) << distances.argmin(axis=0), 0)
    for robot, start in enumerate(starts):
        nearest[start] |= 1 << robot
    proposals = min(PROPOSALS * len(cells), MOST_PROPOSALS)
    best, least = nearest, (-1, -1)
    for number in range(max(1, min(TRIES, MOST_PROPOSALS // proposals))):
        sets, stream = nearest.copy(), stream_of(*seed, number)
        where = np.array(starts, np.int64)
        loads = balance_parts(lattice.steps.ravel(), offsets, sets, cells, where, proposals, stream)
        score = int(loads.max()), int(loads.sum())
        if least < (0, 0) or score < least:
            best, least = sets, score
    owners = np.full(best.size, -1, np.int32)
    for robot in reversed(range(len(starts))):
        owners[best >> robot & 1 > 0] = robot
    return owners
