"""Islands: furniture that stands free in a room, as opposed to walls.

An island is an area of solid pixels, joined by sides or corners, that free pixels surround. It is
furniture if it is small, or compact: a table's leg, a chair, a block. A piece of wall between two
doors is long and thin.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_inner_kernel
from fasaco_edge.kernels.lattice.areas import root


class FurnitureLimits(NamedTuple):
    """Which islands are furniture.

    Attributes:
        longest: longest edge of the box around furniture [pixels].
        small: an island is furniture if its box has a shorter diagonal than this [pixels],
        thick: or if its area divided by that diagonal is larger than this [pixels].
    """

    longest: int
    small: float
    thick: float


@lean_inner_kernel
def _join(solid: NDArray[np.bool_], labels: NDArray[np.int32], parents: NDArray[np.int32]) -> int:
    """Give each solid pixel the number of a piece; return the number of pieces."""
    rows, cols = solid.shape
    pieces = 0
    for row in range(rows):
        for col in range(cols):
            labels[row, col] = 0
            if not solid[row, col]:
                continue
            here = 0
            for side in range(4):
                there_row = row if side == 0 else row - 1
                there_col = col - 1 if side == 0 else col - 2 + side
                if there_row < 0 or there_col < 0 or there_col >= cols:
                    continue
                if labels[there_row, there_col] == 0:
                    continue
                other = root(parents, labels[there_row, there_col])
                if here and here != other:
                    parents[max(here, other)] = min(here, other)
                    other = min(here, other)
                here = other
            if here == 0:
                pieces += 1
                parents[pieces] = pieces
                here = pieces
            labels[row, col] = here
    return pieces


@kernel
def furniture(solid: NDArray[np.bool_], limits: FurnitureLimits) -> NDArray[np.bool_]:
    """Return the pixels of islands that are furniture, bool (rows, cols).

    Args:
        solid: bool (rows, cols), pixels that are not free.
        limits: which islands are.
    """
    rows, cols = solid.shape
    labels, parents = np.empty((rows, cols), np.int32), np.empty(rows * cols // 2 + 2, np.int32)
    pieces = _join(solid, labels, parents)
    count = np.zeros(pieces + 1, np.int32)
    low, high = np.full((pieces + 1, 2), rows + cols, np.int32), np.zeros((pieces + 1, 2), np.int32)
    for row in range(rows):
        for col in range(cols):
            if labels[row, col]:
                here = root(parents, labels[row, col])
                labels[row, col] = here
                count[here] += 1
                low[here, 0], low[here, 1] = min(low[here, 0], row), min(low[here, 1], col)
                high[here, 0], high[here, 1] = max(high[here, 0], row), max(high[here, 1], col)
    is_island = np.zeros(pieces + 1, np.bool_)
    for here in range(1, pieces + 1):
        if count[here] == 0:
            continue
        tall, wide = high[here, 0] - low[here, 0] + 1, high[here, 1] - low[here, 1] + 1
        touches_rim = (min(low[here, 0], low[here, 1]) == 0 or high[here, 0] == rows - 1) or high[
            here, 1
        ] == cols - 1
        diagonal = np.sqrt(tall * tall + wide * wide)
        is_compact = diagonal < limits.small or count[here] > limits.thick * diagonal
        is_island[here] = is_compact and not touches_rim and max(tall, wide) <= limits.longest
    marked = np.zeros((rows, cols), np.bool_)
    for row in range(rows):
        for col in range(cols):
            marked[row, col] = is_island[labels[row, col]]
    return marked
