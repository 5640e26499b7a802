"""Repair of a walk after the ground changed: lost cells are left out, new cells are put in.

A repaired walk is legal and complete, and unchanged where the ground is unchanged;
local search improves it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, inner_kernel, kernel
from fasaco_edge.kernels.lattice.reach import UNSEEN, search, steps_to
from fasaco_edge.kernels.local_search.walk_array import Ground, leads

NOWHERE = -1

# Entries of ``_Walk.counts``.
VISITS, LAST = range(2)


@kernel
def keep_legal(
    ground: Ground, before: NDArray[np.int32], start: int, walk: NDArray[np.int32]
) -> int:
    """Write the remaining legal walk; return its length.

    Args:
        ground: as it is now.
        before: int32 (m,), the walk before the change, cells of this ground.
        start: where the walk begins now.
        walk: out, int32 (capacity,): the walk from ``start``. Where a step no longer exists
            or starts elsewhere, it takes a shortest walk to the next cell that is still
            to cover; it ends with the last such cell.

    Returns:
        The walk's length; it ends early where the array does.
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
            came_from = np.full(size, UNSEEN, np.uint8)
            search(ground.steps, ground.offsets, here, cell, came_from, queue)
            if came_from[cell] == UNSEEN:
                continue
            steps, at = steps_to(ground.offsets, came_from, cell), cell
            if length + steps > walk.size:
                break
            for index in range(length + steps - 1, length - 1, -1):
                walk[index] = at
                seen[at] = 1
                at -= ground.offsets[came_from[at]]
            length += steps
        else:
            continue
        here = cell
        seen[cell] = 1
        if is_open:
            kept = length
    return kept


class _Walk(NamedTuple):
    """A walk that visits are put into, as a linked list.

    Attributes:
        cells: int32 (capacity,), the cell of each visit.
        following: int32 (capacity,), the visit after each one, NOWHERE after the last.
        visit_of: int32 (n,), the last visit of each cell, NOWHERE where there is none.
        counts: int64 (2,), VISITS so far, and the LAST one.
    """

    cells: NDArray[np.int32]
    following: NDArray[np.int32]
    visit_of: NDArray[np.int32]
    counts: NDArray[np.int64]


class _Wave(NamedTuple):
    """A search outward from the walk.

    Attributes:
        queue: int32 (n,), the cells reached, nearest first.
        came_from: int32 (n,), the cell before each one reached, itself for the first cells.
        way: int32 (n,), working memory.
    """

    queue: NDArray[np.int32]
    came_from: NDArray[np.int32]
    way: NDArray[np.int32]


@inlined
def _insert(walk: _Walk, after: int, cell: int) -> int:
    """Put a visit of ``cell`` after visit ``after``; return it."""
    visit = int(walk.counts[VISITS])
    walk.cells[visit] = cell
    walk.following[visit] = walk.following[after]
    walk.following[after] = visit
    walk.counts[VISITS] += 1
    return visit


@inner_kernel
def _visit(walk: _Walk, wave: _Wave, goal: int, free_end: bool) -> None:
    """Visit a cell from the nearest one on the walk: there and back, or there from a free end."""
    length, cell = 0, goal
    while walk.visit_of[cell] == NOWHERE:
        wave.way[length] = cell
        length += 1
        cell = wave.came_from[cell]
    at = walk.visit_of[cell]
    is_end = free_end and at == walk.counts[LAST]
    for index in range(length - 1, -1, -1):
        at = _insert(walk, at, wave.way[index])
        walk.visit_of[wave.way[index]] = at
    if is_end:
        walk.counts[LAST] = at
        return
    for index in range(1, length):
        at = _insert(walk, at, wave.way[index])
    _insert(walk, at, cell)


@inner_kernel
def _begin(wave: _Wave, visits: NDArray[np.int32], first: int, end: int, tail: int) -> int:
    """Queue the cells of visits ``first`` to ``end``, the last one first; return the tail."""
    for index in range(end - 1, first - 1, -1):
        cell = visits[index]
        if wave.came_from[cell] == NOWHERE:
            wave.came_from[cell] = cell
            wave.queue[tail] = cell
            tail += 1
    return tail


@inner_kernel
def _spread(
    ground: Ground, walk: _Walk, wave: _Wave, tail: int, over_all: bool, free_end: bool
) -> int:
    """Visit missing cells in a wave from the queued cells; return the tail.

    ``over_all``: over any cells, else only from one missing cell to the next.
    """
    head = 0
    while head < tail:
        here = wave.queue[head]
        head += 1
        for direction in range(4):
            after = here + ground.offsets[direction]
            if not ground.steps[here] >> direction & 1 or wave.came_from[after] != NOWHERE:
                continue
            missing = ground.needed[after] > 0 and walk.visit_of[after] == NOWHERE
            if not (missing or over_all):
                continue
            wave.came_from[after] = here
            wave.queue[tail] = after
            tail += 1
            if missing:
                _visit(walk, wave, after, free_end)
    return tail


@kernel
def put_in_new(
    ground: Ground, before: NDArray[np.int32], free_end: bool, held: int, out: NDArray[np.int32]
) -> int:
    """Extend a walk over all cells that it misses; return the new walk's length.

    In a wave from the walk outward, each missing cell is visited from the nearest
    cell that is on the walk by then: there and back; or one way, where a free end lies beside it.
    Of several visits of that cell the last one is taken: the map may be known better by then, and
    the walk just ahead of the robot stays as it is. A cell is visited from the held visits ahead of
    the robot only if no way over missing cells leads to it from a later visit.

    Args:
        ground: its cells with ``needed`` above 0 are to be visited; unreachable ones are left out.
        before: int32 (m,), the walk, m at least 1.
        free_end: whether the walk may end anywhere.
        held: number of first visits that lie just ahead of the robot.
        out: out, int32 (capacity,); ``m + 2 * n`` is enough for any walk.
    """
    size = ground.bound
    walk = _Walk(
        np.empty(out.size, np.int32),
        np.empty(out.size, np.int32),
        np.full(size, NOWHERE, np.int32),
        np.array((before.size, before.size - 1), np.int64),
    )
    wave = _Wave(
        np.empty(size, np.int32), np.full(size, NOWHERE, np.int32), np.empty(size, np.int32)
    )
    for index in range(before.size):
        walk.cells[index] = before[index]
        walk.following[index] = index + 1
        walk.visit_of[before[index]] = index
    walk.following[before.size - 1] = NOWHERE
    tail = _begin(wave, before, held, before.size, 0)
    tail = _spread(ground, walk, wave, tail, False, free_end)
    tail = _begin(wave, before, 0, min(held, before.size), tail)
    _spread(ground, walk, wave, tail, True, free_end)
    visit, written = 0, 0
    while visit != NOWHERE:
        out[written] = walk.cells[visit]
        written += 1
        visit = walk.following[visit]
    return written
