"""Large neighbourhood search: windows anywhere along a walk, one after the other.

Source: Shaw, "Using constraint programming and local search methods to solve vehicle routing
problems", 1998, for the scheme: a part is freed, the rest is fixed, and the part is re-optimised.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import EXPANDED, Program, Terms, Window
from fasaco_edge.kernels.windows.passages import SLOTS, Passages
from fasaco_edge.kernels.windows.program import solve_window


class Aim(NamedTuple):
    """Positions and sizes of windows.

    Attributes:
        cells: int32 (k,), framed cells that windows are laid around.
        rows, cols: of the framed ground.
        frame: cells of its frame on each side.
        least_side, most_side: of a window's shorter side.
        least_area, most_area: of a window at first, and in the end.
        beam: limit on the states kept.
    """

    cells: NDArray[np.int32]
    rows: int
    cols: int
    frame: int
    least_side: int
    most_side: int
    least_area: int
    most_area: int
    beam: int


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
    terms: Terms,
    program: Program,
    aim: Aim,
    tally: NDArray[np.int64],
    expansions: int,
    random: NDArray[np.uint64],
) -> None:
    """Solve windows until a number of states were expanded.

    Args:
        ground: framed.
        passages: of the walk; changed in place.
        best: out, the passages of the best walk, if a better one is found.
        terms: costs and end of the walk.
        program: memory.
        aim: positions and sizes of windows.
        tally: int64 (4,), COST, BEST, SOLVED, SWEPT; changed in place.
        expansions: states to expand at least.
        random: state of the stream, uint64 (1,).
    """
    until = program.clock[EXPANDED] + expansions
    # A window without a possible gain expands none.
    for _ in range(max(expansions // 64, 1)):
        if program.clock[EXPANDED] >= until:
            break
        window = _draw_window(aim, tally[SWEPT], random)
        # At first nearly any change gains: few states suffice.
        beam = min(aim.beam, FIRST_BEAM + FIRST_BEAM * (tally[SWEPT] // aim.cells.size) // 2)
        noise = terms.turn // NOISE
        gain = solve_window(
            ground, passages, terms, window, program, beam, noise, as_value(0), random
        )
        tally[SOLVED] += 1
        tally[SWEPT] += window.rows * window.cols
        tally[COST] += gain
        if tally[COST] < tally[BEST]:
            tally[BEST] = tally[COST]
            _copy(passages, best)


@inlined
def _copy(source: Passages, target: Passages) -> None:
    """Copy all passages."""
    for cell in range(source.partner.shape[0]):
        for slot in range(SLOTS):
            target.partner[cell, slot] = source.partner[cell, slot]
    target.ends[0], target.ends[1] = source.ends[0], source.ends[1]


@inlined
def _draw_window(aim: Aim, swept: int, random: NDArray[np.uint64]) -> Window:
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


@inlined
def laid_in(aim: Aim, row: int, col: int, rows: int, cols: int, mirrored: int) -> Window:
    """Return a window as near to its drawn position as the ground allows."""
    rows, cols = min(rows, aim.rows - 2 * aim.frame), min(cols, aim.cols - 2 * aim.frame)
    row = min(max(row, aim.frame), aim.rows - aim.frame - rows)
    col = min(max(col, aim.frame), aim.cols - aim.frame - cols)
    return Window(row, col, rows, cols, aim.cols, mirrored)
