"""Rasterisation of polygons on the lattice: cells inside and near the border, counts of them.

Polygons are followed edge by edge, cells row by row: an order with thousands of corners takes only
milliseconds of a cycle of the control loop.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, kernel, lean_kernel

# How many bits of a byte are set.
BITS = np.array([bin(byte).count("1") for byte in range(256)], np.uint8)
BITS.flags.writeable = False


@inlined
def _clipped(value: float, low: int, high: int) -> int:
    """Return ``value``, a whole number or infinite, limited to low..high."""
    if value >= high:
        return high
    return int(value) if value > low else low


@lean_kernel
def turn_inside(
    corners: NDArray[np.float64], row0: int, col0: int, cell_m: float, cells: NDArray[np.bool_]
) -> None:
    """Mark the cells whose centres lie inside a polygon, by the even-odd rule.

    Each edge that crosses a row's line of centres toggles all centres beyond it.

    Args:
        corners: float64 (n, 2), x, y [m]; the last is joined to the first.
        row0, col0: place of the cells in the lattice.
        cell_m: edge of a cell [m].
        cells: in and out, bool (rows, cols); all False before.
    """
    rows, cols = cells.shape
    row1, col1 = row0 + rows, col0 + cols
    if not cols:
        return
    top, bottom = row1, row0
    for index in range(len(corners)):
        x0, y0 = corners[index, 0], corners[index, 1]
        x1, y1 = corners[index + 1 - len(corners), 0], corners[index + 1 - len(corners), 1]
        # Half-open, so that a corner on the line counts once.
        first = _clipped(np.ceil(min(y0, y1) / cell_m - 0.5), row0, row1)
        last = _clipped(np.ceil(max(y0, y1) / cell_m - 0.5), row0, row1)
        if first >= last:
            continue
        top, bottom = min(top, first), max(bottom, last)
        slope = (x1 - x0) / (y1 - y0)
        for row in range(first, last):
            x = x0 + ((row + 0.5) * cell_m - y0) * slope
            col = _clipped(np.ceil(x / cell_m - 0.5), col0, col1)
            if col < col1:
                cells[row - row0, col - col0] ^= True
    for row in range(top - row0, bottom - row0):
        inside = False
        for col in range(cols):
            inside ^= cells[row, col]
            cells[row, col] = inside


@lean_kernel
def add_near(
    corners: NDArray[np.float64],
    row0: int,
    col0: int,
    cell_m: float,
    reach_m: float,
    starts: NDArray[np.int32],
) -> None:
    """Add a polygon's border: 1 at the beginning of a stretch of cells near it, -1 after its end.

    A cell is near if the border touches the square of ``reach_m`` to each side around its centre. A
    cell is near one of several borders if the running sum at it is above 0.

    Args:
        corners: float64 (n, 2), x, y [m]; the last is joined to the first.
        row0, col0: place of the cells in the lattice.
        cell_m: edge of a cell [m].
        reach_m: see above [m].
        starts: in and out, int32 (rows, cols + 1).
    """
    rows, cols = starts.shape[0], starts.shape[1] - 1
    row1, col1 = row0 + rows, col0 + cols
    for index in range(len(corners)):
        x0, y0 = corners[index, 0], corners[index, 1]
        x1, y1 = corners[index + 1 - len(corners), 0], corners[index + 1 - len(corners), 1]
        least, most = min(y0, y1), max(y0, y1)
        low, high = (least - reach_m) / cell_m, (most + reach_m) / cell_m
        first_row = _clipped(np.ceil(low - 0.5), row0, row1)
        last_row = _clipped(np.floor(high - 0.5) + 1, row0, row1)
        for row in range(first_row, last_row):
            left, right = min(x0, x1), max(x0, x1)
            if y0 != y1:
                # The part of the edge beside the row's squares; a level edge as a whole.
                slope, y = (x1 - x0) / (y1 - y0), (row + 0.5) * cell_m
                one = x0 + (min(max(y - reach_m, least), most) - y0) * slope
                other = x0 + (min(max(y + reach_m, least), most) - y0) * slope
                left, right = min(one, other), max(one, other)
            first = _clipped(np.ceil((left - reach_m) / cell_m - 0.5), col0, col1)
            last = _clipped(np.floor((right + reach_m) / cell_m - 0.5) + 1, col0, col1)
            starts[row - row0, first - col0] += 1
            starts[row - row0, max(first, last) - col0] -= 1


@kernel
def count_in(planes: NDArray[np.uint8], marked: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Count the bits set both in ``marked``, uint8 (n,), and in each plane, uint8 (k, n).

    The counts are int64 (k,).
    """
    counts = np.zeros(len(planes), np.int64)
    for plane in range(len(planes)):
        count = 0
        for index in range(len(marked)):
            count += BITS[planes[plane, index] & marked[index]]
        counts[plane] = count
    return counts
