"""How a large ground is taken apart for local search: into square regions, again and again.

A region's walk stays in the processor's cache, and its reversals are short. Each
pass lays the squares elsewhere, so that what lay on a rim comes to lie inside.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fasaco_edge.kernels.regions import Box
from fasaco_edge.kernels.walk_array import FRAME
from fasaco_edge.planners.framed import FramedGround

# A ground of up to so many cells to cover, on a lattice not too large for them, is one
# region: what it costs to look at it as a whole does not matter yet.
ONE_REGION = 8_000
LATTICE_OF_ONE = 5 * ONE_REGION

# Edge of a square region, in cells.
EDGE = 80

# Where the squares of a pass begin, in halves of an edge: row, column.
LAYS = ((0, 0), (1, 1), (1, 0), (0, 1))


def is_one_region(rows: int, cols: int, cells: int) -> bool:
    """Tell whether a lattice with so many cells to cover is searched as a whole."""
    return cells <= ONE_REGION and rows * cols <= LATTICE_OF_ONE


def regions_of(framed: FramedGround, cells: int, number: int) -> Iterator[Box]:
    """Yield the regions of pass ``number`` over a ground with so many cells to cover."""
    if is_one_region(framed.rows, framed.cols, cells):
        labels = np.zeros(framed.ground.bound, np.int32)
        yield Box(labels, 0, FRAME, FRAME, framed.rows, framed.cols)
        return
    row_shift, col_shift = (half * EDGE // 2 for half in LAYS[number % len(LAYS)])
    across = framed.width // EDGE + 2
    rows = (np.arange(framed.rows + 2 * FRAME) + row_shift) // EDGE
    cols = (np.arange(framed.width) + col_shift) // EDGE
    labels = (rows[:, None] * across + cols).astype(np.int32).ravel()
    for row in np.unique(rows[FRAME : FRAME + framed.rows]).tolist():
        for col in np.unique(cols[FRAME : FRAME + framed.cols]).tolist():
            first_row, last_row = _span(row, row_shift, framed.rows)
            first_col, last_col = _span(col, col_shift, framed.cols)
            yield Box(
                labels,
                row * across + col,
                first_row,
                first_col,
                last_row - first_row,
                last_col - first_col,
            )


def _span(number: int, shift: int, size: int) -> tuple[int, int]:
    """Return where region ``number`` begins and ends along one axis, inside the frame."""
    first = max(number * EDGE - shift, FRAME)
    return first, min((number + 1) * EDGE - shift, FRAME + size)
