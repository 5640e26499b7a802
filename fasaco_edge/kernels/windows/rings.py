"""Rings of passages joined into one, by windows where two of them touch.

The solution of a whole ground with few states consists of several rings. A small window over the
seam of two, re-optimised for one ring, joins them at the least cost.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import Program, Terms
from fasaco_edge.kernels.windows.passages import NONE, SLOTS, Passages, across
from fasaco_edge.kernels.windows.program import solve_window
from fasaco_edge.kernels.windows.search import COST, SOLVED, Aim, laid_in

# Sides of the windows: least length, and number of lengths.
SIDE, SIDES = 4, 3
# Allowance to join rings at any price [half us].
ANY_PRICE = 1 << 50
# Label of a cell with several rings; other cells have the number of their ring, or NONE.
SEVERAL = -2
RING, SEEN = 0, 1


@lean_kernel
def join_rings(
    ground: Ground,
    passages: Passages,
    terms: Terms,
    program: Program,
    aim: Aim,
    rings: NDArray[np.int32],
    seams: NDArray[np.int32],
    tally: NDArray[np.int64],
    windows: int,
    random: NDArray[np.uint64],
) -> int:
    """Join rings by some windows; return the number of rings left.

    Args:
        ground: framed.
        passages: changed in place.
        terms: costs and end of the walk.
        program: memory.
        aim: where windows may lie; the beam.
        rings: int32 (n, 2), working memory; seams int32 (cells of ``aim``,), too.
        tally: as in ``solve_windows``; COST and SOLVED are changed in place.
        windows: limit on the windows.
        random: state of the stream, uint64 (1,).
    """
    left = _label(ground, passages, aim, rings)
    for _ in range(windows):
        count = _list_seams(ground, aim, rings, seams)
        if left <= 1 or not count:
            break
        cell = seams[index_of(draw(random), count)]
        rows = SIDE + index_of(draw(random), SIDES)
        cols = SIDE + index_of(draw(random), SIDES)
        # All cells beside it are in the window, too.
        row = cell // aim.cols - 1 - index_of(draw(random), rows - 2)
        col = cell % aim.cols - 1 - index_of(draw(random), cols - 2)
        window = laid_in(aim, row, col, rows, cols, 0)
        tally[COST] += solve_window(
            ground,
            passages,
            terms,
            window,
            program,
            aim.beam,
            as_value(0),
            as_value(ANY_PRICE),
            random,
        )
        tally[SOLVED] += 1
        left = _label(ground, passages, aim, rings)
    return left


@lean_kernel
def _label(ground: Ground, passages: Passages, aim: Aim, rings: NDArray[np.int32]) -> int:
    """Write each cell's ring and its visited slots; return the number of rings."""
    partner = passages.partner
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


@lean_kernel
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
