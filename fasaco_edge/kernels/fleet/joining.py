"""Pieces of a robot's walk that a change has split: found, and joined again or to another walk.

Where the steps along two opposite sides of a square are replaced by those across it, a walk falls
into two closed walks, and two closed walks become one. So a walk that falls into two by a change
may be joined again at another square, or one of the two to the walk of another robot, which then
takes over all cells of it without a step more.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.fleet.walks import (
    DEGREE,
    NONE,
    STEP,
    Walks,
    add_spike,
    cost_at,
    exchange,
    give,
    note_links,
)
from fasaco_edge.kernels.jit import lean_kernel
from fasaco_edge.kernels.random import index_of

# Energy of a unit of cost, in squared units of cost for each step.
LOAD = 20
# A walk in parts that cannot be joined.
BROKEN = -2
# Kinds of places to join walks at a cell: at it, at the squares beside its steps (direction of a
# step, and a side), at a spike in a direction.
SQUARE, SPIKE, LAST = 1, 9, 13


class Memory(NamedTuple):
    """Working memory of a proposal.

    Attributes:
        corners: int64 (4,), cells whose links change.
        before: uint8 (4,), their links before.
        queues: int32 (2, size), of the search from both sides.
        seen: int64 (size,), the last search and side that came to each cell.
        clock: int64 (1,), number of the last search.
    """

    corners: NDArray[np.int64]
    before: NDArray[np.uint8]
    queues: NDArray[np.int32]
    seen: NDArray[np.int64]
    clock: NDArray[np.int64]


@lean_kernel
def energy_of(walks: Walks, robot: int, more: int, mean: int, weight: int) -> int:
    """Return the energy that more cost of a robot adds."""
    return int(more * (LOAD * STEP + (weight * (2 * (walks.costs[robot] - mean) + more) >> 8)))


@lean_kernel
def take_in(walks: Walks, memory: Memory, robot: int, more: int) -> None:
    """Take in a change at the corners."""
    walks.costs[robot] += more
    for index in range(4):
        cell = memory.corners[index]
        if cell != NONE:
            note_links(walks, robot, cell, memory.before[index])


@lean_kernel
def _part_between(walks: Walks, memory: Memory, robot: int, one: int, other: int) -> int:
    """Search from two cells along a robot's steps until they meet, or one part is found.

    Returns:
        NONE if they are connected, else the side whose part is found, in its queue; the number of
        its cells is in ``memory.clock[1]``.
    """
    links, offsets = walks.links[robot], walks.offsets
    queues, seen = memory.queues, memory.seen
    memory.clock[0] += 2
    clock = memory.clock[0]
    queues[0, 0], queues[1, 0] = one, other
    seen[one], seen[other] = clock, clock + 1
    at, end, far_at, far_end = 0, 1, 0, 1
    side = 0
    while True:
        if at == end:
            memory.clock[1] = end
            return side
        here = queues[side, at]
        at += 1
        for direction in range(4):
            if links[here] >> 2 * direction & 3:
                there = here + offsets[direction]
                if seen[there] == clock + 1 - side:
                    return NONE
                if seen[there] != clock + side:
                    seen[there] = clock + side
                    queues[side, end] = there
                    end += 1
        at, end, far_at, far_end, side = far_at, far_end, at, end, 1 - side


@lean_kernel
def parts_of(walks: Walks, memory: Memory, robot: int, count: int) -> int:
    """Tell what a change at the corners has made of a robot's walk.

    Returns:
        NONE if it is connected; the side of a part as ``_part_between``; or BROKEN for any other.
    """
    corners, links = memory.corners, walks.links[robot]
    first = second = NONE
    groups = 0
    for index in range(count):
        cell, before = corners[index], corners[index - 1 if index else count - 1]
        if not DEGREE[links[cell]]:
            if cell == walks.starts[robot]:
                return BROKEN
            continue
        # A group begins where no step leads here from the corner before.
        is_joined = False
        for direction in range(4):
            is_step = walks.offsets[direction] == before - cell
            is_joined |= is_step and links[cell] >> 2 * direction & 3 > 0
        if is_joined:
            continue
        groups += 1
        if first == NONE:
            first = cell
        elif second == NONE:
            second = cell
        elif _part_between(walks, memory, robot, first, cell) != NONE:
            return BROKEN
    if groups < 2:
        return NONE
    side = _part_between(walks, memory, robot, first, second)
    return BROKEN if groups > 2 and side != NONE else side


@lean_kernel
def _is_joint(walks: Walks, robot: int, taker: int, here: int, along: int, across: int) -> bool:
    """Tell whether a robot's step along a square can be joined to the opposite one of another."""
    steps, links = walks.steps, walks.links
    there, far = here + walks.offsets[along], here + walks.offsets[across]
    if not (steps[there] >> across & 1 and steps[far] >> along & 1):
        return False
    if links[taker, far] >> 2 * along & 3 != 1:
        return False
    if (links[robot, here] | links[robot, there]) >> 2 * across & 3:
        return False
    if taker == robot:
        return True
    both = (links[taker, here] | links[robot, far]) >> 2 * along
    return not (both | (links[taker, here] | links[taker, there]) >> 2 * across) & 3


@lean_kernel
def _across(kind: int) -> int:
    """Return the direction from a cell of a part to where it may be joined."""
    return kind - SPIKE if kind >= SPIKE else ((kind - SQUARE >> 1) + 1 + 2 * (kind & 1)) & 3


@lean_kernel
def _is_place(walks: Walks, robot: int, taker: int, here: int, kind: int) -> bool:
    """Tell whether a part of a robot's walk can be joined to another one at a cell of it."""
    if kind < SQUARE:
        return True
    if kind >= SPIKE:
        both = walks.links[robot, here] | walks.links[taker, here]
        return not both >> 2 * (kind - SPIKE) & 3
    along = kind - SQUARE >> 1
    is_along = walks.links[robot, here] >> 2 * along & 3 == 1
    return is_along and _is_joint(walks, robot, taker, here, along, _across(kind))


@lean_kernel
def _added(
    walks: Walks,
    robot: int,
    taker: int,
    more: int,
    cost: int,
    spike: int,
    mean: int,
    weight: int,
) -> int:
    """Return the energy that a change adds with which a part of a cost goes to a robot."""
    if taker == robot:
        return energy_of(walks, robot, more + spike, mean, weight)
    given = energy_of(walks, robot, more - cost, mean, weight)
    return given + energy_of(walks, taker, cost + spike, mean, weight)


@lean_kernel
def _join_at(walks: Walks, taker: int, here: int, kind: int, turn: int) -> None:
    """Join two walks of one robot at a place."""
    if kind >= SPIKE:
        add_spike(walks, taker, here, kind - SPIKE, turn)
    elif kind >= SQUARE:
        along = kind - SQUARE >> 1
        walks.costs[taker] += exchange(walks, taker, here, along, _across(kind), turn)


@lean_kernel
def join(
    walks: Walks,
    memory: Memory,
    robot: int,
    side: int,
    more: int,
    turn: int,
    mean: int,
    weight: int,
    limit: int,
    bits: int,
) -> bool:
    """Join a part of a robot's walk to the rest of it, or to another walk; if within a limit.

    Args:
        walks: changed if a place was found.
        memory: of the search that found the part.
        robot: whose walk fell into parts, by a change at the corners that is not taken in yet.
        side: of the part.
        more: cost that the change adds.
        turn: cost of a quarter-turn.
        mean, weight: of an uneven share.
        limit: most energy that all of it may add.
        bits: random bits.

    Returns:
        whether they are joined.
    """
    count, tag = memory.clock[1], memory.clock[0] + side
    is_given, cost = bits & 1 > 0, 0
    if is_given:
        if memory.seen[walks.starts[robot]] == tag:
            return False
        cost = cost_at(walks, robot, memory.queues[side], count, turn)
    begin = index_of(bits, min(count, 1 << 21))
    for number in range(begin, begin + count):
        here = int(memory.queues[side, number if number < count else number - count])
        # A spike takes two more steps, so it is worth trying only where the change saved some.
        for kind in range(0 if is_given else SQUARE, LAST if more < 0 else SPIKE):
            across, far = _across(kind), here
            if kind >= SQUARE:
                if not walks.steps[here] >> across & 1:
                    continue
                far = here + int(walks.offsets[across])
            if is_given:
                takers = walks.sets[far] & ~(1 << robot)
            else:
                is_rest = memory.seen[far] != tag and walks.links[robot, far] > 0
                takers = 1 << robot if is_rest else 0
            spike = 2 * STEP if kind >= SPIKE else 0
            taker = 0
            while takers >> taker:
                if (
                    takers >> taker & 1
                    and _is_place(walks, robot, taker, here, kind)
                    and _added(walks, robot, taker, more, cost, spike, mean, weight) <= limit
                ):
                    take_in(walks, memory, robot, more)
                    for index in range(count if is_given else 0):
                        give(walks, robot, taker, int(memory.queues[side, index]), turn)
                    _join_at(walks, taker, here, kind, turn)
                    return True
                taker += 1
    return False
