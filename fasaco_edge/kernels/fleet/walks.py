"""Closed walks of several robots over one ground, kept as graphs.

A closed walk is kept as how often it takes each step between two neighbouring cells, in either
direction (0, 1 or 2 times), such that each cell has an even number of steps. A connected graph of
that kind can be driven in one closed walk (Euler).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel

# Cost of a step.
STEP = 64
LINKS = np.arange(256)
# Number of steps at a cell, by its links: two bits for each direction.
DEGREE = (LINKS & 3) + (LINKS >> 2 & 3) + (LINKS >> 4 & 3) + (LINKS >> 6)


def _turns_table() -> NDArray[np.int64]:
    """Return the fewest quarter-turns in the visits of a cell by its links."""
    table = np.zeros(256, np.int64)
    for links in range(256):
        east, north, west, south = (links >> shift & 3 for shift in (0, 2, 4, 6))
        along, across = abs(east - west), abs(north - south)
        # Straight on where possible, then around corners, and back where nothing else is left.
        corners = min(along, across)
        table[links] = corners + (max(along, across) - corners)
    return table


TURNS = _turns_table()
# No cell.
NONE = -1


class Walks(NamedTuple):
    """The ground, and the robots' closed walks on it.

    Attributes:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        cells: int64 (n,), flat cells of the ground.
        starts: int64 (k,), flat cell of each robot.
        links: uint8 (k, size), how often a robot's walk takes the step in each direction, two bits
            each.
        sets: int64 (size,), the robots that pass each cell, a bit each; in its start a robot is
            always.
        costs: int64 (k,), STEP for each step, and its share of that for each quarter-turn.
        visits: int32 (size,), visits of all robots.
        spare: int32 (size,), cells with more than one visit, in ``spare_at[size]`` places.
        spare_at: int32 (size + 1,), place of each in ``spare``, -1 for none.
    """

    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    links: NDArray[np.uint8]
    sets: NDArray[np.int64]
    costs: NDArray[np.int64]
    visits: NDArray[np.int32]
    spare: NDArray[np.int32]
    spare_at: NDArray[np.int32]


@lean_kernel
def cost_at(walks: Walks, robot: int, cells: NDArray[np.int64], count: int, turn: int) -> int:
    """Return the cost of a robot's visits of the first cells; a step counts half at either end."""
    cost = 0
    for index in range(count):
        links = walks.links[robot, cells[index]]
        cost += STEP // 2 * DEGREE[links] + turn * TURNS[links]
    return int(cost)


@lean_kernel
def _note_visits(walks: Walks, cell: int, more: int) -> None:
    """Change the number of visits of a cell, and list it as spare or not."""
    spare, at, size = walks.spare, walks.spare_at, walks.steps.size
    walks.visits[cell] += more
    is_spare = walks.visits[cell] > 1
    if is_spare and at[cell] < 0:
        at[cell] = at[size]
        spare[at[size]] = cell
        at[size] += 1
    elif not is_spare and at[cell] >= 0:
        at[size] -= 1
        last = spare[at[size]]
        spare[at[cell]] = last
        at[last] = at[cell]
        at[cell] = -1


@lean_kernel
def note_links(walks: Walks, robot: int, cell: int, before: int) -> None:
    """Take in that a robot has other links at a cell than before."""
    degree = DEGREE[walks.links[robot, cell]]
    if degree != DEGREE[before]:
        _note_visits(walks, cell, (degree - DEGREE[before]) // 2)
    if degree or cell == walks.starts[robot]:
        walks.sets[cell] |= 1 << robot
    else:
        walks.sets[cell] &= ~(1 << robot)


@lean_kernel
def _turn_link(walks: Walks, robot: int, cell: int, gone: int, come: int, turn: int) -> int:
    """Replace a step from a cell by one in another direction; return what its turns cost more."""
    links = walks.links[robot, cell]
    after = links & (0xFF ^ 3 << 2 * gone) | 1 << 2 * come
    walks.links[robot, cell] = after
    return int(turn * (TURNS[after] - TURNS[links]))


@lean_kernel
def exchange(walks: Walks, robot: int, here: int, along: int, across: int, turn: int) -> int:
    """Replace the two steps along a square by the two across it; return what turns cost more."""
    there = here + walks.offsets[along]
    beyond, back = (across + 2) & 3, (along + 2) & 3
    more = _turn_link(walks, robot, here, along, across, turn)
    more += _turn_link(walks, robot, there, back, across, turn)
    more += _turn_link(walks, robot, here + walks.offsets[across], along, beyond, turn)
    more += _turn_link(walks, robot, there + walks.offsets[across], back, beyond, turn)
    return more


@lean_kernel
def add_spike(walks: Walks, robot: int, here: int, direction: int, turn: int) -> None:
    """Have a robot take a step there and back."""
    links, back = walks.links[robot], (direction + 2) & 3
    there = here + int(walks.offsets[direction])
    one, other = links[here], links[there]
    links[here] |= 2 << 2 * direction
    links[there] |= 2 << 2 * back
    more = TURNS[links[here]] + TURNS[links[there]] - TURNS[one] - TURNS[other]
    walks.costs[robot] += 2 * STEP + turn * more
    note_links(walks, robot, here, one)
    note_links(walks, robot, there, other)


@lean_kernel
def _sum(one: int, other: int) -> int:
    """Return the links of two walks together, with no step taken more than twice."""
    links = 0
    for shift in (0, 2, 4, 6):
        times = (one >> shift & 3) + (other >> shift & 3)
        links |= (times - 2 if times > 2 else times) << shift
    return links


@lean_kernel
def give(walks: Walks, robot: int, taker: int, cell: int, turn: int) -> None:
    """Hand a robot's visits of a cell to another."""
    mine, theirs = walks.links[robot, cell], walks.links[taker, cell]
    both = _sum(mine, theirs)
    walks.costs[robot] -= STEP // 2 * DEGREE[mine] + turn * TURNS[mine]
    more = STEP // 2 * (DEGREE[both] - DEGREE[theirs]) + turn * (TURNS[both] - TURNS[theirs])
    walks.costs[taker] += more
    walks.links[robot, cell], walks.links[taker, cell] = 0, both
    walks.sets[cell] = walks.sets[cell] & ~(1 << robot) | 1 << taker
    fewer = (DEGREE[both] - DEGREE[theirs] - DEGREE[mine]) // 2
    if fewer:
        _note_visits(walks, cell, fewer)


@lean_kernel
def add_tour(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    links: NDArray[np.uint8],
    tour: NDArray[np.int32],
) -> None:
    """Add the steps of a closed walk, int32 (n,), to links, uint8 (size,).

    A step that it takes more than twice is left out twice.
    """
    for index in range(tour.size):
        here, there = int(tour[index]), int(tour[(index + 1) % tour.size])
        for direction in range(4):
            # In a column of cells east and north lead to the same one.
            if there - here == offsets[direction] and steps[here] >> direction & 1:
                back = (direction + 2) & 3
                times = (links[here] >> 2 * direction & 3) + 1
                times = 1 if times > 2 else times
                links[here] = links[here] & (0xFF ^ 3 << 2 * direction) | times << 2 * direction
                links[there] = links[there] & (0xFF ^ 3 << 2 * back) | times << 2 * back


@kernel
def walks_of(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    cells: NDArray[np.int64],
    starts: NDArray[np.int64],
    links: NDArray[np.uint8],
    turn: int,
) -> Walks:
    """Return walks with these links, uint8 (k, size)."""
    size, count = steps.size, starts.size
    walks = Walks(
        steps,
        offsets,
        cells,
        starts,
        links,
        np.zeros(size, np.int64),
        np.zeros(count, np.int64),
        np.zeros(size, np.int32),
        np.zeros(size, np.int32),
        np.full(size + 1, -1, np.int32),
    )
    walks.spare_at[size] = 0
    for robot in range(count):
        walks.sets[starts[robot]] |= 1 << robot
        for cell in cells:
            here = links[robot, cell]
            if here:
                walks.sets[cell] |= 1 << robot
                walks.costs[robot] += STEP // 2 * DEGREE[here] + turn * TURNS[here]
                _note_visits(walks, cell, DEGREE[here] // 2)
    return walks


@kernel
def driven(
    links: NDArray[np.uint8], offsets: NDArray[np.int64], start: int, most: int
) -> NDArray[np.int32]:
    """Return a closed walk that takes all steps of a connected graph, int32 (n,), from its start.

    Args:
        links: uint8 (size,), how often it takes the step in each direction; all used up.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        start: flat cell.
        most: more than the steps.
    """
    stack, came = np.empty(most, np.int32), np.empty(most, np.int8)
    walk = np.empty(most, np.int32)
    stack[0], came[0], depth, count = start, 0, 1, 0
    while depth:
        here, ahead = stack[depth - 1], came[depth - 1]
        is_end = True
        for turn in (0, 1, 3, 2):
            direction = (ahead + turn) & 3
            if links[here] >> 2 * direction & 3:
                there = here + offsets[direction]
                links[here] -= 1 << 2 * direction
                links[there] -= 1 << 2 * ((direction + 2) & 3)
                stack[depth], came[depth] = there, direction
                depth += 1
                is_end = False
                break
        if is_end:
            depth -= 1
            walk[count] = here
            count += 1
    return walk[:count]
