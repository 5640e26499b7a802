"""Rings of passages joined into one, by windows where two of them touch.

The solution of a whole ground with few states consists of several rings. A small window over the
seam of two, re-optimised for one ring, joins them at the least cost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import Aim, Window
from fasaco_edge.kernels.windows.order import laid_in
from fasaco_edge.kernels.windows.passages import NONE, SLOTS, Passages, across

# Sides of the windows: least length, and number of lengths.
SIDE, SIDES = 4, 3
# Allowance to join rings at any price [half us].
ANY_PRICE = 1 << 50
# Label of a cell with several rings; other cells have the number of their ring, or NONE.
SEVERAL = -2
RING, SEEN = 0, 1


class Seams(NamedTuple):
    """Memory to join rings.

    Attributes:
        rings: int32 (n, 2): each cell's RING, and its slots SEEN.
        cells: int32 (cells of an aim,): cells where two rings touch.
    """

    rings: NDArray[np.int32]
    cells: NDArray[np.int32]


@lean_inner_kernel
def draw_seam(ground: Ground, aim: Aim, seams: Seams, random: NDArray[np.uint64]) -> Window:
    """Draw a window where two rings touch; one without rows if none do."""
    count = _list_seams(ground, aim, seams.rings, seams.cells)
    if not count:
        return laid_in(aim, as_value(0), as_value(0), as_value(0), as_value(0), as_value(0))
    cell = seams.cells[index_of(draw(random), count)]
    rows = SIDE + index_of(draw(random), SIDES)
    cols = SIDE + index_of(draw(random), SIDES)
    # All cells beside it are in the window, too.
    row = cell // aim.cols - 1 - index_of(draw(random), rows - 2)
    col = cell % aim.cols - 1 - index_of(draw(random), cols - 2)
    return laid_in(aim, row, col, rows, cols, as_value(0))


@lean_inner_kernel
def label_rings(ground: Ground, passages: Passages, aim: Aim, seams: Seams) -> int:
    """Write each cell's ring and its visited slots; return the number of rings."""
    partner, rings = passages.partner, seams.rings
    for index in range(aim.cells.size):
        rings[aim.cells[index], RING], rings[aim.cells[index], SEEN] = NONE, 0
    found = 0
    for index in range(aim.cells.size):
        for first in range(SLOTS):
            cell, slot = int(aim.cells[index]), first
            if partner[cell, slot] == NONE or rings[cell, SEEN] >> slot & 1:
                continue
            while not rings[cell, SEEN] >> slot & 1:
                other = int(partner[cell, slot])
                rings[cell, SEEN] |= 1 << slot | 1 << other
                if rings[cell, RING] == NONE:
                    rings[cell, RING] = found
                elif rings[cell, RING] != found:
                    rings[cell, RING] = SEVERAL
                cell, slot = across(passages, ground.offsets, cell, other)
            found += 1
    return found


@lean_inner_kernel
def _list_seams(
    ground: Ground, aim: Aim, rings: NDArray[np.int32], seams: NDArray[np.int32]
) -> int:
    """List the cells with several rings, or beside another ring; return their number."""
    listed = 0
    for index in range(aim.cells.size):
        cell = aim.cells[index]
        own = rings[cell, RING]
        is_seam = own == SEVERAL
        for direction in range(2):
            if own != NONE and ground.steps[cell] >> direction & 1:
                other = rings[cell + ground.offsets[direction], RING]
                is_seam = is_seam or (other != NONE and other != own)  # noqa: PLR1714
        if is_seam:
            seams[listed] = cell
            listed += 1
    return listed
