"""Driven floor: what lies under the tool's way is no longer to be swept."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import (
    BLOCK,
    NEVER,
    Scratch,
    Sweeps,
    prepare,
    rows_of,
    stretches_of,
)
from fasaco_edge.kernels.jit import lean_kernel

# A pixel is asked for; it is still to be swept; the robot drove over it.
WANTED, OPEN, DRIVEN = 1, 2, 4


@lean_kernel
def note_driven(
    sweeps: Sweeps,
    state: NDArray[np.uint8],
    points: NDArray[np.float64],
    radius: float,
    scratch: Scratch,
) -> int:
    """Note that the robot has driven a line; return how many pixels that closes.

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
