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

TILE = 64


class CoverageLedger:
    """Visits of the tool to each cell.

    A cell is visited when the tool, a disc as wide as a cell, passes over its
    centre. Coming back after having left counts as another visit; ``total`` counts
    all of them.
    """

    def __init__(self, cell_m: float) -> None:
        self.total = 0
        self._cell_m = cell_m
        # By tile, so that a map that jumps far away costs nothing in between.
        self._tiles: dict[Cell, NDArray[np.uint16]] = {}
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
            self.total += 1
            tile = self._tiles.setdefault(
                (row // TILE, col // TILE), np.zeros((TILE, TILE), np.uint16)
            )
            tile[row % TILE, col % TILE] = min(int(tile[row % TILE, col % TILE]) + 1, 65535)
        self._under_tool = self._swept(pose, pose)
        self._last = pose
        return entered

    def visits(self, window: Window) -> NDArray[np.uint16]:
        """Return the number of visits, uint16 (rows, cols), of the cells of ``window``."""
        result = np.zeros((window.rows, window.cols), np.uint16)
        for (tile_row, tile_col), tile in self._tiles.items():
            row, col = tile_row * TILE, tile_col * TILE
            place = Window(row, col, row + TILE, col + TILE)
            common = window.intersection(place)
            if common is not None:
                result[common.slices_in(window)] = tile[common.slices_in(place)]
        return result

    def has_visited(self, cell: Cell) -> bool:
        """Tell whether the tool has passed over ``cell``."""
        row, col = cell
        tile = self._tiles.get((row // TILE, col // TILE))
        return tile is not None and bool(tile[row % TILE, col % TILE])

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


def _span(low: float, high: float, cell_m: float) -> range:
    return range(math.floor(low / cell_m), math.floor(high / cell_m) + 1)
