"""Regions of free pixels between cuts: drawing of cuts, labels beside them, growth of labels."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.kernels.jit import kernel, lean_kernel

# Largest distance beside a cut at which the region next to it is sought [pixels].
BESIDE = 8


@lean_kernel
def draw_cuts(kinds: NDArray[np.uint8], cuts: NDArray[np.float64], longer: float) -> None:
    """Set the pixels under segments to 0, in place, so that no chain of pixels with common sides
    crosses them.

    Args:
        kinds: uint8 (rows, cols).
        cuts: row and column of both ends, float64 (n, >= 4) [pixels].
        longer: length added to a segment at each end [pixels].
    """
    rows, cols = kinds.shape
    for number in range(len(cuts)):
        row, col = cuts[number, 0], cuts[number, 1]
        down, right = cuts[number, 2] - row, cuts[number, 3] - col
        length = np.sqrt(down * down + right * right)
        if length == 0.0:
            continue
        down, right = down / length, right / length
        for step in range(int(4.0 * (length + 2.0 * longer)) + 1):
            way = 0.25 * step - longer
            at_row, at_col = int(np.floor(row + way * down)), int(np.floor(col + way * right))
            if 0 <= at_row < rows and 0 <= at_col < cols:
                kinds[at_row, at_col] = 0


@kernel
def beside_cuts(labels: NDArray[np.int32], cuts: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the labels on both sides of the middle of each cut, int32 (n, 2); 0 for none.

    Args:
        labels: int32 (rows, cols).
        cuts: see ``draw_cuts``.
    """
    rows, cols = labels.shape
    beside = np.zeros((len(cuts), 2), np.int32)
    for number in range(len(cuts)):
        row, col = (cuts[number, 0] + cuts[number, 2]) / 2, (cuts[number, 1] + cuts[number, 3]) / 2
        down, right = cuts[number, 2] - cuts[number, 0], cuts[number, 3] - cuts[number, 1]
        length = max(np.sqrt(down * down + right * right), 1e-9)
        for side in range(2):
            away = (1.0 - 2.0 * side) / length
            for way in range(1, BESIDE + 1):
                at_row = int(np.floor(row - way * away * right))
                at_col = int(np.floor(col + way * away * down))
                if 0 <= at_row < rows and 0 <= at_col < cols and labels[at_row, at_col]:
                    beside[number, side] = labels[at_row, at_col]
                    break
    return beside


@kernel
def grow(labels: NDArray[np.int32], free: NDArray[np.bool_]) -> None:
    """Give each free pixel the label of the labelled pixel that is fewest steps away, in place.

    Args:
        labels: int32 (rows, cols), 0 for none.
        free: bool (rows, cols).
    """
    rows, cols = labels.shape
    queue, count = np.empty(rows * cols, np.int32), 0
    for row in range(rows):
        for col in range(cols):
            if labels[row, col]:
                queue[count] = row * cols + col
                count += 1
    at = 0
    while at < count:
        row, col = queue[at] // cols, queue[at] % cols
        at += 1
        for side in range(4):
            there_row, there_col = row + ROW_STEP[side], col + COL_STEP[side]
            if not (0 <= there_row < rows and 0 <= there_col < cols):
                continue
            if free[there_row, there_col] and labels[there_row, there_col] == 0:
                labels[there_row, there_col] = labels[row, col]
                queue[count] = there_row * cols + there_col
                count += 1
