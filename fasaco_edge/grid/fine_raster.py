"""The fine raster of a map: its pixels divided, with a frame of unknown ones around them.

What a tool leaves at a wall is narrower than a pixel of most maps. Pixel (i, j) of the raster is
the unit square around the point (y = i, x = j).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import Bits, packed
from fasaco_edge.kernels.lattice.footprint import Placement

# Pixels are divided until they are this fine: what a tool leaves at a wall is a few of them.
FINE_M = 0.025
# So many pixels, about, are looked at together where that takes a byte or more for each.
STRIP = 1 << 20


@dataclass(frozen=True, slots=True)
class RobotDiscs:
    """The robot and its tool, as discs around one point, and what counts as free.

    Attributes:
        radius_m: of the robot [m].
        tool_m: width of the tool [m].
        free_at_most: occupancy values up to this are free [percent].
    """

    radius_m: float
    tool_m: float
    free_at_most: int = 25


def fine_geometry(
    coarse: GridGeometry, discs: RobotDiscs, most_pixels: int
) -> tuple[GridGeometry, int]:
    """Return a fine raster of a map with a frame around it, and into how many parts pixels go.

    They go into fewer where the raster would have more than ``most_pixels`` of them.

    Raises:
        MapTooLarge: it would have more even if pixels stay whole.
    """
    for parts in range(max(1, math.ceil(coarse.resolution / FINE_M - 1e-3)), 0, -1):
        unit = coarse.resolution / parts
        frame = math.ceil((max(discs.tool_m / 2, discs.radius_m) / unit + 2) / parts) * parts
        rows, cols = coarse.rows * parts + 2 * frame, coarse.cols * parts + 2 * frame
        if rows * cols <= most_pixels:
            break
    else:
        raise MapTooLarge(
            f"a raster of {rows} x {cols} pixels of {unit:g} m exceeds {most_pixels} pixels"
        )
    # Two maps on the same pixels have one raster, however their origins are rounded.
    x, y = coarse.snapped().to_map(-frame / parts, -frame / parts)
    return GridGeometry(rows, cols, unit, Pose2D(x, y, coarse.origin.yaw)), parts


def free_pixels(
    grid: OccupancyGrid, geometry: GridGeometry, parts: int, free_at_most: int, first: int, end: int
) -> NDArray[np.bool_]:
    """Return which pixels are known free of rows ``first`` to ``end`` of a map's fine raster."""
    rows, cols = grid.cells.shape
    frame = (geometry.rows - rows * parts) // 2
    free = np.zeros((end - first, geometry.cols), np.bool_)
    low, high = max(first - frame, 0), min(end - frame, rows * parts)
    if low >= high:
        return free
    part = grid.cells[low // parts : -(-high // parts)]
    known = np.repeat((part >= 0) & (part <= free_at_most), parts, axis=1)
    rows_of = np.arange(low, high) // parts - low // parts
    free[low + frame - first : high + frame - first, frame : frame + cols * parts] = known[rows_of]
    return free


def blocked_pixels(
    grid: OccupancyGrid,
    geometry: GridGeometry,
    parts: int,
    free_at_most: int,
    rows: tuple[int, int],
    keep_out: Callable[[Window], NDArray[np.bool_]] | None = None,
) -> Bits:
    """Return what of some rows of a map's fine raster is not known free, uint64 (rows, words).

    Args:
        grid: the map.
        geometry: of the raster.
        parts: into which pixels of the map are divided.
        free_at_most: occupancy values up to this are free [percent].
        rows: the first one, and the one behind the last.
        keep_out: returns which pixels of a part are kept out of, bool; None for none.
    """
    found = []
    for strip in strips(Window(rows[0], 0, rows[1], geometry.cols)):
        blocked = ~free_pixels(grid, geometry, parts, free_at_most, strip.row0, strip.row1)
        if keep_out is not None:
            blocked |= keep_out(strip)
        found.append(packed(blocked, beyond=True))
    return np.concatenate(found)


def strips(part: Window) -> Iterator[Window]:
    """Yield a part of a raster some rows at a time."""
    rows = max(STRIP // max(part.cols, 1), 1)
    for row in range(part.row0, part.row1, rows):
        yield Window(row, part.col0, min(row + rows, part.row1), part.col1)


def raster_to_map(geometry: GridGeometry, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points y, x of a raster [pixels], float64 (n, 2), as x, y [m] in the map frame."""
    origin, unit = geometry.origin, geometry.resolution
    u, v = (points[:, 1] + 0.5) * unit, (points[:, 0] + 0.5) * unit
    cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
    return np.stack([origin.x + cos * u - sin * v, origin.y + sin * u + cos * v], axis=1)


def map_to_raster(geometry: GridGeometry, x: float, y: float) -> tuple[float, float]:
    """Return the point y, x of a raster [pixels] at x, y [m] in the map frame."""
    col, row = geometry.to_pixels(x, y)
    return row - 0.5, col - 0.5


def stand_placement(geometry: GridGeometry, cell_m: float, radius_m: float) -> Placement:
    """Return where the lattice's cells lie, seen from the centre of the raster's first pixel."""
    unit, yaw = geometry.resolution, geometry.origin.yaw
    x0, y0 = geometry.to_pixels(0.0, 0.0)
    scale = cell_m / unit
    ux, uy = scale * math.cos(yaw), -scale * math.sin(yaw)
    return Placement(x0 - 0.5, y0 - 0.5, ux, uy if abs(uy) > 1e-9 * scale else 0.0, radius_m / unit)
