"""Open floor: floor still to sweep; floor the robot has driven over is removed from it."""

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
from fasaco_edge.kernels.jit import lean_kernel

# A pixel is wanted; it is still to sweep; the robot has driven over it.
WANTED, OPEN, DRIVEN = 1, 2, 4
# Position in a pixel's state of the cause why it is out of reach.
CAUSE_SHIFT, CAUSE = 3, 24


@lean_kernel
def note_driven(
    sweeps: Sweeps,
    state: NDArray[np.uint8],
    points: NDArray[np.float64],
    radius: float,
    scratch: Scratch,
) -> int:
    """Note that the robot has driven a line; return the number of pixels closed by it.

    Args:
        sweeps: whose counts go up by ``NEVER`` where a pixel is no longer open.
        state: uint8 (rows, cols) of ``WANTED``, ``OPEN`` and ``DRIVEN``, changed.
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
                state[i, j] = (before | DRIVEN) & (255 - OPEN)
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
) -> tuple[int, int]:
    """Set the open pixels in a part of the raster: wanted, and neither swept nor driven.

    Args:
        sweeps: their counts are higher by ``NEVER`` where a pixel is not open.
        state: uint8 (rows, cols) of ``WANTED``, ``OPEN`` and ``DRIVEN``, changed.
        corner: first pixel (row, col) of the part.
        wanted: bool (rows, cols) of the part, wanted pixels; empty for no change.
        swept: bool (rows, cols) of the part.

        Returns:
            Increase in the number of wanted and of open pixels.
    """
    counts, left = sweeps.counts, sweeps.left
    more_wanted, more_open = 0, 0
    for i in range(swept.shape[0]):
        for j in range(swept.shape[1]):
            row, col = corner[0] + i, corner[1] + j
            before = state[row, col]
            after = before & (255 - OPEN)
            if len(wanted):
                after = (after & (255 - WANTED)) | (WANTED * wanted[i, j])
            if after & (WANTED | DRIVEN) == WANTED and not swept[i, j]:
                after |= OPEN
            if after == before:
                continue
            state[row, col] = after
            more_wanted += (after & WANTED) - (before & WANTED)
            if after & OPEN and not before & OPEN:
                more_open += 1
                counts[row, col] -= NEVER
                left[row >> BLOCK, col >> BLOCK] += counts[row, col] == 0
            elif before & OPEN and not after & OPEN:
                more_open -= 1
                left[row >> BLOCK, col >> BLOCK] -= counts[row, col] == 0
                counts[row, col] += NEVER
    return more_wanted, more_open


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
