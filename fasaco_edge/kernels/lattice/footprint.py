"""Footprint of the robot, a disc: where it fits, and between which cells it can drive.

All lengths are in pixels of the map's raster. A pixel is the closed unit square
``[col, col + 1] x [row, row + 1]``; a robot touches it when the distance is smaller
than the radius, so a wall flush with the disc is no hit. Results depend only on the
position and the pixels around it, never on the extent of the raster in memory.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import BLOCKED, COVERABLE, UNKNOWN
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel


class Placement(NamedTuple):
    """Placement of lattice cells on the raster, and the robot's radius.

    The centre of cell (row, col) is at raster coordinates (x, y) =
    ``(x0 + (col + 0.5) * ux - (row + 0.5) * uy, y0 + (col + 0.5) * uy + (row + 0.5) * ux)``.
    """

    x0: float
    y0: float
    ux: float
    uy: float
    radius: float


class Thresholds(NamedTuple):
    """Occupancy values up to ``free`` are free, from ``occupied`` on occupied."""

    free: int
    occupied: int


class Pixels(NamedTuple):
    """A window of the raster; ``values[0, 0]`` is pixel (row, col). Beyond it all is unknown.

    Attributes:
        values: occupancy, int8 (height, width), -1 unknown, 0..100.
        row, col: place on the raster.
    """

    values: NDArray[np.int8]
    row: int
    col: int


class Box(NamedTuple):
    """A half-open rectangle of pixels of the raster, or of cells as indices of the arrays."""

    row0: int
    col0: int
    row1: int
    col1: int


@inlined
def state_of(value: int, thresholds: Thresholds) -> int:
    """Return the state of an occupancy value."""
    if 0 <= value <= thresholds.free:
        return COVERABLE
    return BLOCKED if value >= thresholds.occupied else UNKNOWN


@inlined
def pixel_state(pixels: Pixels, row: int, col: int, thresholds: Thresholds) -> int:
    """Return the state of a pixel of the raster, inside the window or beyond."""
    height, width = pixels.values.shape
    row, col = row - pixels.row, col - pixels.col
    if not (0 <= row < height and 0 <= col < width):
        return UNKNOWN
    return state_of(pixels.values[row, col], thresholds)


@inlined
def centre(placement: Placement, row: float, col: float) -> tuple[float, float]:
    """Return the raster coordinates (x, y) of the centre of a lattice cell."""
    up, right = row + 0.5, col + 0.5
    return (
        placement.x0 + right * placement.ux - up * placement.uy,
        placement.y0 + right * placement.uy + up * placement.ux,
    )


@lean_kernel
def reach_of(placement: Placement) -> float:
    """Return the largest distance on an axis at which a pixel affects a cell."""
    return max(abs(placement.ux), abs(placement.uy)) + placement.radius


@lean_inner_kernel
def lane_is_free(
    pixels: Pixels,
    x: float,
    y: float,
    ux: float,
    uy: float,
    radius: float,
    thresholds: Thresholds,
) -> bool:
    """Return whether the rectangle swept from (x, y) to (x + ux, y + uy) is free.

    The discs at both ends are known to be free. Pixels are tested against the
    rectangle by the separating axis theorem, which is right for any yaw.
    """
    length = np.sqrt(ux * ux + uy * uy)
    ex, ey = ux / length, uy / length
    mx, my = x + 0.5 * ux, y + 0.5 * uy
    reach_x = 0.5 * abs(ux) + radius * abs(ey)
    reach_y = 0.5 * abs(uy) + radius * abs(ex)
    half_pixel = 0.5 * (abs(ex) + abs(ey))
    for row in range(int(np.floor(my - reach_y)), int(np.floor(my + reach_y)) + 1):
        dy = row + 0.5 - my
        if abs(dy) >= reach_y + 0.5:
            continue
        for col in range(int(np.floor(mx - reach_x)), int(np.floor(mx + reach_x)) + 1):
            dx = col + 0.5 - mx
            if (
                abs(dx) >= reach_x + 0.5
                or abs(dx * ex + dy * ey) >= 0.5 * length + half_pixel
                or abs(dy * ex - dx * ey) >= radius + half_pixel
            ):
                continue
            if pixel_state(pixels, row, col, thresholds) != COVERABLE:
                return False
    return True
