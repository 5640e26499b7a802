"""Open floor: floor still to sweep, on the raster that the line is planned on."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.sweeps import (
    BLOCK,
    NEVER,
    Scratch,
    Sweeps,
    prepare,
    rows_of,
    stretches_of,
)
from fasaco_edge.kernels.jit import inlined, lean_kernel

# Bits of a pixel's state: it is wanted; the line is to sweep it; it is swept.
WANTED, OPEN, SWEPT = 1, 2, 4
# The line has passed the pixel, whether or not the robot swept it: this line does not go back.
PASSED = 32
# The cause why a pixel is out of reach: its first bit in the pixel's state, and its mask.
CAUSE_SHIFT, CAUSE = 3, 24


@inlined
def _is_bare(state: NDArray[np.uint8], row: int, col: int) -> bool:
    """Return whether the 2 by 2 pixels from (row, col) on are all wanted and not swept."""
    if row < 0 or col < 0 or row + 1 >= state.shape[0] or col + 1 >= state.shape[1]:
        return False
    both = WANTED | SWEPT
    is_bare: bool = (
        state[row, col] & both == WANTED
        and state[row, col + 1] & both == WANTED
        and state[row + 1, col] & both == WANTED
        and state[row + 1, col + 1] & both == WANTED
    )
    return is_bare


@lean_kernel
def pass_line(
    sweeps: Sweeps,
    state: NDArray[np.uint8],
    points: NDArray[np.float64],
    radius: float,
    scratch: Scratch,
) -> int:
    """Note that the robot has passed a part of its line; return the number of pixels closed by it.

    Args:
        sweeps: counts of sweeps; they go up by ``NEVER`` where a pixel is no longer open.
        state: uint8 (rows, cols) of ``WANTED``, ``OPEN``, ``SWEPT`` and ``PASSED``, changed.
        points: float64 (n, 2): y, x [pixels].
        radius: of the tool [pixels].
        scratch: memory for a capsule.
    """
    rows, cols = state.shape
    counts, left, stretches = sweeps.counts, sweeps.left, scratch.before
    closed = 0
    for number in range(len(points) - 1):
        a, b = points[number], points[number + 1]
        prepare(scratch.capsules, 0, a[0], a[1], b[0], b[1], radius)
        first, last = rows_of(scratch, 1, radius, rows)
        for i in range(first, last + 1):
            if not stretches_of(scratch, i, cols, 1, 0, radius)[0]:
                continue
            for j in range(stretches[0, 0], stretches[0, 1] + 1):
                before = state[i, j]
                state[i, j] = (before | PASSED) & (255 - OPEN)
                if before & OPEN:
                    closed += 1
                    left[i >> BLOCK, j >> BLOCK] -= counts[i, j] == 0
                    counts[i, j] += NEVER
    return closed


@lean_kernel
def set_open(
    sweeps: Sweeps,
    state: NDArray[np.uint8],
    corner: tuple[int, int],
    wanted: NDArray[np.bool_],
    swept: NDArray[np.bool_],
) -> tuple[int, int, int]:
    """Set the wanted, swept and open pixels of a part of the raster.

    The same sweep on two rasters differs along its rim by less than a pixel. So a wanted unswept
    pixel is open only if it belongs to a square of two by two wanted unswept pixels, and the line
    has not passed it.

    Args:
        sweeps: counts of sweeps, higher by ``NEVER`` where a pixel is not open.
        state: uint8 (rows, cols) of ``WANTED``, ``OPEN``, ``SWEPT`` and ``PASSED``, changed.
        corner: first pixel (row, col) of the part.
        wanted: bool (rows, cols) of the part, wanted pixels; empty for no change.
        swept: bool (rows, cols) of the part.

    Returns:
        Increases in the numbers of wanted pixels, of swept wanted pixels, and of open pixels.
    """
    counts, left = sweeps.counts, sweeps.left
    more_wanted, more_swept, more_open = 0, 0, 0
    both = WANTED | SWEPT
    for i in range(swept.shape[0]):
        for j in range(swept.shape[1]):
            row, col = corner[0] + i, corner[1] + j
            before = state[row, col]
            after = (before & (255 - SWEPT)) | (SWEPT * swept[i, j])
            if len(wanted):
                after = (after & (255 - WANTED)) | (WANTED * wanted[i, j])
            if after != before:
                state[row, col] = after
                more_wanted += (after & WANTED) - (before & WANTED)
                more_swept += (after & both == both) - (before & both == both)
    # Pixels beside the part may open or close with it.
    first_row, first_col = max(corner[0] - 1, 0), max(corner[1] - 1, 0)
    last_row = min(corner[0] + swept.shape[0], state.shape[0] - 1)
    last_col = min(corner[1] + swept.shape[1], state.shape[1] - 1)
    for row in range(first_row, last_row + 1):
        for col in range(first_col, last_col + 1):
            before = state[row, col]
            is_open = before & (both | PASSED) == WANTED and (
                _is_bare(state, row, col)
                or _is_bare(state, row, col - 1)
                or _is_bare(state, row - 1, col)
                or _is_bare(state, row - 1, col - 1)
            )
            if is_open and not before & OPEN:
                state[row, col] = before | OPEN
                more_open += 1
                counts[row, col] -= NEVER
                left[row >> BLOCK, col >> BLOCK] += counts[row, col] == 0
            elif before & OPEN and not is_open:
                state[row, col] = before & (255 - OPEN)
                more_open -= 1
                left[row >> BLOCK, col >> BLOCK] -= counts[row, col] == 0
                counts[row, col] += NEVER
    return more_wanted, more_swept, more_open


@lean_kernel
def set_causes(
    state: NDArray[np.uint8],
    corner: tuple[int, int],
    causes: NDArray[np.uint8],
    pixels: NDArray[np.int64],
) -> None:
    """Set why pixels of a part of the raster are out of reach.

    Args:
        state: uint8 (rows, cols), changed: causes lie from bit ``CAUSE_SHIFT`` on.
        corner: first pixel (row, col) of the part.
        causes: uint8 (rows, cols) of the part.
        pixels: int64 (4,), number of pixels with each cause, changed; reachable pixels have 0.
    """
    for i in range(causes.shape[0]):
        for j in range(causes.shape[1]):
            row, col = corner[0] + i, corner[1] + j
            before, after = (state[row, col] & CAUSE) >> CAUSE_SHIFT, causes[i, j]
            if before != after:
                state[row, col] = (state[row, col] & (255 - CAUSE)) | (after << CAUSE_SHIFT)
                pixels[before] -= 1
                pixels[after] += 1
