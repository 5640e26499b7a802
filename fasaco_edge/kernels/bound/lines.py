"""Lines of cells along rows and columns, and the prices of the steps along them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH
from fasaco_edge.kernels.jit import kernel

ALONG_ROWS, ALONG_COLS = 0, 1


class Lines(NamedTuple):
    """Cells numbered along rows and along columns: lines of cells are runs of numbers.

    Attributes:
        sides: uint8 (m,), step masks, in the order of the rows.
        rank: int32 (m,), number of each cell in the order of the columns.
        links: uint8 (2, m), 1 where a step leads to the next cell: along rows, along columns.
        wanted: uint8 (m,), 1 for cells that need a passage: cells to cover, except the start and a
            given end.
        start, end: numbers of cells; end -1 for anywhere.
    """

    sides: NDArray[np.uint8]
    rank: NDArray[np.int32]
    links: NDArray[np.uint8]
    wanted: NDArray[np.uint8]
    start: int
    end: int


class StepPrices(NamedTuple):
    """Prices of the steps to the next cell: the cell pays, the next cell receives.

    All arrays are int64 (2, m): along rows, along columns, in their order.

    Attributes:
        price: in force [half us].
        best: prices of the best bound so far.
        trend: running mean of the directions of ascent [1 / 256].
        use: payments minus receipts of a price in the cheapest passages; before that is known,
            working memory.
        box: bound of the price at a side [half us].
    """

    price: NDArray[np.int64]
    best: NDArray[np.int64]
    trend: NDArray[np.int64]
    use: NDArray[np.int64]
    box: NDArray[np.int64]


@kernel
def lines_of(
    steps: NDArray[np.uint8],
    required: NDArray[np.uint8],
    reached: NDArray[np.uint8],
    start: int,
    end: int,
) -> Lines:
    """Number the cells that can be reached.

    Args:
        steps: step masks, uint8 (rows, cols); symmetric.
        required, reached: uint8 (rows, cols), cells to visit, cells that can be reached.
        start, end: flat cells that can be reached; end -1 for anywhere.
    """
    rows, cols = steps.shape
    number = np.full((rows, cols), -1, np.int32)
    count = 0
    for row in range(rows):
        for col in range(cols):
            if reached[row, col]:
                number[row, col] = count
                count += 1
    sides, wanted = np.empty(count, np.uint8), np.empty(count, np.uint8)
    rank, links = np.empty(count, np.int32), np.empty((2, count), np.uint8)
    counted = 0
    for col in range(cols):
        for row in range(rows):
            cell = number[row, col]
            if cell >= 0:
                mask = steps[row, col]
                sides[cell], wanted[cell] = mask, required[row, col]
                rank[cell] = counted
                links[ALONG_ROWS, cell] = mask >> EAST & 1
                links[ALONG_COLS, counted] = mask >> NORTH & 1
                counted += 1
    first = number[start // cols, start % cols]
    last = number[end // cols, end % cols] if end >= 0 else -1
    wanted[first] = 0
    if end >= 0:
        wanted[last] = 0
    return Lines(sides, rank, links, wanted, int(first), int(last))
