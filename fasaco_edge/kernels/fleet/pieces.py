"""Pieces of a tree of shortest ways, one for each robot: consecutive branches, of similar cost.

A tree of shortest ways from a root spans the ground. Its cells in an order in which each branch is
together, and ends with the cell that it hangs at, are cut into consecutive pieces. A robot drives
along the tree from the root to its piece and back, so a piece costs its cells, and twice the way to
the last of them, on which the others hang. That sends hardly more robots through a passage than
what lies behind it takes. Which branch comes first is random, and many orders are tried.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.random import draw

NONE = -1


@lean_kernel
def _span(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    root: int,
    bits: int,
    parent: NDArray[np.int32],
    depth: NDArray[np.int32],
    queue: NDArray[np.int32],
) -> None:
    """Note the next cell on a shortest way from each cell to the root, and its length."""
    parent[:] = NONE
    queue[0], parent[root], depth[root] = root, root, 0
    count, at = 1, 0
    while at < count:
        here = queue[at]
        at += 1
        for turn in range(4):
            direction = (bits + (turn if bits & 4 else -turn)) & 3
            if steps[here] >> direction & 1:
                there = here + offsets[direction]
                if parent[there] == NONE:
                    parent[there], depth[there] = here, depth[here] + 1
                    queue[count] = there
                    count += 1


@lean_kernel
def _arrange(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    root: int,
    parent: NDArray[np.int32],
    stack: NDArray[np.int32],
    order: NDArray[np.int32],
    random: NDArray[np.uint64],
) -> None:
    """Put the cells in an order in which each branch is together, and ends where it hangs."""
    stack[0] = root
    waiting, at = 1, order.size
    while waiting:
        waiting -= 1
        here = stack[waiting]
        at -= 1
        order[at] = here
        first = draw(random) & 3
        for turn in range(4):
            direction = (first + turn) & 3
            if steps[here] >> direction & 1:
                there = here + offsets[direction]
                if parent[there] == here and there != root:
                    stack[waiting] = there
                    waiting += 1


@lean_kernel
def _cut(
    order: NDArray[np.int32], depth: NDArray[np.int32], most: int, ends: NDArray[np.int64]
) -> bool:
    """Cut the cells into pieces that cost at most so much, each as long as can be.

    Returns:
        whether there are as many ends as that takes; where there are more, pieces are empty.
    """
    begin = 0
    for piece in range(ends.size):
        last = begin
        for end in range(begin + 1, min(begin + most, order.size) + 1):
            if end - begin + 2 * depth[order[end - 1]] <= most:
                last = end
        ends[piece] = begin = last
    return begin == order.size


@lean_kernel
def _note(
    order: NDArray[np.int32],
    parent: NDArray[np.int32],
    ends: NDArray[np.int64],
    sets: NDArray[np.int64],
) -> None:
    """Note each piece, and the way to it."""
    sets[:] = 0
    begin = 0
    for piece in range(ends.size):
        for here in order[begin : ends[piece]]:
            sets[here] |= 1 << piece
        if begin < ends[piece]:
            begin = ends[piece]
            here = order[begin - 1]
            while parent[here] != here:
                here = parent[here]
                sets[here] |= 1 << piece


@kernel
def cut_tree(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    root: int,
    cells: int,
    pieces: int,
    tries: int,
    random: NDArray[np.uint64],
    sets: NDArray[np.int64],
) -> int:
    """Cut a tree over the ground into pieces; return the greatest cost of one.

    Args:
        steps: step masks, uint8 (size,); none leads out of the array.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        root: flat cell.
        cells: number of cells that steps lead to from the root, with it.
        pieces: at most 62.
        tries: number of trees; the one whose pieces cost least is taken.
        random: stream, uint64 (1,); advanced.
        sets: int64 (size,), out: the pieces that have each cell, or lead over it on the way from
            the root, a bit each.
    """
    parent, depth = np.empty(steps.size, np.int32), np.empty(steps.size, np.int32)
    stack, order = np.empty(cells, np.int32), np.empty(cells, np.int32)
    ends = np.zeros(pieces, np.int64)
    least = cells + 1
    for _ in range(tries):
        _span(steps, offsets, root, draw(random), parent, depth, stack)
        _arrange(steps, offsets, root, parent, stack, order, random)
        low, high = cells // pieces - 1, least
        # Most are no better than the best so far: one look is enough for them.
        middle = high - 1
        while high - low > 1:
            if _cut(order, depth, middle, ends):
                high = middle
            elif high == least:
                break
            else:
                low = middle
            middle = (low + high) // 2
        if high < least:
            least = high
            _cut(order, depth, least, ends)
            _note(order, parent, ends, sets)
    return least
