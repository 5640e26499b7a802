"""Room raster: squares of the map frame, each with the number of its room.

Its squares are aligned with the axes of the map frame, as maps may differ in pixel size, corner,
yaw and the part of the building that they cover. The module needs no kernels, as an idle daemon
reads rooms from its file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Window
from fasaco_edge.mission.coverage.floor_tiles import centres

if TYPE_CHECKING:
    from fasaco_edge.grid.rooms import FoundRooms
    from fasaco_edge.mission.coverage.loop_closure import Motion

# Limit on the squares of a raster; a larger building gets wider squares.
MOST_SQUARES = 1_000_000
NOWHERE = Window(0, 0, 0, 0)
# Number of squares processed at once, which bounds memory.
BLOCK = 1 << 18

# Squares are cut if their centre is within this distance of the cut [squares], so that no step
# passes between them.
CUT_SQUARES = 0.75

Ids = NDArray[np.uint16]
Cut = tuple[Point, Point]
"""A segment from (x, y) to (x, y) [m] in the map frame that separates two rooms."""


@dataclass(frozen=True, slots=True, eq=False)
class RoomRaster:
    """Squares with the numbers of rooms.

    Attributes:
        square_m: edge of a square [m]; square (row, col) begins at (col, row) * ``square_m``.
        window: the squares.
        ids: uint16 (rows, cols), the room of each; 0 for none.
    """

    square_m: float
    window: Window
    ids: Ids

    @classmethod
    def empty(cls, square_m: float) -> Self:
        """Return a raster without squares."""
        return cls(square_m, NOWHERE, np.zeros((0, 0), np.uint16))

    def on(self, window: Window) -> Ids:
        """Return a copy of the numbers in another window, uint16 (rows, cols)."""
        ids = np.zeros((window.rows, window.cols), np.uint16)
        if (common := window.intersection(self.window)) is not None:
            ids[common.slices_in(window)] = self.ids[common.slices_in(self.window)]
        return ids

    def at(self, points: NDArray[np.float64]) -> Ids:
        """Return the rooms at points (x, y) [m] of the map frame, float64 (n, 2); 0 for none."""
        squares = np.floor(points[:, ::-1] / self.square_m).astype(np.int32)
        return self.window.values_at(self.ids, squares, 0)

    def cropped(self) -> RoomRaster:
        """Return the raster without empty rows and columns at its border."""
        inner = Window.of(self.ids > 0)
        if inner is None:
            return RoomRaster.empty(self.square_m)
        window = inner.moved(self.window.row0, self.window.col0)
        return replace(self, window=window, ids=self.on(window))

    def squares(self, room: int) -> tuple[Window, NDArray[np.bool_]]:
        """Return the squares of a room, bool (rows, cols), and their window."""
        mask = self.ids == room
        inner = Window.of(mask)
        if inner is None:
            return NOWHERE, np.zeros((0, 0), np.bool_)
        window = inner.moved(self.window.row0, self.window.col0)
        return window, mask[window.slices_in(self.window)].copy()

    def coarser(self, factor: int) -> RoomRaster:
        """Return the raster with squares ``factor`` times as wide, by the numbers at centres."""
        window = self.window.rounded_out(factor)
        ids = self.on(window)[factor // 2 :: factor, factor // 2 :: factor]
        edges = (window.row0, window.col0, window.row1, window.col1)
        return RoomRaster(
            self.square_m * factor, Window(*(edge // factor for edge in edges)), ids.copy()
        )

    def moved(self, motion: Motion) -> RoomRaster:
        """Return the raster after a motion of the map; unchanged if it would be too large."""
        if not self.ids.size:
            return self
        window, side = self.window, self.square_m
        rows, cols = np.meshgrid((window.row0, window.row1), (window.col0, window.col1))
        x, y = motion.forward(cols.ravel() * side, rows.ravel() * side)
        row0, col0 = math.floor(y.min() / side), math.floor(x.min() / side)
        whole = Window(row0, col0, math.ceil(y.max() / side) + 1, math.ceil(x.max() / side) + 1)
        if whole.rows * whole.cols > MOST_SQUARES:
            return self
        ids = np.zeros((whole.rows, whole.cols), np.uint16)
        for part in whole.strips(BLOCK):
            found = self.at(np.stack(motion.back(1.0, *centres(part, side).T), axis=1))
            ids[part.slices_in(whole)] = found.reshape(part.rows, part.cols)
        return replace(self, window=whole, ids=ids).cropped()


def window_over(geometry: GridGeometry, square_m: float) -> Window:
    """Return the window of squares over a grid."""
    x0, y0, x1, y1 = (edge / square_m for edge in geometry.bounds())
    return Window(math.floor(y0), math.floor(x0), math.ceil(y1), math.ceil(x1))


def sampled(found: FoundRooms, window: Window, square_m: float) -> NDArray[np.int32]:
    """Return the region at the centre of each square of a window, int32 (rows, cols)."""
    geometry = found.geometry
    labels = np.zeros((window.rows, window.cols), np.int32)
    for part in window.strips(BLOCK):
        values = geometry.values_at(found.labels, centres(part, square_m))
        labels[part.slices_in(window)] = values.reshape(part.rows, part.cols)
    return labels


def cut_window(cut: Cut, square_m: float) -> Window:
    """Return a window around the squares that a cut goes through."""
    rows = sorted(math.floor(y / square_m) for _, y in cut)
    cols = sorted(math.floor(x / square_m) for x, _ in cut)
    return Window(rows[0] - 1, cols[0] - 1, rows[1] + 2, cols[1] + 2)


def is_cut(window: Window, square_m: float, cut: Cut) -> NDArray[np.bool_]:
    """Return which squares of a window a cut goes through, bool (rows, cols)."""
    (x0, y0), (x1, y1) = cut
    x, y = centres(window, square_m).T
    dx, dy = x1 - x0, y1 - y0
    along = ((x - x0) * dx + (y - y0) * dy) / max(dx * dx + dy * dy, 1e-12)
    along = np.clip(along, 0.0, 1.0)
    right, up = x0 + along * dx - x, y0 + along * dy - y
    far = right * right + up * up
    near: NDArray[np.bool_] = (far < (CUT_SQUARES * square_m) ** 2).reshape(
        window.rows, window.cols
    )
    return near
