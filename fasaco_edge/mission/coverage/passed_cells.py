"""Left floor: cells that the robot has passed with floor unswept, and those it has to come back to.

What the line ahead sweeps is not left; but another line may not sweep it, so such cells are looked
at again and again until their floor is swept.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell, mask_of

# Limit on the cells kept: the oldest are dropped.
MOST_PASSED = 2_000


class LeftFloor:
    """Passed cells with unswept floor.

    Attributes:
        left: those whose floor the line ahead does not sweep either.
    """

    def __init__(self) -> None:
        self.left: set[Cell] = set()
        # In the order in which they were looked at last.
        self._passed: dict[Cell, None] = {}
        # Those left at the last end of a path; and those that the robot does not come back to.
        self._aimed: set[Cell] = set()
        self._tried: set[Cell] = set()

    def clear(self) -> None:
        """Forget all of them."""
        for cells in (self.left, self._aimed, self._tried, self._passed):
            cells.clear()

    def note_passed(self, cell: Cell) -> None:
        """Note that the robot has passed a cell; one that it came back to is done with."""
        if cell in self.left:
            self.give_up((cell,))
        elif cell not in self._tried:
            self._passed[cell] = None
            if len(self._passed) > MOST_PASSED:
                self.drop(next(iter(self._passed)))

    def note_path_end(self) -> None:
        """Give up the cells that a whole path did not lead back to."""
        self.give_up(self.left & self._aimed)
        self._aimed = set(self.left)

    def give_up(self, cells: Iterable[Cell]) -> None:
        """Come back to some cells no more."""
        for cell in tuple(cells):
            self.drop(cell)
            self._tried.add(cell)

    def next(self, most: int) -> list[Cell]:
        """Return the cells to be looked at now: those that were not for longest."""
        cells = list(self._passed)[:most]
        for cell in cells:
            del self._passed[cell]
            self._passed[cell] = None
        return cells

    def note_left(self, cell: Cell, *, is_left: bool) -> None:
        """Note whether the line ahead leaves floor of a cell."""
        if is_left:
            self.left.add(cell)
        else:
            self.left.discard(cell)

    def drop(self, cell: Cell) -> None:
        """Forget a cell: its floor is swept."""
        self._passed.pop(cell, None)
        self.left.discard(cell)

    def passed_in(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window are such passed cells, bool (rows, cols)."""
        return mask_of(self._passed, window)

    def left_in(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window have floor left, bool (rows, cols)."""
        return mask_of(self.left, window)
