"""Ray casting of a laser scanner in a ground-truth map, and in its own; pixels under a disc.

Rays follow J. Amanatides and A. Woo, "A fast voxel traversal algorithm for
ray tracing", Eurographics 1987: every pixel a ray passes is visited, in order,
each entered through a side. A ray therefore never slips between two pixels of
a wall that touch only by a corner. Deviation: the crossings are computed from
the pixel borders instead of summed up, so no rounding error builds up.

All lengths are in pixels; pixel (row, col) is the square
``[col, col + 1) x [row, row + 1)``. A disc touches a pixel when the distance is
smaller than the radius, as in ``footprint``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inner_kernel, kernel


class Scanner(NamedTuple):
    """Place and range of a scanner.

    Attributes:
        x, y: its place, pixel coordinates (column, row), not rounded.
        reach: pixels entered at this distance or nearer are seen [pixels].
        free_at_most: occupancy values 0..free_at_most let a ray through [percent].
    """

    x: float
    y: float
    reach: float
    free_at_most: int


@inner_kernel
def _reveal(
    truth: NDArray[np.int8],
    known: NDArray[np.int8],
    row: int,
    col: int,
    changed: NDArray[np.int64],
) -> None:
    """Copy a pixel from truth to known; widen ``changed`` (row0, col0, row1, col1) by it."""
    if known[row, col] != truth[row, col]:
        known[row, col] = truth[row, col]
        changed[0], changed[1] = min(changed[0], row), min(changed[1], col)
        changed[2], changed[3] = max(changed[2], row + 1), max(changed[3], col + 1)


@inner_kernel
def _cast_ray(
    truth: NDArray[np.int8],
    known: NDArray[np.int8],
    scanner: Scanner,
    direction: NDArray[np.float64],
    changed: NDArray[np.int64],
) -> None:
    rows, cols = truth.shape
    x, y, reach, free_at_most = scanner
    dx, dy = direction
    row, col = int(np.floor(y)), int(np.floor(x))
    row_step, col_step = (1 if dy > 0.0 else -1), (1 if dx > 0.0 else -1)
    # The next border on each axis: the far side of the pixel in the ray's sense.
    next_row, next_col = row + (dy > 0.0), col + (dx > 0.0)
    while 0 <= row < rows and 0 <= col < cols:
        _reveal(truth, known, row, col, changed)
        if not 0 <= truth[row, col] <= free_at_most:
            return
        to_row = (next_row - y) / dy if dy != 0.0 else np.inf
        to_col = (next_col - x) / dx if dx != 0.0 else np.inf
        if min(to_row, to_col) > reach:
            return
        if to_col < to_row:
            col += col_step
            next_col += col_step
        else:
            row += row_step
            next_row += row_step


@kernel
def cast_rays(
    truth: NDArray[np.int8],
    known: NDArray[np.int8],
    scanner: Scanner,
    directions: NDArray[np.float64],
) -> tuple[int, int, int, int]:
    """Copy the pixels seen by the rays of a scanner from ``truth`` to ``known``.

    A ray sees the free pixels it passes and the first pixel that is not free,
    at which it stops; unknown pixels stop it too, and stay unknown. It ends
    where the array ends.

    Args:
        truth: occupancy, int8 (rows, cols), -1 unknown, 0..100.
        known: in and out, int8 (rows, cols): the scanner's own map.
        scanner: its place and range.
        directions: unit vectors (dx, dy) of the rays, float64 (n, 2).

    Returns:
        row0, col0, row1, col1 of the smallest half-open window around the pixels of
        ``known`` that changed; row0 > row1 if none did.
    """
    changed = np.array([truth.shape[0], truth.shape[1], -1, -1], np.int64)
    for ray in range(len(directions)):
        _cast_ray(truth, known, scanner, directions[ray], changed)
    return changed[0], changed[1], changed[2], changed[3]


@inner_kernel
def _touches(x: float, y: float, radius: float, row: int, col: int) -> bool:
    dx, dy = max(col - x, 0.0, x - col - 1), max(row - y, 0.0, y - row - 1)
    return bool(dx * dx + dy * dy < radius * radius)


@kernel
def reveal_disc(
    truth: NDArray[np.int8], known: NDArray[np.int8], x: float, y: float, radius: float
) -> tuple[int, int, int, int]:
    """Copy from ``truth`` to ``known`` the pixels a disc touches; return as ``cast_rays`` does.

    Args:
        truth: occupancy, int8 (rows, cols).
        known: in and out, int8 (rows, cols).
        x, y: the disc's centre, pixel coordinates (column, row), not rounded.
        radius: its radius [pixels].
    """
    rows, cols = truth.shape
    changed = np.array([rows, cols, -1, -1], np.int64)
    for row in range(max(int(np.floor(y - radius)), 0), min(int(np.floor(y + radius)) + 1, rows)):
        for col in range(
            max(int(np.floor(x - radius)), 0), min(int(np.floor(x + radius)) + 1, cols)
        ):
            if _touches(x, y, radius, row, col):
                _reveal(truth, known, row, col, changed)
    return changed[0], changed[1], changed[2], changed[3]


@kernel
def disc_is_free(
    cells: NDArray[np.int8], x: float, y: float, radius: float, free_at_most: int
) -> bool:
    """Return whether every pixel a disc touches lies in the array and is free.

    Args:
        cells: occupancy, int8 (rows, cols), -1 unknown, 0..100.
        x, y: the disc's centre, pixel coordinates (column, row), not rounded.
        radius: its radius [pixels].
        free_at_most: values 0..free_at_most are free [percent].
    """
    rows, cols = cells.shape
    for row in range(int(np.floor(y - radius)), int(np.floor(y + radius)) + 1):
        for col in range(int(np.floor(x - radius)), int(np.floor(x + radius)) + 1):
            if not _touches(x, y, radius, row, col):
                continue
            if not (0 <= row < rows and 0 <= col < cols):
                return False
            if not 0 <= cells[row, col] <= free_at_most:
                return False
    return True
