"""How many free pixels lie in each lattice cell, carried on from map to map.

A pixel is in the cell that its centre is in. Where that is on the border of two cells, or
rounding decides, the same pixel is always found in the same cell, whatever window of the
raster a map shows: so what was added for it is what is taken away again.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.changes import SEGMENT, STRIP, Box, are_equal
from fasaco_edge.kernels.footprint import Pixels, Placement
from fasaco_edge.kernels.jit import lean_kernel


@lean_kernel
def _add_free(
    pixels: Pixels,
    box: Box,
    free: int,
    placement: Placement,
    counts: NDArray[np.int32],
    row: int,
    col: int,
    each: int,
) -> None:
    """Add ``each`` to the cells' counts for every free pixel in a box, inside the window."""
    rows, cols = counts.shape
    height, width = pixels.values.shape
    per_cell = placement.ux * placement.ux + placement.uy * placement.uy
    vx, vy = placement.ux / per_cell, placement.uy / per_cell
    left, right = max(box.col0, pixels.col), min(box.col1, pixels.col + width)
    for pixel_row in range(max(box.row0, pixels.row), min(box.row1, pixels.row + height)):
        y = pixel_row + 0.5 - placement.y0
        values = pixels.values[pixel_row - pixels.row]
        cell_row = int(np.floor(vx * y)) - row
        # Neighbours are mostly of one cell, which is written to once for all of them.
        at_row, at_col, pending = 0, 0, 0
        for pixel_col in range(left, right):
            value = values[pixel_col - pixels.col]
            if value < 0 or value > free:
                continue
            x = pixel_col + 0.5 - placement.x0
            if vy != 0.0:
                cell_row = int(np.floor(vx * y - vy * x)) - row
            cell_col = int(np.floor(vx * x + vy * y)) - col
            if not (0 <= cell_row < rows and 0 <= cell_col < cols):
                continue
            if cell_row != at_row or cell_col != at_col:
                counts[at_row, at_col] += pending
                at_row, at_col, pending = cell_row, cell_col, 0
            pending += each
        if pending:
            counts[at_row, at_col] += pending


@lean_kernel
def tally_free(
    before: Pixels,
    after: Pixels,
    region: Box,
    free: int,
    placement: Placement,
    counts: NDArray[np.int32],
    row: int,
    col: int,
) -> None:
    """Correct how many free pixels have their centre in each lattice cell.

    Args:
        before: the map that was counted.
        after: the map to count.
        region: where they may differ; other pixels are not looked at.
        free: occupancy values up to this are free.
        placement: where the lattice cells lie.
        counts: in and out, int32 (rows, cols); its first cell is cell (row, col). Pixels
            of other cells are passed over.
        row, col: place in the lattice.
    """
    for row0 in range(region.row0, region.row1, STRIP):
        row1 = min(row0 + STRIP, region.row1)
        if are_equal(before, after, Box(row0, region.col0, row1, region.col1)):
            continue
        for left in range(region.col0, region.col1, SEGMENT):
            part = Box(row0, left, row1, min(left + SEGMENT, region.col1))
            if not are_equal(before, after, part):
                _add_free(before, part, free, placement, counts, row, col, -1)
                _add_free(after, part, free, placement, counts, row, col, 1)
