"""Fine raster of a map: its pixels, polygons on it, and the pixels that a change affects.

The pixels of a map are divided, because the strips that a tool leaves along walls are narrower than
most maps' pixels. A border of unknown pixels surrounds the map. Pixel (i, j) of the raster is the
unit square around the point (y = i, x = j).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid.geometry import GridGeometry, Polygon, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import Bits, packed
from fasaco_edge.kernels.lattice.footprint import Placement
from fasaco_edge.kernels.lattice.polygons import add_near, turn_inside

# Largest edge of a fine pixel [m]: a strip left along a wall is a few such pixels wide.
FINE_M = 0.025
# Decimals of a polygon's corner [pixels].
DECIMALS = 6
# Approximate number of pixels processed at once in arrays of a byte or more per pixel.
STRIP = 1 << 20
# A step may bend around a corner: largest distance of the bend from the centres of the step's two
# cells [cells]; margin for rounding [pixels].
REACH_CELLS, REACH_PX = 2.5, 2.0


@dataclass(frozen=True, slots=True)
class RobotDiscs:
    """The robot and its tool as concentric discs, and the threshold of free pixels.

    Attributes:
        radius_m: radius of the robot [m].
        tool_m: width of the tool [m].
        free_at_most: occupancy values up to this are free [percent].
        clearance_m: distance that lines keep from pixels that are not free, in addition to the
            radius, where possible [m].
    """

    radius_m: float
    tool_m: float
    free_at_most: int = 25
    clearance_m: float = 0.0

    @property
    def clear_m(self) -> float:
        """Radius of the robot with its clearance [m]."""
        return self.radius_m + self.clearance_m


def fine_geometry(
    coarse: GridGeometry, discs: RobotDiscs, most_pixels: int, chunk: int = 1
) -> tuple[GridGeometry, int]:
    """Return the fine raster of a map with a border, and the number of parts per pixel edge.

    The number is reduced if the raster would exceed ``most_pixels``.

    Args:
        coarse: the map.
        discs: robot and tool.
        most_pixels: limit on the pixels.
        chunk: edge of a chunk in pixels of the map. Within the limit, the raster spans whole
            chunks; a map that grows inside them keeps its raster.

    Raises:
        MapTooLarge: it would exceed the limit even with undivided pixels.
    """
    # Maps on the same pixels get the same raster, regardless of rounding of their origins.
    shown = coarse.snapped(chunk), coarse.snapped()
    for parts in range(max(1, math.ceil(coarse.resolution / FINE_M - 1e-3)), 0, -1):
        unit = coarse.resolution / parts
        frame = math.ceil((max(discs.tool_m / 2, discs.radius_m) / unit + 2) / parts) * parts
        for part in shown:
            rows, cols = part.rows * parts + 2 * frame, part.cols * parts + 2 * frame
            if rows * cols <= most_pixels:
                x, y = part.to_map(-frame / parts, -frame / parts)
                return GridGeometry(rows, cols, unit, Pose2D(x, y, coarse.origin.yaw)), parts
    raise MapTooLarge(
        f"a raster of {rows} x {cols} pixels of {unit:g} m exceeds {most_pixels} pixels",
        hint="check the map's resolution; save or publish the map with larger pixels, or the part "
        "of it that is to be covered",
    )


def free_pixels(
    grid: OccupancyGrid, geometry: GridGeometry, parts: int, free_at_most: int, first: int, end: int
) -> NDArray[np.bool_]:
    """Return the known free pixels in rows ``first`` to ``end`` of a map's fine raster."""
    rows, cols = grid.cells.shape
    row0, col0 = geometry.corner_of(grid.geometry.snapped())
    free = np.zeros((end - first, geometry.cols), np.bool_)
    low, high = max(first - row0, 0), min(end - row0, rows * parts)
    if low >= high:
        return free
    part = grid.cells[low // parts : -(-high // parts)]
    known = np.repeat((part >= 0) & (part <= free_at_most), parts, axis=1)
    rows_of = np.arange(low, high) // parts - low // parts
    free[low + row0 - first : high + row0 - first, col0 : col0 + cols * parts] = known[rows_of]
    return free


def blocked_pixels(
    grid: OccupancyGrid,
    geometry: GridGeometry,
    parts: int,
    free_at_most: int,
    rows: tuple[int, int],
    keep_out: Callable[[Window], NDArray[np.bool_]] | None = None,
) -> Bits:
    """Return the pixels not known free in rows of a map's fine raster, uint64 (rows, words).

    Args:
        grid: the map.
        geometry: geometry of the raster.
        parts: number of parts per pixel edge of the map.
        free_at_most: occupancy values up to this are free [percent].
        rows: first row, and end of the range.
        keep_out: returns the kept-out pixels of a window, bool; None for none.
    """
    found = []
    for strip in strips(Window(rows[0], 0, rows[1], geometry.cols)):
        blocked = ~free_pixels(grid, geometry, parts, free_at_most, strip.row0, strip.row1)
        if keep_out is not None:
            blocked |= keep_out(strip)
        found.append(packed(blocked, beyond=True))
    return np.concatenate(found)


def strips(part: Window) -> Iterator[Window]:
    """Return windows of a few rows that together are ``part``."""
    return part.strips(STRIP)


def raster_to_map(geometry: GridGeometry, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points y, x of a raster [pixels], float64 (n, 2), as x, y [m] in the map frame."""
    origin, unit = geometry.origin, geometry.resolution
    u, v = (points[:, 1] + 0.5) * unit, (points[:, 0] + 0.5) * unit
    cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
    return np.stack([origin.x + cos * u - sin * v, origin.y + sin * u + cos * v], axis=1)


def raster_to_raster(
    before: GridGeometry, after: GridGeometry, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return points y, x of a raster [pixels], float64 (n, 2), as points of another raster."""
    cols, rows = after.to_pixels(*raster_to_map(before, points).T)
    return np.stack([rows, cols], axis=1) - 0.5


def map_to_raster(geometry: GridGeometry, x: float, y: float) -> tuple[float, float]:
    """Return the point y, x of a raster [pixels] at x, y [m] in the map frame."""
    col, row = geometry.to_pixels(x, y)
    return row - 0.5, col - 0.5


def stand_placement(geometry: GridGeometry, cell_m: float, radius_m: float) -> Placement:
    """Return the placement of the lattice's cells, relative to the centre of the first pixel."""
    unit, yaw = geometry.resolution, geometry.origin.yaw
    x0, y0 = geometry.to_pixels(0.0, 0.0)
    scale = cell_m / unit
    ux, uy = scale * math.cos(yaw), -scale * math.sin(yaw)
    return Placement(x0 - 0.5, y0 - 0.5, ux, uy if abs(uy) > 1e-9 * scale else 0.0, radius_m / unit)


@dataclass(frozen=True, slots=True, eq=False)
class PolygonsOnRaster:
    """Keep-out polygons on a raster.

    Attributes:
        corners: float64 (n, 2) per polygon: column and row.
        boxes: int64 (polygons, 4): row0, col0, row1, col1 of the pixels that each may touch.
    """

    corners: list[NDArray[np.float64]]
    boxes: NDArray[np.int64]

    @classmethod
    def of(cls, polygons: Sequence[Polygon], geometry: GridGeometry) -> PolygonsOnRaster:
        """Convert polygons (x, y) [m], one or more, to the raster of a geometry."""
        ends = np.cumsum([len(polygon) for polygon in polygons])
        points = np.array([corner for polygon in polygons for corner in polygon], np.float64)
        # Rounded: else a tiny error of the raster's origin could move a border off or onto a pixel.
        cols, rows = (
            np.round(each, DECIMALS) for each in geometry.to_pixels(points[:, 0], points[:, 1])
        )
        begins = np.concatenate([[0], ends[:-1]])
        low = [np.floor(np.minimum.reduceat(each, begins)) - 1 for each in (rows, cols)]
        high = [np.ceil(np.maximum.reduceat(each, begins)) + 1 for each in (rows, cols)]
        corners = np.split(np.stack([cols, rows], axis=1), ends[:-1])
        # Includes pixels that a border only touches.
        return cls(corners, np.stack([*low, *high], axis=1).astype(np.int64))

    def touched(self, part: Window) -> NDArray[np.bool_]:
        """Return which pixels of a part of the raster any polygon touches, bool (rows, cols)."""
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


@dataclass(frozen=True, slots=True)
class Reach:
    """Reach of a robot: the pixels and cells that a change nearby affects.

    A change has an effect at a distance: disc and tool have a size, and steps bend around corners.

    Attributes:
        discs: robot and tool.
        cell_m: edge of a cell [m].
    """

    discs: RobotDiscs
    cell_m: float

    def box(self, cells: Window, geometry: GridGeometry, margin: int) -> Window | None:
        """Return the bounding box in pixels of a window of cells; None for none on the raster.

        Args:
            cells: window of the lattice.
            geometry: geometry of the raster.
            margin: added on each side [pixels].
        """
        placement = stand_placement(geometry, self.cell_m, self.discs.radius_m)
        corners = [
            (
                placement.x0 + placement.ux * col - placement.uy * row,
                placement.y0 + placement.uy * col + placement.ux * row,
            )
            for row in (cells.row0, cells.row1)
            for col in (cells.col0, cells.col1)
        ]
        xs, ys = zip(*corners, strict=True)
        box = Window(
            math.ceil(min(ys)) - margin,
            math.ceil(min(xs)) - margin,
            math.ceil(max(ys)) + margin,
            math.ceil(max(xs)) + margin,
        )
        return box.intersection(geometry.window)

    def pixels_of(
        self, cells: NDArray[np.bool_], window: Window, geometry: GridGeometry
    ) -> Window | None:
        """Return the window of pixels that robot and tool reach from ``cells``; None without cells.

        Args:
            cells: bool (rows, cols) of the window.
            window: window of the lattice.
            geometry: geometry of the raster.
        """
        found = Window.of(cells)
        if found is None:
            return None
        return self.box(found.moved(window.row0, window.col0), geometry, self._margin(geometry))

    def _margin(self, geometry: GridGeometry) -> int:
        """Return how far robot and tool reach from a pixel, in pixels."""
        return int(max(self.discs.clear_m, self.discs.tool_m / 2) / geometry.resolution) + 2
