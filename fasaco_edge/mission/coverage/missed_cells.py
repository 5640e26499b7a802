"""Missed cells: cells that the robot drove through and left floor in, which it comes back for.

A base that drives beside its line leaves some each time, so it comes back to a cell a few times
only.
"""

from __future__ import annotations

from fasaco_edge.grid.lattice import Cell

# So often the robot comes back to a cell: floor that it left twice more it would leave again.
MOST_AGAIN = 2


class MissedCells:
    """Counts how often the robot comes back to each cell."""

    def __init__(self) -> None:
        self._again: dict[Cell, int] = {}

    def clear(self) -> None:
        """Forget all counts."""
        self._again.clear()

    def may_come_back(self, cell: Cell) -> bool:
        """Return whether the robot may come back to a cell once more."""
        return self._again.get(cell, 0) < MOST_AGAIN

    def come_back(self, cell: Cell) -> None:
        """Note that the robot comes back to a cell."""
        self._again[cell] = self._again.get(cell, 0) + 1
