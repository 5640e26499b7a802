"""Polygons on a raster: which pixels any of many touches, at the cost of those near by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Polygon, Window
from fasaco_edge.kernels.lattice.polygons import add_near, turn_inside


@dataclass(frozen=True, slots=True, eq=False)
class PolygonsOnRaster:
    """Polygons that a robot keeps out of, where they lie on a raster.

    Attributes:
        corners: of each float64 (n, 2), column and row.
        boxes: int64 (polygons, 4): row0, col0, row1, col1 of the pixels that each may touch.
    """

    corners: list[NDArray[np.float64]]
    boxes: NDArray[np.int64]

    @classmethod
    def of(cls, polygons: Sequence[Polygon], geometry: GridGeometry) -> PolygonsOnRaster:
        """Return where polygons (x, y) [m], one or more, lie on the raster of a geometry."""
        ends = np.cumsum([len(polygon) for polygon in polygons])
        points = np.array([corner for polygon in polygons for corner in polygon], np.float64)
        cols, rows = geometry.to_pixels(points[:, 0], points[:, 1])
        begins = np.concatenate([[0], ends[:-1]])
        low = [np.floor(np.minimum.reduceat(each, begins)) - 1 for each in (rows, cols)]
        high = [np.ceil(np.maximum.reduceat(each, begins)) + 1 for each in (rows, cols)]
        corners = np.split(np.stack([cols, rows], axis=1), ends[:-1])
        # With the pixels that a border only touches.
        return cls(corners, np.stack([*low, *high], axis=1).astype(np.int64))

    def touched(self, part: Window) -> NDArray[np.bool_]:
        """Return which pixels of a part of the raster any of them touches, bool (rows, cols)."""
        found = np.zeros((part.rows, part.cols), np.bool_)
        low, high = self.boxes[:, :2], self.boxes[:, 2:]
        near = (low < (part.row1, part.col1)) & (high > (part.row0, part.col0))
        for number in np.flatnonzero(near.all(axis=1)).tolist():
            box = Window(*self.boxes[number].tolist()).intersection(part)
            assert box is not None
            found[box.slices_in(part)] |= _touched_by(self.corners[number], box)
        return found


def _touched_by(corners: NDArray[np.float64], part: Window) -> NDArray[np.bool_]:
    """Return which pixels of a part of the raster a polygon touches, bool (rows, cols)."""
    starts = np.zeros((part.rows, part.cols + 1), np.int32)
    inside = np.zeros((part.rows, part.cols), np.bool_)
    add_near(corners, part.row0, part.col0, 1.0, 0.5, starts)
    turn_inside(corners, part.row0, part.col0, 1.0, inside)
    touched: NDArray[np.bool_] = (np.cumsum(starts, axis=1)[:, :-1] > 0) | inside
    return touched
