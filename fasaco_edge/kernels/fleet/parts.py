"""Connected parts of a ground for robots that start in them, balanced by simulated annealing.

Each robot has a part: a connected set of cells with its start in it; together they are the whole
ground. The load of a part is its number of cells, plus one for each thin cell: one that lies in no
square of four cells of the part, so that a closed walk passes it twice. A proposal hands a cell to
a robot beside it, or a whole branch of a part to the robot nearest to it, which then shares the
cells that it crosses on its way there; or it takes a shared cell from one of the robots.

Loads, energies and temperatures are integers, so that results are equal on all machines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.random import draw, index_of

# Bits of a set of robots.
MOST_ROBOTS = 62
# Energy of a unit of load, and of a border between a cell and one of another part, where the square
# of a load's deviation from the mean counts as it is.
LOAD, BORDER = 20, 20
# Temperatures from the first proposal to the last, in energy.
HOT, COLD = 80, 6
# Number of proposals to hand over a branch.
BRANCHES = 300
# Quantiles of the exponential distribution, times ONE.
ONE = 64
QUANTILES = np.round(-ONE * np.log((np.arange(1024) + 0.5) / 1024)).astype(np.int64)
# A cell's place in the tree of a part: not in it, in it, in the branch.
OUTSIDE, STEM, BRANCH = 0, 1, 2


class _Parts(NamedTuple):
    """The ground, and the parts.

    Attributes:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        sets: int64 (size,), the robots that have each cell in their part, a bit each.
        cells: int64 (n,), flat cells of the ground.
        starts: int64 (k,), flat cell of each robot.
        loads: int64 (k,).
        mean: the mean load.
    """

    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    sets: NDArray[np.int64]
    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    loads: NDArray[np.int64]
    mean: int


class _Tree(NamedTuple):
    """Working memory of a search: queue, previous cell, place and distance of each."""

    queue: NDArray[np.int64]
    parent: NDArray[np.int64]
    place: NDArray[np.uint8]
    distance: NDArray[np.int64]


@lean_kernel
def _has(parts: _Parts, cell: int, robot: int) -> bool:
    return bool(parts.sets[cell] >> robot & 1)


@lean_kernel
def _is_square(parts: _Parts, cell: int, direction: int, robot: int) -> bool:
    """Tell whether the square between a direction and the next is in a robot's part."""
    steps, offsets, across = parts.steps, parts.offsets, (direction + 1) & 3
    if not (steps[cell] >> direction & 1 and steps[cell] >> across & 1):
        return False
    first, second = cell + offsets[direction], cell + offsets[across]
    if not (steps[first] >> across & 1 and steps[second] >> direction & 1):
        return False
    return (
        _has(parts, first, robot)
        and _has(parts, second, robot)
        and _has(parts, first + offsets[across], robot)
    )


@lean_kernel
def _is_thin(parts: _Parts, cell: int, robot: int) -> bool:
    """Tell whether a cell lies in no square of four cells of a robot's part."""
    squares = 0
    for direction in range(4):
        squares += _is_square(parts, cell, direction, robot)
    return squares == 0


@lean_kernel
def _beside(parts: _Parts, cell: int, robot: int) -> int:
    """Return the number of neighbours of a cell in a robot's part."""
    count = 0
    for direction in range(4):
        if parts.steps[cell] >> direction & 1:
            count += _has(parts, cell + parts.offsets[direction], robot)
    return count


@lean_kernel
def _is_free(parts: _Parts, cell: int, robot: int) -> bool:
    """Tell whether a robot's part stays connected around a cell that it loses.

    The cells next to it have to be connected by those at its corners.
    """
    if cell == parts.starts[robot]:
        return False
    joined = 0
    beside = _beside(parts, cell, robot)
    for direction in range(4):
        joined += _is_square(parts, cell, direction, robot)
    return beside == 1 or (beside > 1 and joined >= beside - 1)


@lean_kernel
def _thin_around(parts: _Parts, cell: int, robot: int) -> int:
    """Return the number of thin cells among a cell and those around it."""
    steps, offsets, count = parts.steps, parts.offsets, 0
    if _has(parts, cell, robot):
        count += _is_thin(parts, cell, robot)
    for direction in range(4):
        if steps[cell] >> direction & 1:
            beside = cell + offsets[direction]
            if _has(parts, beside, robot):
                count += _is_thin(parts, beside, robot)
            across = (direction + 1) & 3
            if steps[beside] >> across & 1:
                corner = beside + offsets[across]
                if _has(parts, corner, robot):
                    count += _is_thin(parts, corner, robot)
    return count


@lean_kernel
def _load(parts: _Parts, robot: int) -> int:
    load = 0
    for cell in parts.cells:
        if _has(parts, cell, robot):
            load += 2 if _is_thin(parts, cell, robot) else 1
    return load


@lean_kernel
def _member(robots: int, count: int, bits: int) -> int:
    """Return one of a set of robots, which is not empty."""
    robot = (bits >> 2 & 0xFFFF) % count
    while not robots >> robot & 1:
        robot = robot + 1 if robot + 1 < count else 0
    return robot


@lean_kernel
def _gain(parts: _Parts, robot: int, load: int) -> int:
    """Return the energy that another load of a robot adds."""
    before, after = parts.loads[robot] - parts.mean, load - parts.mean
    return int(LOAD * (after - before) + after * after - before * before)


@lean_kernel
def _accepts(energy: int, heat: int, random: NDArray[np.uint64]) -> bool:
    """Tell whether a change is accepted (Metropolis)."""
    return energy <= 0 or energy * ONE <= heat * QUANTILES[index_of(draw(random), QUANTILES.size)]


@lean_kernel
def _grow(parts: _Parts, tree: _Tree, cell: int, robot: int) -> int:
    """Mark a tree over a robot's part, and the branch that hangs at a cell; return its size.

    The branch comes first in the queue. The part without it stays connected.
    """
    queue, parent, place = tree.queue, tree.parent, tree.place
    place[:] = OUTSIDE
    queue[0], place[parts.starts[robot]] = parts.starts[robot], STEM
    count, at = 1, 0
    while at < count:
        here = queue[at]
        at += 1
        for direction in range(4):
            if parts.steps[here] >> direction & 1:
                there = here + parts.offsets[direction]
                if place[there] == OUTSIDE and _has(parts, there, robot):
                    place[there], parent[there] = STEM, here
                    queue[count] = there
                    count += 1
    place[cell] = BRANCH
    size = 0
    for index in range(count):
        here = queue[index]
        if index and place[parent[here]] == BRANCH:
            place[here] = BRANCH
        if place[here] == BRANCH:
            queue[size] = here
            size += 1
    return size


@lean_kernel
def _hand_over_branch(
    parts: _Parts, tree: _Tree, cell: int, heat: int, random: NDArray[np.uint64]
) -> None:
    """Hand the branch at a cell to the robot to which it is worth most, if it is accepted."""
    sets, count = parts.sets, parts.starts.size
    giver = _member(sets[cell], count, draw(random))
    if cell == parts.starts[giver]:
        return
    size = _grow(parts, tree, cell, giver)
    queue, parent, distance = tree.queue, tree.parent, tree.distance
    distance[:] = -1
    lost = own = 0
    for here in queue[:size]:
        load = 2 if _is_thin(parts, here, giver) else 1
        lost += load
        own += load if sets[here] == 1 << giver else 0
        distance[here] = 0
    # Outward from the branch, to the nearest cell of each other robot.
    seen, at, ends = 1 << giver, 0, size
    taker, meets, least = -1, 0, 0
    while at < ends and seen != (1 << count) - 1:
        here = queue[at]
        at += 1
        for robot in range(count):
            if sets[here] & ~seen & (1 << robot):
                more = own + 2 * max(distance[here] - 1, 0)
                energy = _gain(parts, giver, parts.loads[giver] - lost)
                energy += _gain(parts, robot, parts.loads[robot] + more)
                if taker < 0 or energy < least:
                    taker, meets, least = robot, here, energy
        seen |= sets[here]
        for direction in range(4):
            if parts.steps[here] >> direction & 1:
                there = here + parts.offsets[direction]
                if distance[there] < 0:
                    distance[there], parent[there] = distance[here] + 1, here
                    queue[ends] = there
                    ends += 1
    if taker < 0 or not _accepts(least, heat, random):
        return
    while distance[meets] > 0:
        sets[meets] |= 1 << taker
        meets = parent[meets]
    for here in queue[:size]:
        sets[here] = sets[here] & ~(1 << giver) | 1 << taker
    parts.loads[giver], parts.loads[taker] = _load(parts, giver), _load(parts, taker)


@lean_kernel
def _take_shared(parts: _Parts, cell: int, heat: int, random: NDArray[np.uint64]) -> None:
    """Take a cell from one of the robots that share it, if it is accepted."""
    robot = _member(parts.sets[cell], parts.starts.size, draw(random))
    if not _is_free(parts, cell, robot):
        return
    thin, beside = _thin_around(parts, cell, robot), _beside(parts, cell, robot)
    parts.sets[cell] ^= 1 << robot
    load = parts.loads[robot] - 1 + _thin_around(parts, cell, robot) - thin
    if _accepts(_gain(parts, robot, load) + BORDER * (beside - 2), heat, random):
        parts.loads[robot] = load
    else:
        parts.sets[cell] ^= 1 << robot


@lean_kernel
def _hand_over(
    parts: _Parts, cell: int, direction: int, heat: int, random: NDArray[np.uint64]
) -> None:
    """Hand a cell of one robot to one that has its neighbour in a direction, if accepted."""
    sets, loads = parts.sets, parts.loads
    before = sets[cell]
    others = sets[cell + parts.offsets[direction]] & ~before
    if not others:
        return
    giver = _member(before, parts.starts.size, 0)
    if not _is_free(parts, cell, giver):
        return
    taker = _member(others, parts.starts.size, draw(random))
    given, taken = -_thin_around(parts, cell, giver), -_thin_around(parts, cell, taker)
    border = _beside(parts, cell, giver) - _beside(parts, cell, taker)
    sets[cell] = 1 << taker
    given += loads[giver] - 1 + _thin_around(parts, cell, giver)
    taken += loads[taker] + 1 + _thin_around(parts, cell, taker)
    energy = _gain(parts, giver, given) + _gain(parts, taker, taken) + BORDER * border
    if _accepts(energy, heat, random):
        loads[giver], loads[taker] = given, taken
    else:
        sets[cell] = before


@kernel
def balance_parts(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    sets: NDArray[np.int64],
    cells: NDArray[np.int64],
    starts: NDArray[np.int64],
    proposals: int,
    random: NDArray[np.uint64],
) -> NDArray[np.int64]:
    """Balance the parts of a connected ground among robots; return their loads, int64 (k,).

    Args:
        steps: step masks, uint8 (size,); none leads out of the array.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        sets: int64 (size,), changed: the robots that have each cell in their part, a bit each;
            0 off the ground. Each part is connected, and has its robot's start.
        cells: int64 (n,), n < 2^22, flat cells of the ground.
        starts: int64 (k,), 2 <= k <= MOST_ROBOTS, flat cells.
        proposals: how many.
        random: stream, uint64 (1,); advanced.
    """
    count = starts.size
    loads = np.zeros(count, np.int64)
    tree = _Tree(
        np.empty(sets.size, np.int64),
        np.empty(sets.size, np.int64),
        np.empty(sets.size, np.uint8),
        np.empty(sets.size, np.int64),
    )
    parts = _Parts(steps, offsets, sets, cells, starts, loads, 0)
    for robot in range(count):
        loads[robot] = _load(parts, robot)
    parts = _Parts(steps, offsets, sets, cells, starts, loads, loads.sum() // count)
    period = max(proposals // BRANCHES, 1)
    for number in range(proposals):
        heat = HOT + (COLD - HOT) * number // proposals
        bits = draw(random)
        cell, direction = cells[index_of(bits, cells.size)], bits & 3
        if number % period == 0:
            _hand_over_branch(parts, tree, cell, heat, random)
        elif sets[cell] & (sets[cell] - 1):
            _take_shared(parts, cell, heat, random)
        elif steps[cell] >> direction & 1:
            _hand_over(parts, cell, direction, heat, random)
    return loads
