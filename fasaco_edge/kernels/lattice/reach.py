"""Reachability over a lattice and its update after a change; shortest walks, and costs of walks.

After some cells have changed, the update searches only the part of the lattice whose steps may have
changed. If the cells at its rim - those with a step across it - are connected inside the part as
before, then connectivity outside the part is unchanged: any walk can be rerouted. So it is enough
to search the part, and to know which cells of its rim were reachable. The whole lattice must be
searched only if cells of the rim were separated or joined.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.kernels.jit import as_value, kernel, lean_inner_kernel, lean_kernel

UNSEEN = 255
ROOT = 254
# Distance of an unreachable cell [steps]; twice this does not overflow.
FAR = 1 << 28


@lean_inner_kernel
def search(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    start: int,
    goal: int,
    came_from: NDArray[np.uint8],
    queue: NDArray[np.int32],
) -> int:
    """Search breadth first from flat cell ``start`` until ``goal``, -1 for all reachable cells.

    Args:
        steps: step masks, uint8 (n,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        start, goal: flat cells.
        came_from: uint8 (n,), in: all UNSEEN; out: direction of the step by which each cell
            was first reached, ROOT at the start.
        queue: int32 (n,), out: the cells reached, nearest first.

    Returns:
        Number of cells reached.
    """
    queue[0] = start
    came_from[start] = ROOT
    head, tail = 0, 1
    while head < tail and (goal < 0 or came_from[goal] == UNSEEN):
        here = queue[head]
        head += 1
        for direction in range(4):
            if not steps[here] >> direction & 1:
                continue
            after = here + offsets[direction]
            if came_from[after] == UNSEEN:
                came_from[after] = direction
                queue[tail] = after
                tail += 1
    return tail


@lean_inner_kernel
def steps_to(offsets: NDArray[np.int64], came_from: NDArray[np.uint8], goal: int) -> int:
    """Return the number of steps to a ``goal`` that ``search`` reached."""
    count = 0
    while came_from[goal] != ROOT:
        goal -= offsets[came_from[goal]]
        count += 1
    return count


@kernel
def reachable_from(steps: NDArray[np.uint8], row: int, col: int) -> NDArray[np.uint8]:
    """Return uint8 (rows, cols), 1 for cells reachable from (row, col)."""
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    came_from = np.full(steps.size, UNSEEN, np.uint8)
    start, anywhere = row * cols + col, as_value(-1)
    search(steps.ravel(), offsets, start, anywhere, came_from, np.empty(steps.size, np.int32))
    reached = np.empty(steps.shape, np.uint8)
    for cell in range(steps.size):
        reached[cell // cols, cell % cols] = came_from[cell] != UNSEEN
    return reached


@kernel
def shortest_walk(
    steps: NDArray[np.uint8], start: tuple[int, int], goal: tuple[int, int]
) -> NDArray[np.int32]:
    """Return a shortest walk from start to goal, int32 (n, 2); empty if there is none.

    Args:
        steps: step masks, uint8 (rows, cols).
        start, goal: cells (row, col) inside the array.
    """
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    came_from = np.full(steps.size, UNSEEN, np.uint8)
    first, cell = start[0] * cols + start[1], goal[0] * cols + goal[1]
    search(steps.ravel(), offsets, first, cell, came_from, np.empty(steps.size, np.int32))
    if came_from[cell] == UNSEEN:
        return np.empty((0, 2), np.int32)
    length = steps_to(offsets, came_from, cell) + 1
    walk = np.empty((length, 2), np.int32)
    for index in range(length - 1, -1, -1):
        walk[index, 0], walk[index, 1] = cell // cols, cell % cols
        if index:
            cell -= offsets[came_from[cell]]
    return walk


@kernel
def ways_from(steps: NDArray[np.uint8], start: int) -> NDArray[np.int32]:
    """Return the steps from a flat cell to each cell, int32 (rows * cols,), FAR where none lead.

    Args:
        steps: step masks, uint8 (rows, cols).
        start: flat cell.
    """
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    came_from = np.full(steps.size, UNSEEN, np.uint8)
    ways, queue = np.full(steps.size, FAR, np.int32), np.empty(steps.size, np.int32)
    reached = search(steps.ravel(), offsets, start, as_value(-1), came_from, queue)
    ways[start] = 0
    for cell in queue[1:reached]:
        ways[cell] = ways[cell - offsets[came_from[cell]]] + 1
    return ways


@lean_kernel
def walk_cost(walk: NDArray[np.int32], step_us: int, quarter_turn_us: int) -> int:
    """Return the cost [us] of a walk of flat cells, int32 (n,) with n >= 1.

    A half turn is two quarter-turns; before the first step there is no turn.
    """
    quarters = 0
    if quarter_turn_us:
        for index in range(2, walk.size):
            # A step is a difference of index, and the opposite step is the negative of that. (With
            # one column, east is the same as north; but then there are no steps east.)
            before = walk[index - 1] - walk[index - 2]
            after = walk[index] - walk[index - 1]
            if after == -before:
                quarters += 2
            elif after != before:
                quarters += 1
    return int((walk.size - 1) * step_us + quarters * quarter_turn_us)


# Margin of the part around changed cells, so that a new obstacle in the open does not
# separate its rim.
MARGIN = 2


class _Part(NamedTuple):
    """A part of the lattice, in a rectangle whose first cell is (``row``, ``col``).

    Attributes:
        inside: bool (rows, cols), the rectangle's cells that belong to the part.
        labels: int32 (rows, cols), number of the connected piece of each such cell, from 1.
        queue: int32 (rows * cols,).
        row, col: first cell of the rectangle.
    """

    inside: NDArray[np.bool_]
    labels: NDArray[np.int32]
    queue: NDArray[np.int32]
    row: int
    col: int


@lean_inner_kernel
def _holds(part: _Part, row: int, col: int) -> bool:
    rows, cols = part.inside.shape
    row, col = row - part.row, col - part.col
    return bool(0 <= row < rows and 0 <= col < cols and part.inside[row, col])


@lean_inner_kernel
def _label(steps: NDArray[np.uint8], part: _Part) -> int:
    """Number the connected pieces of a part; return how many there are."""
    rows, cols = part.inside.shape
    pieces = 0
    for source in range(rows * cols):
        row, col = source // cols, source % cols
        if not part.inside[row, col] or part.labels[row, col]:
            continue
        pieces += 1
        part.labels[row, col] = pieces
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


@lean_inner_kernel
def _is_rim(steps: NDArray[np.uint8], part: _Part, row: int, col: int) -> bool:
    """Return whether a step leads out of the part from a cell of its rectangle."""
    row, col = part.row + row, part.col + col
    for direction in range(4):
        if steps[row, col] >> direction & 1 and not _holds(
            part, row + ROW_STEP[direction], col + COL_STEP[direction]
        ):
            return True
    return False


@lean_inner_kernel
def _match(
    steps: NDArray[np.uint8],
    old: _Part,
    new: _Part,
    reachable: NDArray[np.bool_],
    to_new: NDArray[np.int32],
    to_old: NDArray[np.int32],
    reached: NDArray[np.bool_],
) -> bool:
    """Match old and new pieces by the cells at the rim; return whether that is one to one.

    Args:
        steps: step masks, uint8 (rows, cols), as they are now.
        old, new: the part before and now.
        reachable: bool (rows, cols), before.
        to_new, to_old: int32 (pieces + 1,), in: 0; out: the pieces that match.
        reached: out, bool (new pieces + 1,), whether the rim of a new piece was reachable.
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
    """Update the reachable cells after steps have changed; return whether that was possible.

    If not, nothing is written: use ``reachable_from``.

    Args:
        before, after: step masks, uint8 (rows, cols).
        changed: int32 (n, 2), n > 0: all cells (row, col) whose steps differ.
        reachable: in and out, bool (rows, cols): cells reachable before, and now.
        row, col: the cell to start from.
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
    # The cell (row, col) was reachable, or lies in a piece whose rim was reachable.
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
