"""Blocks of a ground: connected cells within a square of the lattice, and which blocks adjoin.

Who sweeps which room is searched over blocks (``shares``), of which there are few.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel

NONE = -1


class Blocks(NamedTuple):
    """Blocks.

    Attributes:
        of: int32 (size,), block of each cell, NONE off the ground.
        own: int64 (m,), steps that sweeping it takes: one a cell, two for a thin one, which lies in
            no square of four cells, so that a closed walk passes it twice.
        passing: int64 (m,), steps that passing through it takes, there and back.
        begins: int64 (m + 1,), where in ``beside`` the blocks beside each begin.
        beside: int32 (e,).
    """

    of: NDArray[np.int32]
    own: NDArray[np.int64]
    passing: NDArray[np.int64]
    begins: NDArray[np.int64]
    beside: NDArray[np.int32]


@lean_kernel
def _number(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    cells: NDArray[np.int64],
    side: int,
    of: NDArray[np.int32],
    order: NDArray[np.int64],
) -> int:
    """Number the blocks, put their cells in order, block by block; return how many there are."""
    cols, count = int(offsets[1]), 0
    at = end = 0
    for cell in cells:
        if of[cell] != NONE:
            continue
        row, col = cell // cols // side, cell % cols // side
        of[cell], order[end] = count, cell
        end += 1
        while at < end:
            here = order[at]
            at += 1
            for direction in range(4):
                if steps[here] >> direction & 1:
                    there = here + offsets[direction]
                    is_within = there // cols // side == row and there % cols // side == col
                    if is_within and of[there] == NONE:
                        of[there], order[end] = count, there
                        end += 1
        count += 1
    return count


@lean_kernel
def _is_thin(steps: NDArray[np.uint8], offsets: NDArray[np.int64], cell: int) -> bool:
    """Tell whether a cell lies in no square of four."""
    for direction in range(4):
        across = (direction + 1) & 3
        if steps[cell] >> direction & 1 and steps[cell] >> across & 1:
            one, other = cell + offsets[direction], cell + offsets[across]
            if steps[one] >> across & 1 and steps[other] >> direction & 1:
                return False
    return True


@kernel
def blocks_of(
    steps: NDArray[np.uint8], offsets: NDArray[np.int64], cells: NDArray[np.int64], side: int
) -> Blocks:
    """Return the blocks of a connected ground.

    Args:
        steps: step masks, uint8 (size,); none leads out of the array.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        cells: int64 (n,), flat cells of the ground.
        side: of a square [cells].
    """
    of, order = np.full(steps.size, NONE, np.int32), np.empty(cells.size, np.int64)
    count = _number(steps, offsets, cells, side, of, order)
    own, passing = np.zeros(count, np.int64), np.zeros(count, np.int64)
    begins, noted = np.zeros(count + 1, np.int64), np.full(count, NONE, np.int64)
    beside = np.empty(4 * cells.size, np.int32)
    end = 0
    for here in order:
        block = of[here]
        if not passing[block]:
            begins[block] = end
        passing[block] = min(passing[block] + 2, 2 * side)
        own[block] += 2 if _is_thin(steps, offsets, int(here)) else 1
        for direction in range(4):
            if steps[here] >> direction & 1:
                other = of[here + offsets[direction]]
                if other != block and noted[other] != block:
                    noted[other] = block
                    beside[end] = other
                    end += 1
    begins[count] = end
    return Blocks(of, own, passing, begins, beside[:end].copy())
