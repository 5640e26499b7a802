"""Asides: few cells off the robot's way whose floor is not worth going there.

A map that gets clearer brings single cells, in a nook or between chair legs, in rooms that the
robot has left. The planner covers all cells, at any price; the floor has one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.planners.line import LineConfig

# More cells that hang together are no aside.
MOST_CELLS = 3
# Quarter-turns that an aside takes: away from the way, round, and back into it.
TURNS = 4

Cells = NDArray[np.bool_]


def marked(cells: NDArray[np.integer], window: Window) -> Cells:
    """Return the cells of a window that are among some, int (n, 2), bool (rows, cols)."""
    mask = np.zeros((window.rows, window.cols), np.bool_)
    there = ((cells >= (window.row0, window.col0)) & (cells < (window.row1, window.col1))).all(
        axis=1
    )
    mask[cells[there, 0] - window.row0, cells[there, 1] - window.col0] = True
    return mask


def not_worth_the_way(
    lattice: CoverageLattice,
    asides: Cells,
    goals: Cells,
    left_m2: Callable[[list[Cell]], float],
    line: LineConfig,
) -> Iterator[Cell]:
    """Yield the cells, (row, col), that are to be left as they are.

    Args:
        lattice: bool (rows, cols) below are of its cells.
        asides: open cells, new in reach, that are not on the robot's path.
        goals: cells that it comes to in any case.
        left_m2: tells how much floor is left at some cells.
        line: prices.
    """
    found = find_areas(asides.view(np.uint8))
    window = lattice.window
    step_s = lattice.cell_m / line.speed_m_s
    for number in (np.flatnonzero(found.cells <= MOST_CELLS) + 1).tolist():
        cells = [(row, col) for row, col in np.argwhere(found.labels == number).tolist()]
        named = [(row + window.row0, col + window.col0) for row, col in cells]
        worth_s = line.price_s_m2 * left_m2(named) - TURNS * line.quarter_turn_s
        others = goals | (asides & (found.labels != number))
        if not _is_near(lattice.steps, cells, others, int(worth_s / (2.0 * step_s) + 1.0) - 1):
            yield from named


def _is_near(steps: NDArray[np.uint8], cells: list[Cell], goals: Cells, most: int) -> bool:
    """Tell whether a goal is at most so many steps from one of some cells."""
    seen, rim = set(cells), cells
    for _ in range(most):
        beyond = []
        for row, col in rim:
            for direction, (up, across) in enumerate(zip(ROW_STEP, COL_STEP, strict=True)):
                cell = row + up, col + across
                if steps[row, col] >> direction & 1 and cell not in seen:
                    if goals[cell]:
                        return True
                    seen.add(cell)
                    beyond.append(cell)
        rim = beyond
    return False
