"""Which part of the map frame a picture of half blocks shows, and at what scale."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.occupancy import OccupancyGrid

LEAST_PIXEL_M = 0.01
# Pictures grow by so much at once [m]: with every row of a growing map they would jump.
ROUNDED_TO_M = 0.5

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """A raster of square pixels over the map frame, y upwards: row 0 is its northern edge.

    Two pixels, one above the other, make a character.

    Attributes:
        left, top: map coordinates of the upper left corner [m].
        pixel_m: edge of a pixel [m].
        columns, lines: size in characters; there are ``2 * lines`` rows of pixels.
    """

    left: float
    top: float
    pixel_m: float
    columns: int
    lines: int

    @classmethod
    def over(cls, bounds: Bounds, columns: int, lines: int) -> Frame:
        """Return the largest frame of so many characters that shows all of ``bounds``.

        Args:
            bounds: x0, y0, x1, y1 [m].
            columns, lines: the room there is, each at least 1.
        """
        x0, y0 = (math.floor(low / ROUNDED_TO_M) * ROUNDED_TO_M for low in bounds[:2])
        x1, y1 = (math.ceil(high / ROUNDED_TO_M) * ROUNDED_TO_M for high in bounds[2:])
        pixel_m = max((x1 - x0) / columns, (y1 - y0) / (2 * lines), LEAST_PIXEL_M)
        left = (x0 + x1 - columns * pixel_m) / 2
        top = (y0 + y1 + 2 * lines * pixel_m) / 2
        return cls(left, top, pixel_m, columns, lines)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels."""
        return 2 * self.lines, self.columns

    def pixels(self, xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the pixels (row, col), (n, 2), that points (x, y) [m], (n, 2), lie in."""
        cols = np.floor((xy[:, 0] - self.left) / self.pixel_m)
        rows = np.floor((self.top - xy[:, 1]) / self.pixel_m)
        beyond = 2.0**31
        return np.stack([rows, cols], axis=-1).clip(-beyond, beyond).astype(np.int64)

    def sampled(self, grid: OccupancyGrid, per_pixel: int, beyond: int) -> NDArray[np.int8]:
        """Return a grid's values on this raster, int8 (rows * per_pixel, cols * per_pixel).

        Args:
            grid: a map or a coverage.
            per_pixel: samples per pixel and axis.
            beyond: value outside the grid.
        """
        rows, cols = (size * per_pixel for size in self.shape)
        step, origin = self.pixel_m / per_pixel, grid.geometry.origin
        scale = 1.0 / grid.geometry.resolution
        dx = (self.left + (np.arange(cols) + 0.5) * step - origin.x)[None, :] * scale
        dy = (self.top - (np.arange(rows) + 0.5) * step - origin.y)[:, None] * scale
        if origin.yaw == 0.0:
            # A row and a column of indices are enough.
            col, row = np.floor(dx).astype(np.int64), np.floor(dy).astype(np.int64)
        else:
            cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
            col = np.floor(cos * dx + sin * dy).astype(np.int64)
            row = np.floor(cos * dy - sin * dx).astype(np.int64)
        height, width = grid.cells.shape
        inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        values = grid.cells[row.clip(0, height - 1), col.clip(0, width - 1)]
        sampled: NDArray[np.int8] = np.where(inside, values, np.int8(beyond))
        return sampled


def known_bounds(grid: OccupancyGrid) -> Bounds | None:
    """Return the bounds (x0, y0, x1, y1) [m] of what a grid knows; None where it knows nothing."""
    known = grid.cells >= 0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return None
    corners = [
        grid.geometry.to_map(float(col), float(row))
        for col in (cols[0], cols[-1] + 1)
        for row in (rows[0], rows[-1] + 1)
    ]
    xs, ys = zip(*corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def joint_bounds(parts: list[Bounds]) -> Bounds | None:
    """Return the bounds around all parts; None without any."""
    if not parts:
        return None
    x0, y0, x1, y1 = zip(*parts, strict=True)
    return min(x0), min(y0), max(x1), max(y1)
