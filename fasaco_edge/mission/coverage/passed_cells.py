"""Cells that the robot has passed, but in which floor is unswept.

In a fleet a cell counts as swept once a robot has swept its centre, and no robot drives there for
the rest. This robot keeps that floor, in whichever robot's part it lies, and sweeps it when its
line passes near again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell, mask_of

# Limit on the cells kept: the oldest are dropped.
MOST_PASSED = 2_000


class PassedCells:
    """Keeps passed cells until their floor is swept."""

    def __init__(self) -> None:
        # In the order of their last check.
        self._cells: dict[Cell, None] = {}

    def clear(self) -> None:
        """Forget all of them."""
        self._cells.clear()

    def note(self, cell: Cell) -> None:
        """Note that the robot has passed a cell."""
        self._cells[cell] = None
        if len(self._cells) > MOST_PASSED:
            self.drop(next(iter(self._cells)))

    def next(self, most: int) -> list[Cell]:
        """Return the cells to check now: the ones whose last check is longest ago."""
        cells = list(self._cells)[:most]
        for cell in cells:
            del self._cells[cell]
            self._cells[cell] = None
        return cells

    def drop(self, cell: Cell) -> None:
        """Forget a cell: its floor is swept."""
        self._cells.pop(cell, None)

    def inside(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window are passed cells, bool (rows, cols)."""
        return mask_of(self._cells, window)
