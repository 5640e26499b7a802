"""Cells that a fleet's robots send, in tiles of bits, and travel distances over them.

The number of a robot's tiles, and the size of the rectangle around them, are bounded: further tiles
are left out and counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.frames import placed_point, seen_from, turned
from fasaco_edge.fleet.mission.shared import MOST_TILES_OF_ONE
from fasaco_edge.fleet.mission.tiles import bits_of, cells_in, unpacked
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.mission.coverage.ledger import TILE
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember

Place = tuple[int, int]
Cells = NDArray[np.int64]
# Edge of the largest rectangle around a robot's tiles [tiles]: 2.4 million cells.
MOST_SPAN = 24
FAR = np.iinfo(np.int32).max


@dataclass(frozen=True, slots=True)
class Seat:
    """Placement of a robot's cells: their size, their angle, and the pose of its map frame.

    Attributes:
        cell_m: edge of a cell [m].
        lattice_deg: angle of the cells' rows to the x axis of the map frame [deg].
        x, y, deg: pose of the map frame in the fleet's frame [m], [deg].
    """

    cell_m: float
    lattice_deg: float = 0.0
    x: float = 0.0
    y: float = 0.0
    deg: float = 0.0

    @classmethod
    def of(cls, member: FleetMember) -> Seat:
        """Return the seat that a robot sends."""
        return cls(member.cell_m, member.lattice_deg, *member.origin)

    @property
    def frame(self) -> Pose2D:
        """Pose of the map frame in the fleet's frame."""
        return Pose2D(self.x, self.y, math.radians(self.deg))

    @property
    def lattice(self) -> Pose2D:
        """Pose of the lattice in the fleet's frame."""
        return turned(self.frame, self.lattice_deg)

    def cell_at(self, x: float, y: float) -> Place:
        """Return the cell (row, col) at a point of the map frame [m]."""
        along, across = placed_point(Pose2D(0.0, 0.0, -math.radians(self.lattice_deg)), x, y)
        return math.floor(across / self.cell_m), math.floor(along / self.cell_m)

    def geometry(self, window: Window) -> GridGeometry:
        """Return the placement of a window of cells in the fleet's frame."""
        lattice = self.lattice
        x, y = placed_point(lattice, window.col0 * self.cell_m, window.row0 * self.cell_m)
        return GridGeometry(window.rows, window.cols, self.cell_m, Pose2D(x, y, lattice.yaw))

    def carried(self, cells: Cells, to: Seat) -> Cells:
        """Return the cells of ``to`` that contain the centres of ``cells``, int64 (n, 2)."""
        if to == self or not len(cells):
            return cells
        here = seen_from(self.lattice, to.lattice)
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        x, y = (cells[:, 1] + 0.5) * self.cell_m, (cells[:, 0] + 0.5) * self.cell_m
        x, y = here.x + cos * x - sin * y, here.y + sin * x + cos * y
        return np.floor(np.column_stack((y, x)) / to.cell_m).astype(np.int64)


class TileSet:
    """Cells as tiles of bits, within bounds.

    Attributes:
        count: number of cells.
        refused: number of tiles that were left out.
    """

    def __init__(self) -> None:
        self.count = self.refused = 0
        self._tiles: dict[Place, bytes] = {}
        # Places of the tiles that have changed since the last call of ``changed``.
        self._changed: dict[Place, None] = {}
        self._span: tuple[int, int, int, int] | None = None

    def take(self, tiles: Iterable[CellTile], *, grows: bool) -> bool:
        """Take tiles in; return whether any has changed.

        Args:
            tiles: the tiles.
            grows: whether tiles only add cells; else they replace older tiles.
        """
        has_changed = False
        for tile in tiles:
            place = tile.row, tile.col
            before = self._tiles.get(place)
            if before is None and not self._has_room(place):
                self.refused += 1
                continue
            bits = tile.cells
            if grows and before is not None:
                bits = (bits_of(before) | bits_of(bits)).tobytes()
            if bits != before:
                self.count += cells_in(bits) - cells_in(before or b"")
                self._tiles[place] = bits
                self._changed[place] = None
                has_changed = True
        return has_changed

    def changed(self) -> list[CellTile]:
        """Return the tiles that have changed since the last call."""
        changed, self._changed = self._changed, {}
        return [CellTile(*place, self._tiles[place]) for place in changed]

    def clear(self) -> None:
        """Drop all cells."""
        self._tiles.clear()
        self._changed.clear()
        self._span, self.count = None, 0

    def tiles(self) -> list[CellTile]:
        """Return all tiles."""
        return [CellTile(*place, bits) for place, bits in self._tiles.items()]

    def cells(self) -> Cells:
        """Return all cells (row, col), int64 (n, 2)."""
        return cells_of(self.tiles())

    def _has_room(self, place: Place) -> bool:
        row, col = place
        low_row, low_col, high_row, high_col = self._span or (row, col, row, col)
        span = min(low_row, row), min(low_col, col), max(high_row, row), max(high_col, col)
        too_far = max(span[2] - span[0], span[3] - span[1]) >= MOST_SPAN
        if too_far or len(self._tiles) >= MOST_TILES_OF_ONE:
            return False
        self._span = span
        return True


def cells_of(tiles: Iterable[CellTile]) -> Cells:
    """Return the cells (row, col) of tiles, int64 (n, 2)."""
    found = [np.zeros((0, 2), np.int64)]
    for tile in tiles:
        marked = unpacked(bits_of(tile.cells))
        found.append(np.argwhere(marked) + np.multiply((tile.row, tile.col), TILE))
    return np.concatenate(found)


def together(parts: Iterable[Cells]) -> Cells:
    """Return each cell of the parts once, int64 (n, 2), without parts far from earlier ones."""
    joined = np.zeros((0, 2), np.int64)
    for part in parts:
        both = np.concatenate([joined, part])
        if window_of(both) is not None:
            joined = both
    return np.unique(joined, axis=0)


def window_of(cells: Cells) -> Window | None:
    """Return the window around cells; None for no cells, or a huge window."""
    if not len(cells):
        return None
    (row0, col0), (row1, col1) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
    window = Window(row0, col0, row1 + 1, col1 + 1)
    return window if window.rows * window.cols <= (MOST_SPAN * TILE) ** 2 else None


def mask_of(cells: Cells, window: Window) -> NDArray[np.bool_]:
    """Return which cells of a window are among ``cells``, bool (rows, cols)."""
    mask = np.zeros((window.rows, window.cols), np.bool_)
    at = cells - (window.row0, window.col0)
    inside = ((at >= 0) & (at < mask.shape)).all(axis=1)
    mask[tuple(at[inside].T)] = True
    return mask


def distances(ground: NDArray[np.bool_], start: Place, most_steps: int = FAR) -> NDArray[np.int32]:
    """Return the steps from a cell to each cell of the ground, int32 (rows, cols); FAR for cells
    out of reach, or farther than ``most_steps``.

    Steps lead to all four neighbours, as the observer does not know which steps a robot can make.
    """
    # The border keeps steps from leading over the end of a row into the next row.
    free = np.pad(ground, 1)
    cols = free.shape[1]
    free = free.reshape(-1)
    found = np.full(free.size, FAR, np.int32)
    at = (start[0] + 1) * cols + start[1] + 1
    inside = 0 <= start[0] < ground.shape[0] and 0 <= start[1] < ground.shape[1]
    frontier = np.array([at] if inside and free[at] else [], np.int64)
    steps = 0
    while len(frontier) and steps <= most_steps:
        found[frontier] = steps
        free[frontier] = False
        reached = (frontier[:, None] + np.array((1, -1, cols, -cols))).reshape(-1)
        frontier = np.unique(reached[free[reached]])
        steps += 1
    return np.ascontiguousarray(found.reshape(-1, cols)[1:-1, 1:-1])
