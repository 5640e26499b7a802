"""Window: its place on the ground, and the order in which the dynamic program decides its cells.

Lines run along the shorter side, so that the frontier is short. A window can be mirrored: the
program then goes through it from another corner. If the beam drops states, each order gives another
walk.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined

# Bits of ``WalkWindow.mirrored``: lines, or the cells of each line, from the last to the first.
LINES, PLACES = 1, 2


class WalkWindow(NamedTuple):
    """A rectangle of framed cells.

    Attributes:
        row, col: its first row and column.
        rows, cols: its size.
        width: of the framed ground.
        mirrored: bits of ``kernels.windows.window``: the corner the program begins in.
    """

    row: int
    col: int
    rows: int
    cols: int
    width: int
    mirrored: int


class WindowSizes(NamedTuple):
    """Positions and sizes of windows.

    Attributes:
        cells: int32 (k,), framed cells that windows are laid around.
        rows, cols: of the framed ground.
        frame: cells of its frame on each side.
        least_side, most_side: of a window's shorter side.
        least_area, most_area: area of a window at first, and in the end.
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


@inlined
def shape_of(window: WalkWindow) -> tuple[int, int]:
    """Return the number of lines, and of places in a line."""
    return max(window.rows, window.cols), min(window.rows, window.cols)


@inlined
def cell_at(window: WalkWindow, line: int, place: int) -> int:
    """Return a cell by its line and its place in it, both in the program's order."""
    lines, wide = shape_of(window)
    line = lines - 1 - line if window.mirrored & LINES else line
    place = wide - 1 - place if window.mirrored & PLACES else place
    if window.cols > window.rows:
        return (window.row + place) * window.width + window.col + line
    return (window.row + line) * window.width + window.col + place


@inlined
def directions_of(window: WalkWindow) -> tuple[int, int]:
    """Return the directions along a line, and from line to line."""
    ahead, below = (1, 0) if window.cols > window.rows else (0, 1)
    ahead = (ahead + 2) & 3 if window.mirrored & PLACES else ahead
    below = (below + 2) & 3 if window.mirrored & LINES else below
    return ahead, below


@inlined
def laid_in(
    aim: WindowSizes, row: int, col: int, rows: int, cols: int, mirrored: int
) -> WalkWindow:
    """Return a window as near to its drawn position as the ground allows."""
    rows, cols = min(rows, aim.rows - 2 * aim.frame), min(cols, aim.cols - 2 * aim.frame)
    row = min(max(row, aim.frame), aim.rows - aim.frame - rows)
    col = min(max(col, aim.frame), aim.cols - aim.frame - cols)
    return WalkWindow(row, col, rows, cols, aim.cols, mirrored)
