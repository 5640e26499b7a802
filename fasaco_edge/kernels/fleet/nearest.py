"""Nearest-neighbour walks, each over one robot's part of the cells: they estimate its time there.

A robot drives straight on while the cell ahead is its own and unswept; else it drives to its
nearest unswept cell. All numbers are integers, so that results are equal on all machines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, kernel, lean_inner_kernel

NONE = -1


class _Ground(NamedTuple):
    """The cells, and working memory of the search for the nearest cell.

    Attributes:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        owner: int64 (size,), the robot that has to sweep each cell; NONE for a swept cell.
        seen: int32 (size,), number of the last search that found the cell.
        came: uint8 (size,), direction of the step to the cell in that search.
        queue: int32 (size,).
    """

    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    owner: NDArray[np.int64]
    seen: NDArray[np.int32]
    came: NDArray[np.uint8]
    queue: NDArray[np.int32]


@lean_inner_kernel
def _quarters(before: int, after: int) -> int:
    """Return the quarter-turns between two directions; 0 if either is NONE."""
    turn = (after - before) & 3
    return min(turn, 4 - turn) if min(before, after) > NONE else 0


@lean_inner_kernel
def _nearest(ground: _Ground, robot: int, here: int, clock: int) -> int:
    """Return the robot's cell nearest to cell ``here``, NONE for none; ``came`` leads there."""
    steps, offsets, owner, seen, came, queue = ground
    queue[0], seen[here] = here, clock
    at, end = 0, 1
    while at < end:
        cell = queue[at]
        at += 1
        for direction in range(4):
            beside = cell + offsets[direction]
            if steps[cell] >> direction & 1 and seen[beside] != clock:
                seen[beside], came[beside] = clock, direction
                if owner[beside] == robot:
                    return int(beside)
                queue[end] = beside
                end += 1
    return NONE


@lean_inner_kernel
def _walk(ground: _Ground, robot: int, here: int, count: int, clock: int) -> tuple[int, int, int]:
    """Walk over all ``count`` cells of a robot; return steps, quarter-turns and the clock."""
    steps, offsets, owner = ground.steps, ground.offsets, ground.owner
    length, quarters, heading = 0, 0, NONE
    while count:
        if owner[here] == robot:
            owner[here] = NONE
            count -= 1
            continue
        if heading != NONE and steps[here] >> heading & 1:
            ahead = here + offsets[heading]
            if owner[ahead] == robot:
                here, length = ahead, length + 1
                continue
        clock += 1
        found = _nearest(ground, robot, here, clock)
        if found == NONE:
            return length + count, quarters, clock
        # Follow the way from its end to its beginning.
        cell, after = found, NONE
        while cell != here:
            direction = int(ground.came[cell])
            quarters += _quarters(direction, after)
            length, after = length + 1, direction
            cell -= offsets[direction]
        quarters += _quarters(heading, after)
        here, heading = found, int(ground.came[found])
    return length, quarters, clock


@kernel
def walk_parts(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    cells: NDArray[np.int64],
    owners: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return the steps and quarter-turns of each robot's walk.

    Args:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        cells: flat cells to sweep, int64 (n,).
        owners: the robot of each cell, int64 (n,).
        starts: flat cell of each robot, int64 (k,).

    Returns:
        int64 (k, 2): steps and quarter-turns of each robot; a cell that it cannot reach counts as a
        step.
    """
    size = steps.size
    ground = _Ground(
        steps,
        offsets,
        np.full(size, NONE, np.int64),
        np.zeros(size, np.int32),
        np.empty(size, np.uint8),
        np.empty(size, np.int32),
    )
    counts = np.zeros(starts.size, np.int64)
    for index in range(cells.size):
        ground.owner[cells[index]] = owners[index]
        counts[owners[index]] += 1
    walks, clock = np.empty((starts.size, 2), np.int64), as_value(0)
    for robot in range(starts.size):
        length, quarters, clock = _walk(ground, robot, starts[robot], counts[robot], clock)
        walks[robot, 0], walks[robot, 1] = length, quarters
    return walks
