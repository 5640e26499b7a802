"""The projection of step prices onto feasible ones: no passage costs less than nothing.

Along a line of cells the price of a step may fall by one step's cost from one to the next, or
passing straight on were too cheap: pooling adjacent violators (isotonic regression) projects onto
that. Corners and ways back are satisfied if what a side is paid stays within a box, one for the two
sides along the row and one along the column, that add up to the cost of a corner.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, Lines, StepPrices
from fasaco_edge.kernels.jit import lean_kernel

# What a side costs that a cell does not have, in size [half us].
NO_SIDE = 1 << 60


@lean_kernel
def make_feasible(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Change the prices as little as it takes that no passage costs less than nothing."""
    for axis in range(2):
        _level(lines.links[axis], prices.price[axis], step, prices.use)
    _fit_boxes(lines, prices, step, turn)
    for axis in range(2):
        _clamp(lines.links[axis], prices.price[axis], prices.box[axis], step, prices.use[0])


@lean_kernel
def _level(
    links: NDArray[np.uint8], price: NDArray[np.int64], step: int, spare: NDArray[np.int64]
) -> None:
    """Let prices fall by no more than ``step`` from each one to the next of its line."""
    mean, weight = spare[0], spare[1]
    first = 0
    for index in range(links.size):
        if links[index]:
            continue
        blocks = 0
        for inner in range(first, index):
            mean[blocks], weight[blocks] = price[inner] + step * (inner - first), 1
            blocks += 1
            while blocks > 1 and mean[blocks - 2] > mean[blocks - 1]:
                one, other = weight[blocks - 2], weight[blocks - 1]
                total = mean[blocks - 2] * one + mean[blocks - 1] * other
                mean[blocks - 2] = total // (one + other)
                weight[blocks - 2] = one + other
                blocks -= 1
        inner = first
        for block in range(blocks):
            for _ in range(weight[block]):
                price[inner] = mean[block] - step * (inner - first)
                inner += 1
        first = index + 1


@lean_kernel
def _fit_boxes(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Share the cost of a corner among a cell's two axes, each as it needs."""
    rows, cols = prices.price[ALONG_ROWS], prices.price[ALONG_COLS]
    corner, least, most = step + turn, step // 2, step // 2 + turn
    for cell in range(lines.sides.size):
        mask, rank = lines.sides[cell], lines.rank[cell]
        along, across = most, most
        if mask & 5 and mask & 10:
            need, other = -NO_SIDE, -NO_SIDE
            if mask & 1:
                need = -rows[cell]
            if mask & 4:
                need = max(need, rows[cell - 1])
            if mask & 2:
                other = -cols[rank]
            if mask & 8:
                other = max(other, cols[rank - 1])
            along = min(max(need + (corner - need - other) // 2, least), most)
            across = corner - along
        prices.box[ALONG_ROWS, cell], prices.box[ALONG_COLS, rank] = along, across


@lean_kernel
def _clamp(
    links: NDArray[np.uint8],
    price: NDArray[np.int64],
    box: NDArray[np.int64],
    step: int,
    highest: NDArray[np.int64],
) -> None:
    """Keep what sides are paid within the boxes, and prices from falling faster than ``step``.

    This alone makes any prices feasible; those that are level move less for it. ``highest``,
    int64 (m,), is working memory.
    """
    limit = NO_SIDE
    for index in range(links.size - 1, -1, -1):
        limit = min(box[index + 1], limit + step) if links[index] else NO_SIDE
        highest[index] = limit
    before = -NO_SIDE
    for index in range(links.size):
        if links[index]:
            before = min(max(price[index], -box[index], before - step), highest[index])
            price[index] = before
        else:
            before = -NO_SIDE
