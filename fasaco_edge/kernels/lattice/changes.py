"""Differences of two maps on one raster, and the lattice cells that they may change.

Two maps of one building are mostly equal. So strips as wide as the map are compared first, in
memory order, then segments of the strips that differ, and pixels last. A map is unknown beyond its
window: a map that has grown differs in its new part.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.lattice.footprint import (
    Box,
    Pixels,
    Placement,
    Thresholds,
    pixel_state,
    reach_of,
)

# Rows of a strip, columns of a segment of a strip, and columns of a block. The changed pixels of a
# block mark the cells around them together.
STRIP, SEGMENT, BLOCK = 8, 64, 8

BLANK = -1


@inlined
def _shows(pixels: Pixels, box: Box) -> bool:
    """Return whether all pixels of a box lie in the window."""
    height, width = pixels.values.shape
    return bool(
        pixels.row <= box.row0
        and pixels.col <= box.col0
        and box.row1 <= pixels.row + height
        and box.col1 <= pixels.col + width
    )


@lean_inner_kernel
def _rows_differ(old: NDArray[np.int8], new: NDArray[np.int8]) -> bool:
    # Without an early end this loop and those below are vectorised.
    differ = False
    for index in range(len(old)):
        differ = differ | (old[index] != new[index])
    return differ


@lean_inner_kernel
def _row_is_blank(values: NDArray[np.int8]) -> bool:
    found = False
    for index in range(len(values)):
        found = found | (values[index] != BLANK)
    return not found


@lean_inner_kernel
def _is_blank(pixels: Pixels, box: Box) -> bool:
    """Return whether a box in the window holds only unknown pixels."""
    left, right = box.col0 - pixels.col, box.col1 - pixels.col
    for row in range(box.row0 - pixels.row, box.row1 - pixels.row):
        if not _row_is_blank(pixels.values[row, left:right]):
            return False
    return True


@lean_inner_kernel
def are_equal(before: Pixels, after: Pixels, box: Box) -> bool:
    """Return whether two maps are equal in a box; False if only one of them shows a part of it."""
    if not _shows(before, box):
        return _shows(after, box) and _is_blank(after, box)
    if not _shows(after, box):
        return _is_blank(before, box)
    for row in range(box.row0, box.row1):
        old = before.values[row - before.row, box.col0 - before.col : box.col1 - before.col]
        new = after.values[row - after.row, box.col0 - after.col : box.col1 - after.col]
        if _rows_differ(old, new):
            return False
    return True


@lean_inner_kernel
def _changed_box(before: Pixels, after: Pixels, box: Box, thresholds: Thresholds) -> Box:
    """Return the smallest box around the changed pixels of a box; without rows if none has.

    A pixel has changed if its state (free, occupied, unknown) has.
    """
    row0, col0, row1, col1 = box.row1, box.col1, box.row0, box.col0
    are_shown = _shows(before, box) and _shows(after, box)
    for row in range(box.row0, box.row1):
        for col in range(box.col0, box.col1):
            if are_shown:
                was = before.values[row - before.row, col - before.col]
                if after.values[row - after.row, col - after.col] == was:
                    continue
            state = pixel_state(before, row, col, thresholds)
            if pixel_state(after, row, col, thresholds) != state:
                row0, row1 = min(row0, row), row + 1
                col0, col1 = min(col0, col), max(col1, col + 1)
    return Box(row0, col0, row1, col1)


@lean_inner_kernel
def _mark_around(
    box: Box, placement: Placement, stale: NDArray[np.bool_], row: int, col: int
) -> int:
    """Mark the cells that a pixel of a box may affect; return the number of newly marked ones.

    The box, widened by the robot's reach, is transformed into the lattice; one more pixel on each
    side allows for rounding.
    """
    reach = reach_of(placement) + 1.0
    x = 0.5 * (box.col0 + box.col1) - placement.x0
    y = 0.5 * (box.row0 + box.row1) - placement.y0
    half_x = 0.5 * (box.col1 - box.col0) + reach
    half_y = 0.5 * (box.row1 - box.row0) + reach
    ux, uy = placement.ux, placement.uy
    per_cell = ux * ux + uy * uy
    right, up = (ux * x + uy * y) / per_cell, (ux * y - uy * x) / per_cell
    half_right = (abs(ux) * half_x + abs(uy) * half_y) / per_cell
    half_up = (abs(ux) * half_y + abs(uy) * half_x) / per_cell
    # The centre of cell (i, j) is at (j + 0.5, i + 0.5) of the lattice.
    rows, cols = stale.shape
    row0 = max(int(np.ceil(up - half_up - 0.5)) - row, 0)
    row1 = min(int(np.floor(up + half_up - 0.5)) + 1 - row, rows)
    col0 = max(int(np.ceil(right - half_right - 0.5)) - col, 0)
    col1 = min(int(np.floor(right + half_right - 0.5)) + 1 - col, cols)
    marked = 0
    for cell_row in range(row0, row1):
        for cell_col in range(col0, col1):
            marked += not stale[cell_row, cell_col]
            stale[cell_row, cell_col] = True
    return marked


@lean_kernel
def mark_stale(
    before: Pixels,
    after: Pixels,
    region: Box,
    thresholds: Thresholds,
    placement: Placement,
    stale: NDArray[np.bool_],
    row: int,
    col: int,
) -> None:
    """Mark the lattice cells whose state or steps may have changed with the pixels.

    If most of the lattice is marked, all of it is: searching on would cost more than it saves.

    Args:
        before, after: the maps.
        region: where they may differ; other pixels are not read.
        thresholds: of free and occupied.
        placement: of the lattice cells.
        stale: in and out, bool (rows, cols); its first cell is cell (row, col).
        row, col: place in the lattice.
    """
    marked = 0
    for row0 in range(region.row0, region.row1, STRIP):
        if 2 * marked > stale.size:
            stale[:] = True
            return
        row1 = min(row0 + STRIP, region.row1)
        if are_equal(before, after, Box(row0, region.col0, row1, region.col1)):
            continue
        for left in range(region.col0, region.col1, SEGMENT):
            right = min(left + SEGMENT, region.col1)
            if are_equal(before, after, Box(row0, left, row1, right)):
                continue
            for col0 in range(left, right, BLOCK):
                block = Box(row0, col0, row1, min(col0 + BLOCK, right))
                changed = _changed_box(before, after, block, thresholds)
                if changed.row0 < changed.row1:
                    marked += _mark_around(changed, placement, stale, row, col)
