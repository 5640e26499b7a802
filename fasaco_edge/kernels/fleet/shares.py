"""Shares of robots in the blocks of a ground, by simulated annealing.

Each block has an owner, who sweeps it, and robots that pass through it on their way to blocks of
their own: the blocks that a robot has are connected, with its start in one of them. Its load is the
steps that these take (``blocks``); a robot that owns none has its start alone, and no load. A
proposal hands over

- a branch of what a robot has: to the one to which it is worth most among those nearest, which from
  then on passes through the blocks between;
- a block: to a robot that passes through it.

The energy is the sum of the squares of the loads' deviations from the mean, and a price for each
unit of load. The search begins so hot that rooms change hands. All numbers are integers, so that
results are equal on all machines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.fleet.blocks import NONE, Blocks
from fasaco_edge.kernels.fleet.chance import member, most_energy
from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.random import draw, index_of

# Of 256 proposals, so many hand over a branch.
BRANCHES = 160
# A branch goes to the best of the nearest 1 to so many robots, or of all.
NEAREST = 3
# The temperature falls by one part in so many at a time.
COOLING = 32


class _Shares(NamedTuple):
    """Who has which block.

    Attributes:
        owner: int64 (m,).
        sets: int64 (m,), the robots that own or pass each block or start in it, a bit each.
        starts: int64 (k,), block of each robot's start.
        loads: int64 (k,).
        mean: the least mean load.
        price: energy of a unit of load.
    """

    owner: NDArray[np.int64]
    sets: NDArray[np.int64]
    starts: NDArray[np.int64]
    loads: NDArray[np.int64]
    mean: int
    price: int


class _Memory(NamedTuple):
    """Working memory of a proposal: blocks of a robot as a tree, and those around a branch of it.

    Attributes:
        tree: int64 (m,), the robot's blocks, from its start outward.
        parent: int64 (m,), the next block towards the start.
        seen: int64 (m,), number of the last search that found each.
        is_needed: bool (m,), whether the robot owns it, or passes it on the way to one.
        in_branch: bool (m,).
        around: int64 (m,), the branch, and then the blocks around it, the nearest first.
        inward: int64 (m,), the next block towards the branch.
        reached: int64 (m,), number of the last search that found each around a branch.
        way: int64 (m,), load of the blocks from the branch to each, with it.
        clock: int64 (1,), number of searches.
    """

    tree: NDArray[np.int64]
    parent: NDArray[np.int64]
    seen: NDArray[np.int64]
    is_needed: NDArray[np.bool_]
    in_branch: NDArray[np.bool_]
    around: NDArray[np.int64]
    inward: NDArray[np.int64]
    reached: NDArray[np.int64]
    way: NDArray[np.int64]
    clock: NDArray[np.int64]


@lean_kernel
def _energy(shares: _Shares, robot: int, more: int) -> int:
    """Return the energy that more load of a robot adds."""
    above = shares.loads[robot] - shares.mean
    return int(more * (shares.price + 2 * above + more))


@lean_kernel
def _grow(blocks: Blocks, shares: _Shares, memory: _Memory, robot: int) -> int:
    """Make a tree of a robot's blocks; return how many they are."""
    tree, bit = memory.tree, 1 << robot
    memory.clock[0] += 1
    clock = memory.clock[0]
    tree[0] = shares.starts[robot]
    memory.seen[tree[0]], memory.in_branch[tree[0]] = clock, False
    size, at = 1, 0
    while at < size:
        here = tree[at]
        at += 1
        for there in blocks.beside[blocks.begins[here] : blocks.begins[here + 1]]:
            if memory.seen[there] != clock and shares.sets[there] & bit:
                memory.seen[there], memory.in_branch[there] = clock, False
                memory.parent[there] = here
                tree[size] = there
                size += 1
    return size


@lean_kernel
def _need(blocks: Blocks, shares: _Shares, memory: _Memory, robot: int, size: int) -> int:
    """Note which blocks of its tree a robot needs, without a branch; return their load."""
    tree, is_needed = memory.tree, memory.is_needed
    for index in range(size):
        here = tree[index]
        is_needed[here] = shares.owner[here] == robot and not memory.in_branch[here]
    load = 0
    for index in range(size - 1, -1, -1):
        here = tree[index]
        if is_needed[here]:
            load += blocks.own[here] if shares.owner[here] == robot else blocks.passing[here]
            if index:
                is_needed[memory.parent[here]] = True
    return load


@lean_kernel
def _trim(blocks: Blocks, shares: _Shares, memory: _Memory, robot: int) -> None:
    """Take the blocks from a robot that it does not need, and note its load."""
    size = _grow(blocks, shares, memory, robot)
    shares.loads[robot] = _need(blocks, shares, memory, robot, size)
    for index in range(1, size):
        here = memory.tree[index]
        if not memory.is_needed[here]:
            shares.sets[here] &= ~(1 << robot)


@lean_kernel
def _cut(shares: _Shares, memory: _Memory, block: int, size: int) -> int:
    """List the needed blocks of the branch of a tree at a block; return how many they are."""
    count = 0
    for index in range(1, size):
        here = memory.tree[index]
        if here == block or memory.in_branch[memory.parent[here]]:
            memory.in_branch[here] = True
            if memory.is_needed[here]:
                memory.around[count] = here
                memory.reached[here], memory.way[here] = memory.clock[0], 0
                count += 1
    return count


@lean_kernel
def _load_of_branch(
    blocks: Blocks, shares: _Shares, memory: _Memory, giver: int, taker: int, count: int
) -> int:
    """Return the load that a branch is for a robot that takes it over."""
    load = 0
    for index in range(count):
        here = memory.around[index]
        has = shares.loads[taker] > 0 and shares.sets[here] >> taker & 1 > 0
        if shares.owner[here] == giver:
            load += blocks.own[here] - (blocks.passing[here] if has else 0)
        elif not has:
            load += blocks.passing[here]
    return load


@lean_kernel
def _best_taker(
    blocks: Blocks, shares: _Shares, memory: _Memory, giver: int, count: int, among: int
) -> tuple[int, int, int]:
    """Find the robot to which a branch is worth most.

    Args:
        blocks, shares, memory: the branch first in ``memory.around``.
        giver: who has it.
        count: number of its blocks.
        among: how many robots, the fewest blocks away; all of the last block are asked.

    Returns:
        the robot, NONE for none, the nearest block that it has, and the energy that it adds.
    """
    around, way, sets, robots = memory.around, memory.way, shares.sets, shares.starts.size
    taker, meets, least = NONE, NONE, 0
    met = 1 << giver
    at, end = 0, count
    while at < end and among > 0:
        here = around[at]
        # A robot at work has the last block of the way already.
        last = blocks.passing[here] if at >= count else 0
        at += 1
        for robot in range(robots if sets[here] & ~met else 0):
            if sets[here] & ~met & 1 << robot:
                met |= 1 << robot
                among -= 1
                load = way[here] - (last if shares.loads[robot] else 0)
                load += _load_of_branch(blocks, shares, memory, giver, robot, count)
                energy = _energy(shares, robot, load)
                if taker == NONE or energy < least:
                    taker, meets, least = robot, here, energy
        for there in blocks.beside[blocks.begins[here] : blocks.begins[here + 1]]:
            if memory.reached[there] != memory.clock[0]:
                memory.reached[there], memory.inward[there] = memory.clock[0], here
                way[there] = way[here] + blocks.passing[there]
                around[end] = there
                end += 1
    return taker, meets, least


@lean_kernel
def _hand_over_branch(
    blocks: Blocks, shares: _Shares, memory: _Memory, block: int, among: int, limit: int
) -> None:
    """Hand over the branch of its owner's blocks at a block, if that adds no more than a limit."""
    owner, sets = shares.owner, shares.sets
    giver = owner[block]
    if block == shares.starts[giver]:
        return
    size = _grow(blocks, shares, memory, giver)
    _need(blocks, shares, memory, giver, size)
    count = _cut(shares, memory, block, size)
    left = _need(blocks, shares, memory, giver, size)
    taker, meets, energy = _best_taker(blocks, shares, memory, giver, count, among)
    if taker == NONE or energy + _energy(shares, giver, left - shares.loads[giver]) > limit:
        return
    while memory.way[meets]:
        sets[meets] |= 1 << taker
        meets = memory.inward[meets]
    for here in memory.tree[:size]:
        if memory.in_branch[here]:
            sets[here] &= ~(1 << giver)
    for here in memory.around[:count]:
        sets[here] |= 1 << taker
        if owner[here] == giver:
            owner[here] = taker
    _trim(blocks, shares, memory, giver)
    _trim(blocks, shares, memory, taker)


@lean_kernel
def _hand_over(
    blocks: Blocks, shares: _Shares, memory: _Memory, block: int, bits: int, limit: int
) -> None:
    """Hand a block to a robot that passes through it, if that adds no more than a limit."""
    giver = shares.owner[block]
    others = shares.sets[block] & ~(1 << giver)
    if not others:
        return
    taker = member(others, shares.starts.size, bits)
    more = blocks.own[block] - (blocks.passing[block] if shares.loads[taker] else 0)
    size = _grow(blocks, shares, memory, giver)
    shares.owner[block] = taker
    less = _need(blocks, shares, memory, giver, size) - shares.loads[giver]
    if _energy(shares, giver, less) + _energy(shares, taker, more) > limit:
        shares.owner[block] = giver
    else:
        _trim(blocks, shares, memory, giver)
        _trim(blocks, shares, memory, taker)


@lean_kernel
def _begin(blocks: Blocks, shares: _Shares, memory: _Memory) -> None:
    """Give each block to the robot that comes to it first."""
    owner, queue, count = shares.owner, memory.around, 0
    owner[:] = NONE
    for robot in range(shares.starts.size):
        block = shares.starts[robot]
        shares.sets[block] |= 1 << robot
        if owner[block] == NONE:
            owner[block], queue[count] = robot, block
            count += 1
    at = 0
    while at < count:
        here = queue[at]
        at += 1
        for there in blocks.beside[blocks.begins[here] : blocks.begins[here + 1]]:
            if owner[there] == NONE:
                owner[there], queue[count] = owner[here], there
                shares.sets[there] |= 1 << owner[here]
                count += 1
    for robot in range(shares.starts.size):
        _trim(blocks, shares, memory, robot)


@kernel
def share_blocks(
    blocks: Blocks,
    starts: NDArray[np.int64],
    proposals: int,
    hot: int,
    cold: int,
    price: int,
    far: int,
    random: NDArray[np.uint64],
    owner: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Share blocks among robots.

    Args:
        blocks: of a connected ground.
        starts: int64 (k,), 2 <= k <= MOST_ROBOTS, block of each robot's start.
        proposals: how many.
        hot, cold: temperatures from the first proposal to the last, in energy.
        price: energy of a unit of load; to deviate from the mean by one has an energy of 1.
        far: of 256 branches those that go to the best of all robots, not of the nearest.
        random: stream, uint64 (1,); advanced.
        owner: int64 (m,), out: who has each block.

    Returns:
        the robots that own or pass each block or start in it, a bit each, int64 (m,), and the loads
        of the robots, int64 (k,).
    """
    count, robots = blocks.own.size, starts.size
    sets, loads = np.zeros(count, np.int64), np.zeros(robots, np.int64)
    shares = _Shares(owner, sets, starts, loads, blocks.own.sum() // robots, price)
    memory = _Memory(
        np.empty(count, np.int64),
        np.empty(count, np.int64),
        np.zeros(count, np.int64),
        np.zeros(count, np.bool_),
        np.zeros(count, np.bool_),
        np.empty(count, np.int64),
        np.empty(count, np.int64),
        np.zeros(count, np.int64),
        np.zeros(count, np.int64),
        np.zeros(1, np.int64),
    )
    _begin(blocks, shares, memory)
    stages, heat = 1, hot
    while heat > cold:
        heat -= max(heat // COOLING, 1)
        stages += 1
    heat = hot
    for stage in range(stages):
        for _ in range(proposals * stage // stages, proposals * (stage + 1) // stages):
            bits, limit = draw(random), most_energy(heat, draw(random))
            block = index_of(bits, count)
            if bits & 255 >= BRANCHES:
                _hand_over(blocks, shares, memory, block, bits >> 8, limit)
            else:
                bits = draw(random)
                among = robots if bits & 255 < far else 1 + (bits >> 8) % NEAREST
                _hand_over_branch(blocks, shares, memory, block, among, limit)
        heat -= max(heat // COOLING, 1)
    return sets, loads
