"""Mending a walk after the ground changed: what is gone is left out, what is new is put in.

A mended walk is legal and complete, and where nothing changed it is the walk
that it was; how good it is, is left to local search.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, kernel
from fasaco_edge.kernels.walk_array import Ground, leads

NOWHERE = -1


@kernel
def _way(
    ground: Ground,
    start: int,
    goal: int,
    came_from: NDArray[np.int32],
    queue: NDArray[np.int32],
) -> int:
    """Search a shortest way breadth first; return its steps, -1 where there is none.

    ``came_from``, int32 (n,), all NOWHERE, receives the cell before each one reached.
    """
    queue[0] = start
    came_from[start] = start
    head, tail = 0, 1
    while head < tail and came_from[goal] == NOWHERE:
        here = queue[head]
        head += 1
        for direction in range(4):
            if not ground.steps[here] >> direction & 1:
                continue
            after = here + ground.offsets[direction]
            if came_from[after] == NOWHERE:
                came_from[after] = here
                queue[tail] = after
                tail += 1
    if came_from[goal] == NOWHERE:
        return -1
    steps, cell = 0, goal
    while cell != start:
        cell = came_from[cell]
        steps += 1
    return steps


@inlined
def _append_way(
    came_from: NDArray[np.int32], walk: NDArray[np.int32], length: int, goal: int, steps: int
) -> int:
    cell = goal
    for index in range(length + steps - 1, length - 1, -1):
        walk[index] = cell
        cell = came_from[cell]
    return length + steps


@kernel
def keep_legal(
    ground: Ground, before: NDArray[np.int32], start: int, walk: NDArray[np.int32]
) -> int:
    """Write what is left of a walk; return its length.

    Args:
        ground: as it is now.
        before: int32 (m,), the walk that was, cells of this ground.
        start: where the walk begins now.
        walk: out, int32 (room,): the walk from ``start``. Where a step is gone, or leads
            from where the robot is not, it goes by a shortest way to the next cell
            that is still to be covered; it ends with the last of these.

    Returns:
        The walk's length; it ends early where the room does.
    """
    size = ground.bound
    seen = np.zeros(size, np.uint8)
    queue = np.empty(size, np.int32)
    walk[0] = start
    seen[start] = 1
    length, kept, here = 1, 1, start
    for cell in before:
        if cell == here or (seen[cell] and not leads(ground, here, cell)):
            continue
        is_open = ground.needed[cell] > 0 and not seen[cell]
        if leads(ground, here, cell):
            if length == walk.size:
                break
            walk[length] = cell
            length += 1
        elif is_open and ground.steps[cell]:
            came_from = np.full(size, NOWHERE, np.int32)
            steps = _way(ground, here, cell, came_from, queue)
            if steps < 0:
                continue
            if length + steps > walk.size:
                break
            length = _append_way(came_from, walk, length, cell, steps)
            for index in range(length - steps, length):
                seen[walk[index]] = 1
        else:
            continue
        here = cell
        seen[cell] = 1
        if is_open:
            kept = length
    return kept


@inlined
def _insert(
    cells: NDArray[np.int32], following: NDArray[np.int32], size: int, after: int, cell: int
) -> int:
    """Put a visit of ``cell`` after visit ``after``; it becomes visit ``size``. Return that."""
    cells[size] = cell
    following[size] = following[after]
    following[after] = size
    return size


@kernel
def _written(cells: NDArray[np.int32], following: NDArray[np.int32], out: NDArray[np.int32]) -> int:
    """Write visits in their order, from visit 0 on; return their number."""
    index, written = 0, 0
    while index != NOWHERE:
        out[written] = cells[index]
        written += 1
        index = following[index]
    return written


@kernel
def put_in_new(
    ground: Ground, walk: NDArray[np.int32], free_end: bool, out: NDArray[np.int32]
) -> int:
    """Lead a walk over all cells that it misses; return the new walk's length.

    In a wave from the walk outward, each missing cell is visited from the nearest
    cell that is on the walk by then: there and back; or there alone, where a free
    end lies beside it. Of several visits the last one is left: what was just found
    may be more than is known.

    Args:
        ground: whose cells with ``needed`` above 0 are to be visited; those that cannot
            be reached are left out.
        walk: int32 (m,), m at least 1.
        free_end: whether the walk may end anywhere.
        out: out, int32 (room,); room for ``m + 2 * n`` visits is enough for any walk.
    """
    size = ground.bound
    cells = np.empty(out.size, np.int32)
    following = np.empty(out.size, np.int32)
    visit_of = np.full(size, NOWHERE, np.int32)
    came_from = np.full(size, NOWHERE, np.int32)
    queue = np.empty(size, np.int32)
    way = np.empty(size, np.int32)
    tail = 0
    for index in range(walk.size):
        cells[index] = walk[index]
        following[index] = index + 1
        visit_of[walk[index]] = index
        if came_from[walk[index]] == NOWHERE:
            came_from[walk[index]] = walk[index]
            queue[tail] = walk[index]
            tail += 1
    last, visits, head = walk.size - 1, walk.size, 0
    following[last] = NOWHERE
    while head < tail:
        here = queue[head]
        head += 1
        for direction in range(4):
            after = here + ground.offsets[direction]
            if not ground.steps[here] >> direction & 1 or came_from[after] != NOWHERE:
                continue
            came_from[after] = here
            queue[tail] = after
            tail += 1
            if ground.needed[after] <= 0:
                continue
            # The way there from the nearest cell on the walk, backwards.
            length, cell = 0, after
            while visit_of[cell] == NOWHERE:
                way[length] = cell
                length += 1
                cell = came_from[cell]
            at = visit_of[cell]
            and_back = not (free_end and at == last)
            for index in range(length - 1, -1, -1):
                at = _insert(cells, following, visits, at, way[index])
                visit_of[way[index]] = at
                visits += 1
            if not and_back:
                last = at
                continue
            for index in range(1, length):
                at = _insert(cells, following, visits, at, way[index])
                visits += 1
            _insert(cells, following, visits, at, cell)
            visits += 1
    return _written(cells, following, out)
