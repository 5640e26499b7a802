"""Shortest walks over a lattice: what can be reached, and the way there."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.directions import COL_STEP, ROW_STEP
from fasaco_edge.kernels.jit import kernel

UNSEEN = 255
ROOT = 254


@kernel
def _spread(
    steps: NDArray[np.uint8], row: int, col: int, came_from: NDArray[np.uint8], goal: int
) -> int:
    """Search breadth first from (row, col) until flat cell ``goal``; return how many were seen.

    ``came_from`` (rows, cols), all UNSEEN, receives the direction of the step by
    which each cell was first reached.
    """
    cols = steps.shape[1]
    queue = np.empty(steps.size, np.int32)
    queue[0] = row * cols + col
    came_from[row, col] = ROOT
    head, tail = 0, 1
    while head < tail and queue[head] != goal:
        here_row, here_col = queue[head] // cols, queue[head] % cols
        head += 1
        for direction in range(4):
            if not steps[here_row, here_col] >> direction & 1:
                continue
            next_row, next_col = here_row + ROW_STEP[direction], here_col + COL_STEP[direction]
            if came_from[next_row, next_col] == UNSEEN:
                came_from[next_row, next_col] = direction
                queue[tail] = next_row * cols + next_col
                tail += 1
    return tail


@kernel
def reachable_from(steps: NDArray[np.uint8], row: int, col: int) -> NDArray[np.uint8]:
    """Return uint8 (rows, cols), 1 where a walk from (row, col) can come."""
    came_from = np.full(steps.shape, UNSEEN, np.uint8)
    _spread(steps, row, col, came_from, -1)
    reached: NDArray[np.uint8] = (came_from != UNSEEN).astype(np.uint8)
    return reached


@kernel
def shortest_walk(
    steps: NDArray[np.uint8], start: tuple[int, int], goal: tuple[int, int]
) -> NDArray[np.int32]:
    """Return a shortest walk from start to goal, int32 (n, 2); empty where there is none.

    Args:
        steps: step masks, uint8 (rows, cols).
        start, goal: cells (row, col) inside the array.
    """
    came_from = np.full(steps.shape, UNSEEN, np.uint8)
    _spread(steps, start[0], start[1], came_from, goal[0] * steps.shape[1] + goal[1])
    if came_from[goal[0], goal[1]] == UNSEEN:
        return np.empty((0, 2), np.int32)
    length = 1
    row, col = goal
    while came_from[row, col] != ROOT:
        direction = came_from[row, col]
        row, col = row - ROW_STEP[direction], col - COL_STEP[direction]
        length += 1
    walk = np.empty((length, 2), np.int32)
    row, col = goal
    for index in range(length - 1, 0, -1):
        walk[index, 0], walk[index, 1] = row, col
        direction = came_from[row, col]
        row, col = row - ROW_STEP[direction], col - COL_STEP[direction]
    walk[0, 0], walk[0, 1] = row, col
    return walk
