"""Rays of a noisy scanner: their ranges, and the pixels that they pass; see ``lattice.raycast``."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import numba
from fasaco_edge.kernels.lattice.raycast import Scanner

# Kept beside this file, as the folder of kernels is for those of the package.
compiled = numba.njit(cache=True, nogil=True)


@compiled
def _range_of(
    truth: NDArray[np.int8],
    thin: NDArray[np.bool_],
    scanner: Scanner,
    direction: NDArray[np.float64],
    goes_by: bool,
) -> float:
    rows, cols = truth.shape
    x, y, reach, free_at_most = scanner
    dx, dy = direction
    row, col = int(np.floor(y)), int(np.floor(x))
    row_step, col_step = (1 if dy > 0.0 else -1), (1 if dx > 0.0 else -1)
    next_row, next_col = row + (dy > 0.0), col + (dx > 0.0)
    way = 0.0
    while 0 <= row < rows and 0 <= col < cols:
        if truth[row, col] < 0:
            return -way
        if truth[row, col] > free_at_most and not (goes_by and thin[row, col]):
            return way
        to_row = (next_row - y) / dy if dy != 0.0 else np.inf
        to_col = (next_col - x) / dx if dx != 0.0 else np.inf
        way = min(to_row, to_col)
        if way > reach:
            return -reach
        if to_col < to_row:
            col += col_step
            next_col += col_step
        else:
            row += row_step
            next_row += row_step
    return -way


@compiled
def ranges_of(
    truth: NDArray[np.int8],
    thin: NDArray[np.bool_],
    scanner: Scanner,
    directions: NDArray[np.float64],
    goes_by: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the ranges of the rays of a scanner, float64 (n,) [pixels].

    A ray that nothing stops within reach, that meets an unknown pixel or leaves the array has no
    return: its length is negative.

    Args:
        truth: occupancy, int8 (rows, cols), -1 unknown, 0..100.
        thin: bool (rows, cols), pixels that hold something so thin that rays may go by.
        scanner: its place and range.
        directions: unit vectors (dx, dy) of the rays, float64 (n, 2).
        goes_by: bool (n,), rays that go by what is thin.
    """
    ways = np.empty(len(directions))
    for ray in range(len(directions)):
        ways[ray] = _range_of(truth, thin, scanner, directions[ray], goes_by[ray])
    return ways


@compiled
def count_rays(
    hits: NDArray[np.int32],
    passes: NDArray[np.int32],
    begin: tuple[float, float],
    ends: NDArray[np.float64],
    is_hit: NDArray[np.bool_],
    times: int,
) -> tuple[int, int, int, int]:
    """Count the pixels that rays pass, their ends included, and those that they end at.

    Args:
        hits, passes: in and out, int32 (rows, cols).
        begin: x, y of the scanner, pixel coordinates (column, row), not rounded.
        ends: x, y of the rays' ends, float64 (n, 2).
        is_hit: bool (n,), rays that end at something.
        times: what is added to the counts; -1 takes a scan out again.

    Returns:
        row0, col0, row1, col1 of a half-open window around the pixels counted; row0 > row1 for
        none.
    """
    rows, cols = hits.shape
    x, y = begin
    changed = np.array([rows, cols, -1, -1], np.int64)
    for ray in range(len(ends)):
        dx, dy = ends[ray, 0] - x, ends[ray, 1] - y
        row, col = int(np.floor(y)), int(np.floor(x))
        last_row, last_col = int(np.floor(ends[ray, 1])), int(np.floor(ends[ray, 0]))
        row_step, col_step = (1 if dy > 0.0 else -1), (1 if dx > 0.0 else -1)
        next_row, next_col = row + (dy > 0.0), col + (dx > 0.0)
        for _ in range(abs(last_row - row) + abs(last_col - col) + 1):
            if not (0 <= row < rows and 0 <= col < cols):
                break
            passes[row, col] += times
            if is_hit[ray] and row == last_row and col == last_col:
                hits[row, col] += times
            changed[0], changed[1] = min(changed[0], row), min(changed[1], col)
            changed[2], changed[3] = max(changed[2], row + 1), max(changed[3], col + 1)
            to_row = (next_row - y) / dy if dy != 0.0 else np.inf
            to_col = (next_col - x) / dx if dx != 0.0 else np.inf
            # Rounding must not lead a ray past its end.
            if row == last_row or (col != last_col and to_col < to_row):
                col += col_step
                next_col += col_step
            else:
                row += row_step
                next_row += row_step
    return changed[0], changed[1], changed[2], changed[3]
