"""Counts of pixels: free pixels outside reachable cells, and pixels of a rectangle in four reads.

Outside: a pixel belongs to the cell that its centre is in. If the raster is aligned with the
lattice, all rows of pixels in a row of cells have the same stretches outside reachable cells.
These are found once, and then counted row by row.

Rectangles: summed-area tables, after F. Crow, "Summed-area tables for texture mapping",
SIGGRAPH 1984.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import BLOCKED, COVERABLE, UNKNOWN
from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel
from fasaco_edge.kernels.lattice.footprint import Pixels, Placement, Thresholds, state_of


@lean_inner_kernel
def _count(values: NDArray[np.int8], free: int) -> int:
    # Without a branch the loop vectorises.
    count = 0
    for index in range(len(values)):
        count += (values[index] >= 0) & (values[index] <= free)
    return count


@lean_inner_kernel
def _stretches_beside(
    placement: Placement,
    reached: NDArray[np.bool_],
    row: int,
    col: int,
    pixel_row: int,
    first: int,
    bounds: NDArray[np.int32],
) -> int:
    """Find the stretches of a row of pixels outside reached cells; return twice their number.

    ``bounds`` receives beginning and end of each stretch, as columns of the map; column 0 of the
    map is column ``first`` of the raster.
    """
    rows, cols = reached.shape
    per_cell = placement.ux * placement.ux + placement.uy * placement.uy
    vx, vy = placement.ux / per_cell, placement.uy / per_cell
    y = pixel_row + 0.5 - placement.y0
    found, inside = 0, True
    width = len(bounds) - 1
    for index in range(width):
        x = first + index + 0.5 - placement.x0
        cell_row = int(np.floor(vx * y - vy * x)) - row
        cell_col = int(np.floor(vx * x + vy * y)) - col
        here = 0 <= cell_row < rows and 0 <= cell_col < cols and reached[cell_row, cell_col]
        if here != inside:
            bounds[found] = index
            found += 1
            inside = here
    if not inside:
        bounds[found] = width
        found += 1
    return found


@kernel
def count_free_beside(
    pixels: Pixels,
    free: int,
    placement: Placement,
    reached: NDArray[np.bool_],
    row: int,
    col: int,
) -> int:
    """Return how many free pixels have their centre in no reached cell.

    Args:
        pixels: the map.
        free: occupancy values up to this are free.
        placement: where the lattice cells lie.
        reached: bool (rows, cols); its first cell is cell (row, col).
        row, col: place in the lattice.
    """
    height, width = pixels.values.shape
    bounds = np.empty(width + 1, np.int32)
    lies_along = placement.uy == 0.0
    vx = placement.ux / (placement.ux * placement.ux + placement.uy * placement.uy)
    at, found, count = 0, -1, 0
    for index in range(height):
        pixel_row = pixels.row + index
        cell_row = int(np.floor(vx * (pixel_row + 0.5 - placement.y0)))
        if not lies_along or found < 0 or cell_row != at:
            found = _stretches_beside(placement, reached, row, col, pixel_row, pixels.col, bounds)
            at = cell_row
        for stretch in range(0, found, 2):
            count += _count(pixels.values[index, bounds[stretch] : bounds[stretch + 1]], free)
    return count


# One integer holds two counts: the bits below KNOWN_BIT count the pixels that are not free, the
# bits from KNOWN_BIT on count the known pixels.
KNOWN_BIT = 32
NOT_FREE = (1 << KNOWN_BIT) - 1


class PixelSums(NamedTuple):
    """Counts over a window of the raster that begins with pixel (row, col).

    Attributes:
        sums: int64 ((height + 1) * (width + 1),) or longer: at ``i * (width + 1) + j`` the
            count of the window's first i rows and j columns.
        row, col, height, width: the window.
    """

    sums: NDArray[np.int64]
    row: int
    col: int
    height: int
    width: int


@lean_inner_kernel
def weigh(thresholds: Thresholds, weights: NDArray[np.int64]) -> None:
    """Fill in what a pixel adds to a count, int64 (256,): at ``v & 255`` for occupancy v."""
    for value in range(-128, 128):
        state = state_of(value, thresholds)
        weights[value & 255] = (state != COVERABLE) + ((state != UNKNOWN) << KNOWN_BIT)


@lean_inner_kernel
def sums_around(
    pixels: Pixels, x: float, y: float, reach_x: float, reach_y: float, sums: NDArray[np.int64]
) -> PixelSums:
    """Return the sums, empty until ``sum_up``, of all pixels within reach of (x, y)."""
    height, width = pixels.values.shape
    row0 = max(int(np.floor(y - reach_y)), pixels.row)
    col0 = max(int(np.floor(x - reach_x)), pixels.col)
    row1 = min(int(np.floor(y + reach_y)) + 1, pixels.row + height)
    col1 = min(int(np.floor(x + reach_x)) + 1, pixels.col + width)
    return PixelSums(sums, row0, col0, max(row1 - row0, 0), max(col1 - col0, 0))


@lean_inner_kernel
def sum_up(pixels: Pixels, weights: NDArray[np.int64], table: PixelSums) -> None:
    """Fill in the sums."""
    stride = table.width + 1
    table.sums[:stride] = 0
    for row in range(table.height):
        values = pixels.values[table.row - pixels.row + row, table.col - pixels.col :]
        above = table.sums[row * stride : (row + 1) * stride]
        here = table.sums[(row + 1) * stride : (row + 2) * stride]
        here[0] = running = 0
        for col in range(table.width):
            running += weights[int(values[col]) & 255]
            here[col + 1] = above[col + 1] + running


@inlined
def count_around(table: PixelSums, x: float, y: float, reach_x: float, reach_y: float) -> int:
    """Return the count of all pixels within reach of (x, y); -1 beyond the window of the sums."""
    row0, row1 = int(np.floor(y - reach_y)) - table.row, int(np.floor(y + reach_y)) + 1 - table.row
    col0, col1 = int(np.floor(x - reach_x)) - table.col, int(np.floor(x + reach_x)) + 1 - table.col
    if row0 < 0 or col0 < 0 or row1 > table.height or col1 > table.width:
        return -1
    sums, low, high = table.sums, row0 * (table.width + 1), row1 * (table.width + 1)
    return int(sums[high + col1] - sums[high + col0] - sums[low + col1] + sums[low + col0])


@inlined
def is_free(count: int) -> bool:
    """Return whether a count is of free pixels alone."""
    return bool(count >= 0 and count & NOT_FREE == 0)


@inlined
def is_unknown(count: int) -> bool:
    """Return whether a count is of unknown pixels alone."""
    return bool(count >= 0 and count >> KNOWN_BIT == 0)


@inlined
def _is_off(col: int, x: float, dy: float, radius: float) -> bool:
    """Return whether a disc misses the pixel of a column, whose row is ``dy`` away."""
    dx = max(col - x, 0.0, x - col - 1)
    return bool(dx * dx + dy * dy >= radius * radius)


@lean_inner_kernel
def disc_state(pixels: Pixels, x: float, y: float, radius: float, table: PixelSums) -> int:
    """Return the worst state under a disc: blocked before unknown before free.

    Each row takes four reads, as pixels may be much smaller than the robot. The table
    has to span all of the map that the disc touches.
    """
    height, width = pixels.values.shape
    last_row, last_col = pixels.row + height - 1, pixels.col + width - 1
    first, last = int(np.floor(y - radius)), int(np.floor(y + radius))
    # Beyond the map nothing is known: the nearest unknown row is the first one outside the map.
    below, above = max(y - pixels.row, 0.0), max(last_row + 1 - y, 0.0)
    state = COVERABLE
    if (first < pixels.row and below * below < radius * radius) or (
        last > last_row and above * above < radius * radius
    ):
        state = UNKNOWN
    for row in range(max(first, pixels.row), min(last, last_row) + 1):
        dy = max(row - y, 0.0, y - row - 1)
        if dy * dy >= radius * radius:
            continue
        half = np.sqrt(radius * radius - dy * dy)
        # The root may be rounded: the distance of the pixel itself decides.
        left = max(int(np.floor(x - half)) - 1, int(np.floor(x - radius)))
        right = min(int(np.floor(x + half)) + 1, int(np.floor(x + radius)))
        while _is_off(left, x, dy, radius):
            left += 1
        while _is_off(right, x, dy, radius):
            right -= 1
        if left < pixels.col or right > last_col:
            state = UNKNOWN
        left, right = max(left, pixels.col), min(right, last_col)
        if left > right:
            continue
        low = (row - table.row) * (table.width + 1) - table.col
        high = low + table.width + 1
        sums = table.sums
        count = (
            sums[high + right + 1] - sums[high + left] - sums[low + right + 1] + sums[low + left]
        )
        not_free, known = count & NOT_FREE, count >> KNOWN_BIT
        if known + not_free > right + 1 - left:
            return BLOCKED
        if not_free > 0:
            state = UNKNOWN
    return state
