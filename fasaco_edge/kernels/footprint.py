"""Where the robot's disc fits, and between which neighbouring cells it can drive.

All lengths are in pixels of the occupancy grid. A pixel is the closed unit
square ``[col, col + 1] x [row, row + 1]``; a robot touches it when the
distance is smaller than the radius, so a wall flush with the disc is no hit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.directions import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.jit import kernel
from fasaco_edge.kernels.states import BLOCKED, COVERABLE, UNKNOWN


class Placement(NamedTuple):
    """Where lattice cells lie on the pixel grid, and how large the robot is.

    The centre of cell (row, col) is at pixel coordinates
    ``(x0 + col * ux - row * uy, y0 + col * uy + row * ux)``.
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


@kernel
def _pixel_state(value: int, thresholds: Thresholds) -> int:
    if 0 <= value <= thresholds.free:
        return COVERABLE
    return BLOCKED if value >= thresholds.occupied else UNKNOWN


@kernel
def _disc_state(
    cells: NDArray[np.int8], x: float, y: float, radius: float, thresholds: Thresholds
) -> int:
    """Return the worst state under a disc: blocked before unknown before free."""
    state = COVERABLE
    height, width = cells.shape
    for row in range(int(np.floor(y - radius)), int(np.floor(y + radius)) + 1):
        dy = max(row - y, 0.0, y - row - 1)
        for col in range(int(np.floor(x - radius)), int(np.floor(x + radius)) + 1):
            dx = max(col - x, 0.0, x - col - 1)
            if dx * dx + dy * dy >= radius * radius:
                continue
            if 0 <= row < height and 0 <= col < width:
                pixel = _pixel_state(cells[row, col], thresholds)
                if pixel == BLOCKED:
                    return BLOCKED
            else:
                pixel = UNKNOWN
            if pixel == UNKNOWN:
                state = UNKNOWN
    return state


@kernel
def _lane_is_free(
    cells: NDArray[np.int8],
    x: float,
    y: float,
    ux: float,
    uy: float,
    radius: float,
    thresholds: Thresholds,
) -> bool:
    """Tell whether the rectangle swept from (x, y) to (x + ux, y + uy) is free.

    The discs at both ends are known to be free. Pixels are tested against the
    rectangle by the separating axis theorem, so any yaw of the grid is right.
    """
    height, width = cells.shape
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
            if not (0 <= row < height and 0 <= col < width):
                return False
            if _pixel_state(cells[row, col], thresholds) != COVERABLE:
                return False
    return True


@kernel
def _count_not_free(cells: NDArray[np.int8], thresholds: Thresholds) -> NDArray[np.int32]:
    """Return the summed-area table of pixels that are not free, (height + 1, width + 1)."""
    height, width = cells.shape
    table = np.zeros((height + 1, width + 1), np.int32)
    for row in range(height):
        running = 0
        for col in range(width):
            value = cells[row, col]
            running += not 0 <= value <= thresholds.free
            table[row + 1, col + 1] = table[row, col + 1] + running
    return table


@kernel
def _box_is_free(
    table: NDArray[np.int32], x: float, y: float, reach_x: float, reach_y: float
) -> bool:
    """Tell whether all pixels within the given reaches of (x, y) exist and are free."""
    row0, row1 = int(np.floor(y - reach_y)), int(np.floor(y + reach_y)) + 1
    col0, col1 = int(np.floor(x - reach_x)), int(np.floor(x + reach_x)) + 1
    if row0 < 0 or col0 < 0 or row1 >= table.shape[0] or col1 >= table.shape[1]:
        return False
    inside = table[row1, col1] - table[row0, col1] - table[row1, col0] + table[row0, col0]
    return bool(inside == 0)


@kernel
def classify_cells(
    cells: NDArray[np.int8],
    placement: Placement,
    thresholds: Thresholds,
    states: NDArray[np.uint8],
    steps: NDArray[np.uint8],
) -> None:
    """Fill ``states`` and the step masks ``steps`` of a coverage lattice.

    Args:
        cells: occupancy, int8 (height, width), -1 unknown, 0..100.
        placement: where the lattice cells lie; the radius is above 0.
        thresholds: what counts as free and as occupied.
        states: out, uint8 (rows, cols): UNKNOWN, BLOCKED or COVERABLE.
        steps: out, uint8 (rows, cols): bit ``1 << direction`` for each legal step.
    """
    rows, cols = states.shape
    ux, uy, radius = placement.ux, placement.uy, placement.radius
    # Most of a building is open floor: one look at the summed-area table spares
    # the look at each pixel.
    table = _count_not_free(cells, thresholds)
    for row in range(rows):
        for col in range(cols):
            x = placement.x0 + col * ux - row * uy
            y = placement.y0 + col * uy + row * ux
            if _box_is_free(table, x, y, radius, radius):
                states[row, col] = COVERABLE
            else:
                states[row, col] = _disc_state(cells, x, y, radius, thresholds)
            steps[row, col] = 0
    along, across = 0.5 * abs(ux) + radius, 0.5 * abs(uy) + radius
    for row in range(rows):
        for col in range(cols):
            if states[row, col] != COVERABLE:
                continue
            x = placement.x0 + col * ux - row * uy
            y = placement.y0 + col * uy + row * ux
            if col + 1 < cols and states[row, col + 1] == COVERABLE:
                open_floor = _box_is_free(table, x + 0.5 * ux, y + 0.5 * uy, along, across)
                if open_floor or _lane_is_free(cells, x, y, ux, uy, radius, thresholds):
                    steps[row, col] |= 1 << EAST
                    steps[row, col + 1] |= 1 << WEST
            if row + 1 < rows and states[row + 1, col] == COVERABLE:
                open_floor = _box_is_free(table, x - 0.5 * uy, y + 0.5 * ux, across, along)
                if open_floor or _lane_is_free(cells, x, y, -uy, ux, radius, thresholds):
                    steps[row, col] |= 1 << NORTH
                    steps[row + 1, col] |= 1 << SOUTH
