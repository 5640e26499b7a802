"""Ways from a cell to all others, in steps."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, kernel
from fasaco_edge.kernels.lattice.reach import UNSEEN, search

# Distance of an unreachable cell [steps]; twice this does not overflow.
FAR = 1 << 28


@kernel
def ways_from(steps: NDArray[np.uint8], start: int) -> NDArray[np.int32]:
    """Return the steps from a flat cell to each cell, int32 (rows * cols,), FAR where none lead.

    Args:
        steps: step masks, uint8 (rows, cols).
        start: flat cell.
    """
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    came_from = np.full(steps.size, UNSEEN, np.uint8)
    ways, queue = np.full(steps.size, FAR, np.int32), np.empty(steps.size, np.int32)
    reached = search(steps.ravel(), offsets, start, as_value(-1), came_from, queue)
    ways[start] = 0
    for cell in queue[1:reached]:
        ways[cell] = ways[cell - offsets[came_from[cell]]] + 1
    return ways
