"""Splitting a closed walk into two closed walks, for two groups of robots.

A closed walk can be split without an extra step where it passes a cell twice, and where it passes
two neighbouring cells in one direction and the two beside them in the other: the two steps across
replace the two along. Anywhere else each side needs one more step, between two neighbouring cells
that the walk visits. All of these places are tried.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.lattice.reach import UNSEEN, search

NONE = -1
# Distance of an unreachable cell [steps]; twice this does not overflow.
FAR = 1 << 28
# Weight of the worst share relative to the sum of all shares.
WORST = 4


@lean_kernel
def _nearest(tables: NDArray[np.int32], robot: int, begin: int, count: int) -> int:
    """Return a robot's least distance to ``count`` visits from ``begin`` on, read cyclically."""
    level = 0
    while 2 << level <= count:
        level += 1
    first = tables[robot, level, begin]
    last = tables[robot, level, begin + count - (1 << level)]
    return int(min(first, last))


@lean_kernel
def _worst_share(first_us: int, second_us: int, robots: int) -> int:
    """Return the least worst share of ``robots`` in two parts, without distances."""
    worst = first_us + second_us
    for count in range(1, robots):
        worst = min(worst, max(first_us // count, second_us // (robots - count)))
    return worst


class _Places(NamedTuple):
    """The closed walk that is to be split.

    Attributes:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        walk: int32 (n,), flat cells.
    """

    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    walk: NDArray[np.int32]


class _Parts(NamedTuple):
    """Two parts of it: the first visit and the number of visits of each; no visits for none."""

    first: int
    firsts: int
    second: int
    seconds: int


# Kinds of splits: at a cell that is passed twice, at two steps side by side in opposite directions,
# at two neighbouring cells.
TWICE, ABREAST, BESIDE = 0, 1, 2


@lean_kernel
def _parts(places: _Places, kind: int, index: int, other: int, direction: int) -> _Parts:
    """Return the parts if the walk is split at visits ``index`` and ``other``.

    Where these are not of one cell, ``direction`` leads from one to the other.
    """
    steps, offsets, walk = places
    visits = walk.size
    if kind != ABREAST:
        # Each of two neighbouring cells is visited by both parts.
        more = 1 if kind == BESIDE else 0
        if other <= index:
            return _Parts(0, 0, 0, 0)
        return _Parts(index, other - index + more, other, visits - (other - index) + more)
    after = index + 1 if index + 1 < visits else 0
    before = other - 1 if other else visits - 1
    is_open = steps[walk[after]] >> direction & 1
    if not is_open or walk[before] != walk[after] + offsets[direction]:
        return _Parts(0, 0, 0, 0)
    count, rest = (before - after) % visits + 1, (index - other) % visits + 1
    if count + rest != visits:
        return _Parts(0, 0, 0, 0)
    return _Parts(after, count, other, rest)


class _Shares(NamedTuple):
    """Data to score parts, and working memory.

    Attributes:
        costs_us: int64 (2n + 1,), cumulative costs of visits, over the walk twice [us].
        nearest: int32 (k, levels, 2n), least distances to 1, 2, 4 ... visits from each on [steps].
        step_us: cost of a step [us].
        ways: int64 (2, k), each robot's distance to either part [steps].
        gains: int64 (k,), of the first part over the second.
        order: int64 (k,), robots, those nearest to the first part first.
    """

    costs_us: NDArray[np.int64]
    nearest: NDArray[np.int32]
    step_us: int
    ways: NDArray[np.int64]
    gains: NDArray[np.int64]
    order: NDArray[np.int64]


@lean_kernel
def _deal(shares: _Shares, first_us: int, second_us: int) -> tuple[int, int]:
    """Assign robots to two parts of a walk by their distances; return the score, and how many.

    In order of the difference of the two distances; the two robots next to the dividing point may
    be swapped, as the sum of all distances says little about the worst share.

    ``shares.order`` has the robots then, those of the first part first.
    """
    gains, order, ways = shares.gains, shares.order, shares.ways
    robots, out_and_back_us = order.size, 2 * shares.step_us
    second = 0
    for robot in range(robots):
        gain = ways[0, robot] - ways[1, robot]
        at = robot
        while at > 0 and gains[at - 1] > gain:
            gains[at], order[at] = gains[at - 1], order[at - 1]
            at -= 1
        gains[at], order[at] = gain, robot
        second += ways[1, robot]
    first, best, share, is_changed = 0, -1, 0, False
    for count in range(1, robots):
        last, following = order[count - 1], order[count]
        first += ways[0, last]
        second -= ways[1, last]
        for change in range(2):
            to_first, to_second = first, second
            if change:
                to_first += ways[0, following] - ways[0, last]
                to_second += ways[1, last] - ways[1, following]
            one_us = first_us + to_first * out_and_back_us
            other_us = second_us + to_second * out_and_back_us
            worst = max(one_us // count, other_us // (robots - count))
            score = WORST * worst + one_us + other_us
            if best < 0 or score < best:
                best, share, is_changed = score, count, change == 1
    if is_changed:
        order[share - 1], order[share] = order[share], order[share - 1]
    return best, share


@lean_kernel
def _score(shares: _Shares, parts: _Parts, best: int) -> tuple[int, int]:
    """Return the parts' score and the number of robots for the first; -1 if not below best."""
    robots = shares.order.size
    first_us = shares.costs_us[parts.first + parts.firsts] - shares.costs_us[parts.first]
    second_us = shares.costs_us[parts.second + parts.seconds] - shares.costs_us[parts.second]
    least = WORST * _worst_share(first_us, second_us, robots) + first_us + second_us
    if 0 <= best <= least:
        return -1, 0
    for robot in range(robots):
        shares.ways[0, robot] = _nearest(shares.nearest, robot, parts.first, parts.firsts)
        shares.ways[1, robot] = _nearest(shares.nearest, robot, parts.second, parts.seconds)
    score, share = _deal(shares, first_us, second_us)
    if 0 <= best <= score:
        return -1, 0
    return score, share


@kernel
def best_split(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    walk: NDArray[np.int32],
    costs_us: NDArray[np.int64],
    ways: NDArray[np.int32],
    step_us: int,
    found: NDArray[np.int64],
    order: NDArray[np.int64],
) -> bool:
    """Find the best split of a closed walk in two, and the robots of each part.

    The best split has the cheapest worst share, then the cheapest sum of shares: the robots of a
    part get equal shares, and each drives out to it and back.

    Args:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        walk: int32 (n,), n >= 2, flat cells; from the last one a step leads to the first.
        costs_us: int64 (2n + 1,), what the first visits cost, the walk gone through twice [us].
        ways: int32 (k, size), k >= 2, steps from each robot's start to each cell, FAR at most.
        step_us: of a step [us].
        found: int64 (5,), out: the first visit and the number of visits of the first part, of the
            second part, and how many robots drive the first one.
        order: int64 (k,), out: the robots, those of the first part first.

    Returns:
        whether there is any such place.
    """
    places, robots = _Places(steps, offsets, walk), ways.shape[0]
    head = np.full(steps.size, NONE, np.int64)
    following = np.empty(walk.size, np.int64)
    for index in range(walk.size - 1, -1, -1):
        following[index] = head[walk[index]]
        head[walk[index]] = index
    shares = _Shares(
        costs_us,
        _nearest_tables(walk, ways),
        step_us,
        np.empty((2, robots), np.int64),
        np.empty(robots, np.int64),
        np.empty(robots, np.int64),
    )
    best = -1
    for index in range(walk.size):
        here = walk[index]
        # The cell itself, then its neighbours.
        for direction in range(-1, 4):
            if direction >= 0 and not steps[here] >> direction & 1:
                continue
            other = head[here if direction < 0 else here + offsets[direction]]
            while other != NONE:
                for kind in range(TWICE if direction < 0 else ABREAST, BESIDE + 1):
                    if direction < 0 < kind:
                        break
                    parts = _parts(places, kind, index, other, direction)
                    if not parts.firsts:
                        continue
                    score, share = _score(shares, parts, best)
                    if score >= 0:
                        best = score
                        found[0], found[1] = parts.first, parts.firsts
                        found[2], found[3] = parts.second, parts.seconds
                        found[4] = share
                        order[:] = shares.order
                other = following[other]
    return best >= 0


@kernel
def _nearest_tables(walk: NDArray[np.int32], ways: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the least ways to 1, 2, 4 ... visits from each on, int32 (k, levels, 2n)."""
    visits, robots = walk.size, ways.shape[0]
    levels = 1
    while 2 << (levels - 1) <= visits:
        levels += 1
    tables = np.empty((robots, levels, 2 * visits), np.int32)
    for robot in range(robots):
        for index in range(2 * visits):
            tables[robot, 0, index] = ways[robot, walk[index % visits]]
        for level in range(1, levels):
            half = 1 << (level - 1)
            for index in range(2 * visits):
                far = min(index + half, 2 * visits - 1)
                near = tables[robot, level - 1, index]
                tables[robot, level, index] = min(near, tables[robot, level - 1, far])
    return tables


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
    reached = search(steps.ravel(), offsets, start, -1, came_from, queue)
    ways[start] = 0
    for cell in queue[1:reached]:
        ways[cell] = ways[cell - offsets[came_from[cell]]] + 1
    return ways
