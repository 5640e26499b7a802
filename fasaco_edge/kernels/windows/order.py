"""Order of a window's cells: line by line, as the dynamic program decides them.

Lines run along the shorter side, so that the frontier is short. A window can be mirrored: the
program then goes through it from another corner. If the beam drops states, each order gives another
walk.
"""

from fasaco_edge.kernels.jit import inlined
from fasaco_edge.kernels.windows.memory import Aim, Window

# Bits of ``Window.mirrored``: lines, or the cells of each line, from the last to the first.
LINES, PLACES = 1, 2


@inlined
def shape_of(window: Window) -> tuple[int, int]:
    """Return the number of lines, and of places in a line."""
    return max(window.rows, window.cols), min(window.rows, window.cols)


@inlined
def cell_at(window: Window, line: int, place: int) -> int:
    """Return a cell by its line and its place in it, both in the program's order."""
    lines, wide = shape_of(window)
    line = lines - 1 - line if window.mirrored & LINES else line
    place = wide - 1 - place if window.mirrored & PLACES else place
    if window.cols > window.rows:
        return (window.row + place) * window.width + window.col + line
    return (window.row + line) * window.width + window.col + place


@inlined
def directions_of(window: Window) -> tuple[int, int]:
    """Return the directions along a line, and from line to line."""
    ahead, below = (1, 0) if window.cols > window.rows else (0, 1)
    ahead = (ahead + 2) & 3 if window.mirrored & PLACES else ahead
    below = (below + 2) & 3 if window.mirrored & LINES else below
    return ahead, below


@inlined
def laid_in(aim: Aim, row: int, col: int, rows: int, cols: int, mirrored: int) -> Window:
    """Return a window as near to its drawn position as the ground allows."""
    rows, cols = min(rows, aim.rows - 2 * aim.frame), min(cols, aim.cols - 2 * aim.frame)
    row = min(max(row, aim.frame), aim.rows - aim.frame - rows)
    col = min(max(col, aim.frame), aim.cols - aim.frame - cols)
    return Window(row, col, rows, cols, aim.cols, mirrored)
