"""Biconnected blocks of a lattice: what stays connected if any one cell is taken away.

Source: Hopcroft and Tarjan, "Algorithm 447: efficient algorithms for graph
manipulation", 1973, depth first without recursion. Two blocks share at most one
cell, a cut vertex; a step joins two cells of exactly one block; a block of two
cells is a bridge.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel


class Blocks(NamedTuple):
    """The blocks that can be reached from a root, each after all blocks beyond it.

    Attributes:
        cells: int32, the blocks' flat cells one block after the other. The first cell of a
            block is its top, the one that every way from the root enters it by.
        first: int32 (blocks + 1,), where each block begins in ``cells``.
    """

    cells: NDArray[np.int32]
    first: NDArray[np.int32]


@kernel
def biconnected_blocks(steps: NDArray[np.uint8], offsets: NDArray[np.int64], root: int) -> Blocks:
    """Return the blocks reached from the flat cell ``root``; none if it has no step.

    Args:
        steps: step masks, uint8 (n,); symmetric.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        root: where the search begins.
    """
    room = np.count_nonzero(steps) + 1
    # Every cell but the root is below the top of one block, and each block has one top.
    cells, first = np.empty(2 * room, np.int32), np.empty(room + 1, np.int32)
    open_cells = np.empty(room, np.int32)
    rank, low = np.zeros(steps.size, np.int32), np.empty(steps.size, np.int32)
    turn, came_by = np.zeros(steps.size, np.uint8), np.empty(steps.size, np.uint8)
    blocks, filled, waiting, ranks = 0, 0, 0, 1
    here = root
    rank[here] = low[here] = 1
    while True:
        direction = turn[here]
        if direction < 4:
            turn[here] += 1
            if not steps[here] >> direction & 1:
                continue
            after = here + offsets[direction]
            if rank[after]:
                low[here] = min(low[here], rank[after])
                continue
            ranks += 1
            rank[after] = low[after] = ranks
            came_by[after] = direction
            open_cells[waiting] = after
            waiting += 1
            here = after
            continue
        if here == root:
            break
        before = here - offsets[came_by[here]]
        if low[here] < rank[before]:
            low[before] = min(low[before], low[here])
        else:
            # Nothing from here on reaches above ``before``: a block ends there.
            first[blocks] = filled
            blocks += 1
            cells[filled] = before
            filled += 1
            cell = -1
            while cell != here:
                waiting -= 1
                cell = open_cells[waiting]
                cells[filled] = cell
                filled += 1
        here = before
    first[blocks] = filled
    return Blocks(cells[:filled], first[: blocks + 1])


@kernel
def wanted_first(cells: NDArray[np.int32], wanted: NDArray[np.uint8]) -> int:
    """Move the wanted of a block's cells to the front, behind its top; return how many.

    Args:
        cells: int32 (k,), a block's cells, the top first; it counts in any case.
        wanted: uint8 (n,), 1 for wanted cells.
    """
    count = 1
    for index in range(1, cells.size):
        if wanted[cells[index]]:
            cells[index], cells[count] = cells[count], cells[index]
            count += 1
    return count
