"""The projection of step prices onto feasible ones: no passage has a negative reduced cost.

Along a line of cells the price of a step may fall by at most one step's cost between consecutive
steps; otherwise going straight would have a negative cost. Pooling adjacent violators (isotonic
regression) projects onto that. Corners and U-turns are feasible if the price at each side is within
a bound; the row's and the column's bound add up to a corner's cost.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, Lines, StepPrices
from fasaco_edge.kernels.jit import lean_inner_kernel

# Magnitude of the price of a missing side [half us].
NO_SIDE = 1 << 60


@lean_inner_kernel
def make_feasible(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Change the prices as little as possible so that no passage has a negative reduced cost."""
    for axis in range(2):
        _level(lines.links[axis], prices.price[axis], step, prices.use)
    _fit_boxes(lines, prices, step, turn)
    for axis in range(2):
        _clamp(lines.links[axis], prices.price[axis], prices.box[axis], step, prices.use[0])


@lean_inner_kernel
def _level(
    links: NDArray[np.uint8], price: NDArray[np.int64], step: int, spare: NDArray[np.int64]
) -> None:
    """Limit the fall of prices to ``step`` between consecutive steps of a line."""
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


@lean_inner_kernel
def _fit_boxes(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Divide the cost of a corner between a cell's two axes, as each needs."""
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


@lean_inner_kernel
def _clamp(
    links: NDArray[np.uint8],
    price: NDArray[np.int64],
    box: NDArray[np.int64],
    step: int,
    highest: NDArray[np.int64],
) -> None:
    """Clamp the prices at sides to the bounds, and their fall to ``step``.

    This alone makes any prices feasible; levelled prices change less. ``highest``, int64 (m,), is
    working memory.
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
