"""Which cells the tool has passed over, cell by cell and never by path index."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import Cell

# Two poses further apart than this many cells are a jump, not a drive: nobody
# knows what lay under the tool in between.
JUMP_CELLS = 2.0


class CoverageLedger:
    """Visits of the tool to each cell.

    A cell is visited when the tool, a disc as wide as a cell, passes over its
    centre. Coming back after having left counts as another visit; ``total`` counts
    all of them.
    """

    def __init__(self, cell_m: float) -> None:
        self.total = 0
        self._cell_m = cell_m
        self._window = Window(0, 0, 0, 0)
        self._visits = np.zeros((0, 0), np.uint16)
        self._under_tool: frozenset[Cell] = frozenset()
        self._last: Pose2D | None = None

    def record(self, pose: Pose2D) -> frozenset[Cell]:
        """Note that the robot drove on to ``pose``; return the cells newly visited."""
        last = self._last or pose
        if math.hypot(pose.x - last.x, pose.y - last.y) > JUMP_CELLS * self._cell_m:
            last = pose
        swept = self._swept(last, pose)
        entered = swept - self._under_tool
        for row, col in entered:
            self._include(row, col)
            index = row - self._window.row0, col - self._window.col0
            self.total += 1
            self._visits[index] = min(int(self._visits[index]) + 1, 65535)
        self._under_tool = self._swept(pose, pose)
        self._last = pose
        return entered

    def visits(self, window: Window) -> NDArray[np.uint16]:
        """Return the number of visits, uint16 (rows, cols), of the cells of ``window``."""
        result = np.zeros((window.rows, window.cols), np.uint16)
        common = window.intersection(self._window)
        if common is not None:
            result[common.slices_in(window)] = self._visits[common.slices_in(self._window)]
        return result

    def _swept(self, start: Pose2D, end: Pose2D) -> frozenset[Cell]:
        """Return the cells whose centre is within half a cell of the segment."""
        cell_m, half = self._cell_m, 0.5 * self._cell_m
        rows = _span(min(start.y, end.y) - half, max(start.y, end.y) + half, cell_m)
        cols = _span(min(start.x, end.x) - half, max(start.x, end.x) + half, cell_m)
        dx, dy = end.x - start.x, end.y - start.y
        length2 = dx * dx + dy * dy
        cells = []
        for row in rows:
            for col in cols:
                px, py = (col + 0.5) * cell_m - start.x, (row + 0.5) * cell_m - start.y
                along = min(max((px * dx + py * dy) / length2, 0.0), 1.0) if length2 else 0.0
                if math.hypot(px - along * dx, py - along * dy) < half:
                    cells.append((row, col))
        return frozenset(cells)

    def _include(self, row: int, col: int) -> None:
        """Make the array span the cell, with room to grow."""
        window = self._window
        if window.row0 <= row < window.row1 and window.col0 <= col < window.col1:
            return
        if not self._visits.size:
            window = Window(row, col, row, col)
        room = 32
        grown = Window(
            min(window.row0, row - room),
            min(window.col0, col - room),
            max(window.row1, row + room),
            max(window.col1, col + room),
        )
        self._visits, self._window = self.visits(grown), grown


def _span(low: float, high: float, cell_m: float) -> range:
    return range(math.floor(low / cell_m), math.floor(high / cell_m) + 1)
