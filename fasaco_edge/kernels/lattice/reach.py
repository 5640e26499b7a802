"""Shortest walks over a lattice: what can be reached, and the way there.

What can be reached after some cells have changed, at the cost of these.

Steps have changed in a part of the lattice alone. If inside this part the cells at its
rim - those with a step across it - hang together as they did before, then outside all
hangs together as it did before: any walk can be led around. So it is enough to look at
the part, and at whose rim the old reach came to. Only where the rim has come apart or
together elsewhere must the whole be searched.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.cells import COL_STEP, ROW_STEP
from fasaco_edge.kernels.jit import kernel, lean_kernel

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


# The part reaches so many cells beyond those that changed, so that what came to stand
# in the open does not part its rim.
MARGIN = 2


class _Part(NamedTuple):
    """A part of the lattice in the rectangle from its cell (row, col) on.

    Attributes:
        inside: bool (rows, cols), the rectangle's cells that belong to it.
        labels: int32 (rows, cols), number of the connected piece of each of them, from 1.
        queue: int32 (rows * cols,).
        row, col: place of the rectangle.
    """

    inside: NDArray[np.bool_]
    labels: NDArray[np.int32]
    queue: NDArray[np.int32]
    row: int
    col: int


@lean_kernel
def _holds(part: _Part, row: int, col: int) -> bool:
    """Tell whether a cell of the lattice belongs to the part."""
    rows, cols = part.inside.shape
    row, col = row - part.row, col - part.col
    return bool(0 <= row < rows and 0 <= col < cols and part.inside[row, col])


@lean_kernel
def _label(steps: NDArray[np.uint8], part: _Part) -> int:
    """Number the connected pieces of a part; return how many there are."""
    rows, cols = part.inside.shape
    pieces = 0
    for source in range(rows * cols):
        if (
            not part.inside[source // cols, source % cols]
            or part.labels[source // cols, source % cols]
        ):
            continue
        pieces += 1
        part.labels[source // cols, source % cols] = pieces
        part.queue[0] = source
        head, tail = 0, 1
        while head < tail:
            row, col = part.queue[head] // cols, part.queue[head] % cols
            head += 1
            for direction in range(4):
                if not steps[part.row + row, part.col + col] >> direction & 1:
                    continue
                far_row, far_col = row + ROW_STEP[direction], col + COL_STEP[direction]
                if not _holds(part, part.row + far_row, part.col + far_col):
                    continue
                if not part.labels[far_row, far_col]:
                    part.labels[far_row, far_col] = pieces
                    part.queue[tail] = far_row * cols + far_col
                    tail += 1
    return pieces


@lean_kernel
def _is_rim(steps: NDArray[np.uint8], part: _Part, row: int, col: int) -> bool:
    """Tell whether a step leads out of the part from a cell of its rectangle."""
    row, col = part.row + row, part.col + col
    for direction in range(4):
        if steps[row, col] >> direction & 1 and not _holds(
            part, row + ROW_STEP[direction], col + COL_STEP[direction]
        ):
            return True
    return False


@lean_kernel
def _match(
    steps: NDArray[np.uint8],
    old: _Part,
    new: _Part,
    reachable: NDArray[np.bool_],
    to_new: NDArray[np.int32],
    to_old: NDArray[np.int32],
    reached: NDArray[np.bool_],
) -> bool:
    """Match old and new pieces by the cells at the rim; tell whether that is one to one.

    ``reached`` receives whether the rim of a new piece was reachable.
    """
    rows, cols = new.inside.shape
    for row in range(rows):
        for col in range(cols):
            if not new.inside[row, col] or not _is_rim(steps, new, row, col):
                continue
            was, now = old.labels[row, col], new.labels[row, col]
            if (to_new[was] and to_new[was] != now) or (to_old[now] and to_old[now] != was):
                return False
            to_new[was], to_old[now] = now, was
            reached[now] = reachable[new.row + row, new.col + col]
    return True


@kernel
def update_reach(
    before: NDArray[np.uint8],
    after: NDArray[np.uint8],
    changed: NDArray[np.int32],
    reachable: NDArray[np.bool_],
    row: int,
    col: int,
) -> bool:
    """Correct what can be reached after steps have changed; tell whether that was possible.

    Where it was not, nothing was written, and ``walks.reachable_from`` has the answer.

    Args:
        before, after: step masks, uint8 (rows, cols).
        changed: int32 (n, 2), n > 0: all cells (row, col) whose steps differ.
        reachable: in and out, bool (rows, cols): what could be reached, and can be now.
        row, col: a cell from where.
    """
    rows, cols = after.shape
    top, left, bottom, right = rows, cols, 0, 0
    for index in range(len(changed)):
        top, bottom = min(top, changed[index, 0]), max(bottom, changed[index, 0])
        left, right = min(left, changed[index, 1]), max(right, changed[index, 1])
    top, left = max(top - MARGIN, 0), max(left - MARGIN, 0)
    bottom, right = min(bottom + MARGIN + 1, rows), min(right + MARGIN + 1, cols)
    shape = bottom - top, right - left
    inside = np.zeros(shape, np.bool_)
    for index in range(len(changed)):
        here_row, here_col = changed[index, 0] - top, changed[index, 1] - left
        inside[
            max(here_row - MARGIN, 0) : here_row + MARGIN + 1,
            max(here_col - MARGIN, 0) : here_col + MARGIN + 1,
        ] = True
    queue = np.empty(shape[0] * shape[1], np.int32)
    old = _Part(inside, np.zeros(shape, np.int32), queue, top, left)
    new = _Part(inside, np.zeros(shape, np.int32), queue, top, left)
    old_pieces, new_pieces = _label(before, old), _label(after, new)
    to_new = np.zeros(old_pieces + 1, np.int32)
    to_old = np.zeros(new_pieces + 1, np.int32)
    reached = np.zeros(new_pieces + 1, np.bool_)
    if not _match(after, old, new, reachable, to_new, to_old, reached):
        return False
    # Where from is a place that could be reached, or one in a piece whose rim could be.
    from_inside = _holds(new, row, col)
    if from_inside and not reached[new.labels[row - top, col - left]]:
        return False
    if not from_inside and not reachable[row, col]:
        return False
    for part_row in range(shape[0]):
        for part_col in range(shape[1]):
            if inside[part_row, part_col]:
                is_reached = reached[new.labels[part_row, part_col]]
                reachable[top + part_row, left + part_col] = is_reached
    return True
