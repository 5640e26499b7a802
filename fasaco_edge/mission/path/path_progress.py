"""Progress of the robot on its path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell

# Number of cells ahead in which the robot is searched for; farther ahead the path may visit the
# same cell again.
LOOK_AHEAD = 16
# Distance above which a robot is off its path [cells].
FAR_CELLS = 4


@dataclass(frozen=True, slots=True, eq=False)
class PathProgress:
    """The published path and the robot's progress on it.

    Attributes:
        cells: int32 (n, 2).
        index: index of the cell that the robot was last seen in.
    """

    cells: NDArray[np.int32]
    index: int = 0

    @property
    def ahead(self) -> NDArray[np.int32]:
        """The cells from the robot on, int32 (m, 2)."""
        return self.cells[self.index :]

    @property
    def finished(self) -> bool:
        """Whether the robot is at the end."""
        return self.index >= len(self.cells) - 1

    def driven_to(self, cell: Cell, has_visited: Callable[[Cell], bool]) -> PathProgress:
        """Return the path with the robot in ``cell``, if it drove there along the path.

        A wrong pose in the neighbouring lane must not skip the cells between.
        """
        near: list[Cell] = [
            (row, col) for row, col in self.cells[self.index : self.index + LOOK_AHEAD].tolist()
        ]
        if cell not in near:
            return self
        ahead = near.index(cell)
        if not all(has_visited(between) for between in near[1:ahead]):
            return self
        return replace(self, index=self.index + ahead)

    def is_far(self, cell: Cell) -> bool:
        """Return whether ``cell`` is too far from the robot's cell on the path."""
        if not len(self.cells):
            return False
        row, col = self.cells[self.index]
        return bool(abs(int(row) - cell[0]) + abs(int(col) - cell[1]) > FAR_CELLS)
