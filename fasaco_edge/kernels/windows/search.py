"""Large neighbourhood search: windows anywhere along a walk, one after the other; joined rings.

Source: Shaw, "Using constraint programming and local search methods to solve vehicle routing
problems", 1998, for the scheme: a part is freed, the rest is fixed, and the part is re-optimised.

The solution of a whole ground with few states consists of several rings. A small window over the
seam of two rings, re-optimised for one ring, joins them at the least cost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import (
    EXPANDED,
    Program,
    WalkPrices,
)
from fasaco_edge.kernels.windows.passages import NONE, SLOTS, Passages, across
from fasaco_edge.kernels.windows.program import advance_window, begin_window, end_window
from fasaco_edge.kernels.windows.window import (
    WalkWindow,
    WindowSizes,
    laid_in,
)

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
def draw_seam(
    ground: Ground, aim: WindowSizes, seams: Seams, random: NDArray[np.uint64]
) -> WalkWindow:
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
def label_rings(ground: Ground, passages: Passages, aim: WindowSizes, seams: Seams) -> int:
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
    ground: Ground, aim: WindowSizes, rings: NDArray[np.int32], seams: NDArray[np.int32]
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


# Entries of the tally: cost of the walk and of the best one [half us]; windows solved and cells
# in them since the search began.
COST, BEST, SOLVED, SWEPT = 0, 1, 2, 3
# The noise is 1 / NOISE of a turn. Trials: falling from a tenth finds no better walks.
NOISE = 25
# States kept at first; half as many more with each sweep.
FIRST_BEAM = 60
# Areas grow by a tenth of the first one with each sweep.
GROWTH = 10


@lean_kernel
def solve_windows(
    ground: Ground,
    passages: Passages,
    best: Passages,
    terms: WalkPrices,
    program: Program,
    aim: WindowSizes,
    seams: Seams,
    tally: NDArray[np.int64],
    windows: int,
    expansions: int,
    random: NDArray[np.uint64],
) -> int:
    """Solve windows until a number of states were expanded; or windows that join rings.

    Args:
        ground: framed.
        passages: of the walk; changed in place.
        best: out, the passages of the best walk, if a better one is found; not of one with rings.
        terms: costs and end of the walk.
        program: memory.
        aim: positions and sizes of windows.
        seams: memory to join rings at any price; without any, windows lie anywhere.
        tally: int64 (4,), COST, BEST, SOLVED, SWEPT; changed in place.
        windows: limit on the windows, as one without a possible gain expands no state.
        expansions: expanded states after which to stop.
        random: state of the stream, uint64 (1,).

    Returns:
        Number of rings left; 1 if there are no ``seams``.
    """
    until, left = program.states.clock[EXPANDED] + expansions, as_value(1)
    is_joining = seams.cells.size > 0
    if is_joining:
        left = label_rings(ground, passages, aim, seams)
    for _ in range(windows):
        if program.states.clock[EXPANDED] >= until:
            break
        if is_joining:
            if left <= 1:
                break
            window = draw_seam(ground, aim, seams, random)
            if not window.rows:
                break
            beam, noise, allowance = aim.beam, as_value(0), as_value(ANY_PRICE)
        else:
            window = _draw_window(aim, tally[SWEPT], random)
            # At first nearly any change gains: few states suffice.
            beam = min(aim.beam, FIRST_BEAM + FIRST_BEAM * (tally[SWEPT] // aim.cells.size) // 2)
            noise, allowance = terms.turn // NOISE, as_value(0)
        ring_price = as_value(0)
        begin_window(ground, passages, terms, window, program, noise, allowance, ring_price, random)
        while advance_window(ground, passages, terms, window, program, beam):
            pass
        tally[COST] += end_window(ground, passages, terms, window, program)
        tally[SOLVED] += 1
        if is_joining:
            left = label_rings(ground, passages, aim, seams)
            continue
        tally[SWEPT] += window.rows * window.cols
        if tally[COST] < tally[BEST]:
            tally[BEST] = tally[COST]
            _copy(passages, best)
    return left


@inlined
def _copy(source: Passages, target: Passages) -> None:
    """Copy all passages."""
    for cell in range(source.partner.shape[0]):
        for slot in range(SLOTS):
            target.partner[cell, slot] = source.partner[cell, slot]
    target.ends[0], target.ends[1] = source.ends[0], source.ends[1]


@inlined
def _draw_window(aim: WindowSizes, swept: int, random: NDArray[np.uint64]) -> WalkWindow:
    """Draw a window around some cell: 3 to 8 cells wide, and longer with each sweep."""
    grown = aim.least_area + aim.least_area * swept // (GROWTH * aim.cells.size)
    area = min(grown, aim.most_area)
    short = aim.least_side + index_of(draw(random), aim.most_side - aim.least_side + 1)
    area = area // 2 + index_of(draw(random), area)
    long = max(short, area // short)
    rows, cols = short, long
    bits = draw(random) >> 40
    if bits & 1:
        rows, cols = long, short
    cell = aim.cells[index_of(draw(random), aim.cells.size)]
    row = cell // aim.cols - index_of(draw(random), min(rows, aim.rows - 2 * aim.frame))
    col = cell % aim.cols - index_of(draw(random), min(cols, aim.cols - 2 * aim.frame))
    return laid_in(aim, row, col, rows, cols, int(bits >> 1 & 3))
