"""How many free pixels lie beside the cells that can be reached.

A pixel is in the cell that its centre is in. Stretches of pixels beside those cells are found
once for all rows of pixels in a row of cells, where the raster lies along the lattice, and
counted in one sweep each.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.footprint import Pixels, Placement
from fasaco_edge.kernels.jit import kernel, lean_kernel


@lean_kernel
def _count(values: NDArray[np.int8], free: int) -> int:
    # Without a branch the loop is vectorised.
    count = 0
    for index in range(len(values)):
        count += (values[index] >= 0) & (values[index] <= free)
    return count


@lean_kernel
def _stretches_beside(
    placement: Placement,
    reached: NDArray[np.bool_],
    row: int,
    col: int,
    pixel_row: int,
    first: int,
    bounds: NDArray[np.int32],
) -> int:
    """Find the stretches of a row of pixels that lie in no reached cell; return twice how many.

    ``bounds`` receives where each begins and ends, as columns of the map, whose first pixel is
    in column ``first`` of the raster.
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
