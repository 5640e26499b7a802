"""Clearance of free pixels: squared distance to the nearest pixel that is not free.

P. Felzenszwalb and D. Huttenlocher, "Distance transforms of sampled functions", Theory of
Computing 8, 2012: distances along columns first, then the lower envelope of parabolas along each
row. All numbers are integers, so results are equal on all machines.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_inner_kernel


@lean_inner_kernel
def _along_columns(solid: NDArray[np.bool_], most: int, ways: NDArray[np.int32]) -> None:
    """Set the distance to the nearest solid pixel, or to the rim, of the same column [pixels]."""
    rows, cols = solid.shape
    for row in range(rows):
        for col in range(cols):
            before = ways[row - 1, col] if row else 0
            ways[row, col] = 0 if solid[row, col] else min(before + 1, most)
    for row in range(rows - 1, -1, -1):
        for col in range(cols):
            after = ways[row + 1, col] if row + 1 < rows else 0
            ways[row, col] = min(ways[row, col], after + 1)


@lean_inner_kernel
def _envelope(ways: NDArray[np.int32], at: NDArray[np.int32], begins: NDArray[np.int32]) -> int:
    """Find the lower envelope of the parabolas of a row; return how many it has.

    Args:
        ways: distances along the columns, int32 (cols,).
        at, begins: out, int32 (cols,): each parabola's column, and the first at which it is lowest.
    """
    count = 0
    for col in range(len(ways)):
        height = col * col + ways[col] * ways[col]
        first = 0
        while count:
            other = at[count - 1]
            lead = height - other * other - ways[other] * ways[other]
            first = lead // (2 * (col - other)) + 1
            if first > begins[count - 1]:
                break
            count -= 1
            first = 0
        if first < len(ways):
            at[count], begins[count] = col, first
            count += 1
    return count


@kernel
def clearances(solid: NDArray[np.bool_], most: int) -> NDArray[np.int32]:
    """Return the squared distance of each pixel's centre to the nearest solid pixel's centre.

    int32 (rows, cols) [pixels^2], 0 for solid pixels, at most ``most`` squared. Pixels beyond the
    rim count as solid.

    Args:
        solid: bool (rows, cols).
        most: largest distance that matters [pixels].
    """
    rows, cols = solid.shape
    ways = np.empty((rows, cols), np.int32)
    _along_columns(solid, most, ways)
    squares = np.empty((rows, cols), np.int32)
    at, begins = np.empty(cols, np.int32), np.empty(cols, np.int32)
    for row in range(rows):
        count = _envelope(ways[row], at, begins)
        here = 0
        for col in range(cols):
            while here + 1 < count and begins[here + 1] <= col:
                here += 1
            across = col - at[here]
            rim = min(col + 1, cols - col)
            square = across * across + ways[row, at[here]] * ways[row, at[here]]
            squares[row, col] = min(square, rim * rim, most * most)
    return squares
