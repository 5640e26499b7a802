"""Changes of a walk's step parities, which local search cannot make: a moved end, a loop.

A covering walk's length depends only on the multiplicity of each step: any connected
multiplicities with an odd sum only at the walk's two ends form a walk (Euler). Along a
path or a loop each multiplicity changes by one, down if the step is walked twice, up
otherwise: the walk stays connected, and its ends move, or the walk passes a hole on
another side. A shortest-path search in which steps walked twice cost 0 proposes such
paths: it prefers those that remove many steps and add few.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import NORTH
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import LENGTH, Ground, Walk, axis_of
from fasaco_edge.kernels.random import draw, index_of

# Odds of a change by the growth of the walk in steps, from -16 on: e ** (-steps / 3), as
# integers.
SHORTEST = -16
ODDS = np.round(np.exp(-(np.arange(64) + SHORTEST) / 3.0) * 65536).astype(np.int64)

NOWHERE = -1
JUMPS = 0
DRAWS = 1 << 20


class Tally(NamedTuple):
    """Multiplicities of steps, and working memory for the search over them.

    Attributes:
        times: int16 (n, 2), multiplicities of the steps east and north of a cell.
        order_of_old: int8 (n, 4), by direction of entering a cell, the direction of leaving it
            in the old walk, read from its end; -1 for none.
        rays: int64 (n,), see ``holes.rays``.
        reached: int64 (n,), number of the search that reached the cell, doubled; one
            more once its distance is settled.
        distance: int32 (n,), steps on the path to the cell that are walked less than twice.
        growth: int32 (n,), growth of the walk by a change along the path to the cell.
        parent: int32 (n,), the cell before it on the path.
        crossed: int64 (n,), rays crossed on the path.
        order: int32 (n,), cells in the order they were settled.
        near, far: int32 (4 * n,), cells to search now, and one step later.
        loops: int64 (n, 2), loops found: twice the cell, one more for the step north;
            and their odds.
        marked: int64 (n,), number of the last climb that passed the cell.
        clock: int64 (2,), numbers given to searches and climbs.
        stack: int32 (capacity of the walk,).
        counts: int64 (1,), number of JUMPS.
        jump_ends: int32 (jumps, 2), the cells a jump leads between. Jump i stands in the
            walk as cell n + i, between its two cells.
        next_jump: int32 (jumps, 2), the next in the list of jumps from that cell.
        jumped: uint8 (jumps,), whether it was made.
        links: int32 (n,), -1: first in the list of the cell's jumps, twice its number
            and one more for its second end.
    """

    times: NDArray[np.int16]
    order_of_old: NDArray[np.int8]
    rays: NDArray[np.int64]
    reached: NDArray[np.int64]
    distance: NDArray[np.int32]
    growth: NDArray[np.int32]
    parent: NDArray[np.int32]
    crossed: NDArray[np.int64]
    order: NDArray[np.int32]
    near: NDArray[np.int32]
    far: NDArray[np.int32]
    loops: NDArray[np.int64]
    marked: NDArray[np.int64]
    clock: NDArray[np.int64]
    stack: NDArray[np.int32]
    counts: NDArray[np.int64]
    jump_ends: NDArray[np.int32]
    next_jump: NDArray[np.int32]
    jumped: NDArray[np.uint8]
    links: NDArray[np.int32]


@inlined
def _direction(ground: Ground, one: int, other: int) -> int:
    for direction in range(4):
        if ground.offsets[direction] == other - one:
            return direction
    return -1


@lean_inner_kernel
def note_order(ground: Ground, walk: Walk, tally: Tally) -> None:
    """Set ``order_of_old`` from the walk."""
    bound, cells = ground.bound, walk.cells
    tally.order_of_old[:] = -1
    for index in range(1, walk.counts[LENGTH] - 1):
        before, here, after = cells[index - 1], cells[index], cells[index + 1]
        if before < bound and here < bound and after < bound:
            came = _direction(ground, after, here)
            tally.order_of_old[here, came] = _direction(ground, here, before)


@lean_inner_kernel
def count_steps(ground: Ground, walk: Walk, tally: Tally) -> None:
    """Set ``times`` from the walk; jumps are not steps."""
    bound = ground.bound
    tally.times[:] = 0
    for index in range(walk.counts[LENGTH] - 1):
        one, other = walk.cells[index], walk.cells[index + 1]
        if one < bound and other < bound:
            tally.times[min(one, other), axis_of(one, other)] += 1


@lean_inner_kernel
def search_ways(
    ground: Ground, tally: Tally, root: int, limit: int, random: NDArray[np.uint64]
) -> int:
    """Search from ``root`` with cost 0 for steps walked twice (0-1 breadth first).

    Returns:
        Number of settled cells, at most about ``limit``: ``order`` has them.
    """
    tally.clock[0] += 2
    now = tally.clock[0]
    near, far = tally.near, tally.far
    near[0] = root
    tally.reached[root] = now
    tally.distance[root] = tally.growth[root] = 0
    tally.crossed[root] = 0
    tally.parent[root] = NOWHERE
    head, near_size, far_size, settled = 0, 1, 0, 0
    while settled < limit:
        if head == near_size:
            if far_size == 0:
                break
            near, far = far, near
            head, near_size, far_size = 0, far_size, 0
        here = near[head]
        head += 1
        if tally.reached[here] == now + 1:
            continue
        tally.reached[here] = now + 1
        tally.order[settled] = here
        settled += 1
        first = draw(random) & 3
        for turn in range(4):
            direction = (first + turn) & 3
            if not ground.steps[here] >> direction & 1:
                continue
            after = here + ground.offsets[direction]
            if tally.reached[after] == now + 1:
                continue
            edge, axis = min(here, after), direction & 1
            doubled = tally.times[edge, axis] >= 2
            distance = tally.distance[here] + (0 if doubled else 1)
            if tally.reached[after] == now and distance >= tally.distance[after]:
                continue
            tally.reached[after] = now
            tally.distance[after] = distance
            tally.parent[after] = here
            tally.growth[after] = tally.growth[here] + (-1 if doubled else 1)
            tally.crossed[after] = tally.crossed[here]
            if axis == 1:
                tally.crossed[after] ^= tally.rays[edge]
            if doubled:
                near[near_size] = after
                near_size += 1
            else:
                far[far_size] = after
                far_size += 1
    return settled


@inlined
def _odds(growth: int) -> int:
    return int(ODDS[min(max(growth - SHORTEST, 0), ODDS.size - 1)])


@inlined
def change_step(times: NDArray[np.int16], one: int, other: int) -> None:
    """Decrease the multiplicity of a step that is walked twice, else increase it."""
    edge, axis = min(one, other), axis_of(one, other)
    times[edge, axis] += -1 if times[edge, axis] >= 2 else 1


@lean_inner_kernel
def draw_end(tally: Tally, settled: int, random: NDArray[np.uint64]) -> int:
    """Draw another end for the walk, with odds by the walk's growth."""
    total = 0
    for index in range(1, settled):
        total += _odds(tally.growth[tally.order[index]])
    left = (index_of(draw(random), DRAWS) * total) >> 20
    for index in range(1, settled):
        left -= _odds(tally.growth[tally.order[index]])
        if left < 0:
            return int(tally.order[index])
    return int(tally.order[settled - 1])


@lean_inner_kernel
def common_ancestor(tally: Tally, one: int, other: int) -> int:
    """Return the last common cell of the paths to two settled cells."""
    tally.clock[1] += 1
    climb = tally.clock[1]
    while one != NOWHERE:
        tally.marked[one] = climb
        one = tally.parent[one]
    while tally.marked[other] != climb:
        other = tally.parent[other]
    return other


@lean_inner_kernel
def find_loops(ground: Ground, tally: Tally, settled: int) -> int:
    """List the steps that close a loop around a hole in ``loops``; return their number."""
    now, found = tally.clock[0], 0
    for index in range(settled):
        here = tally.order[index]
        for direction in range(NORTH + 1):
            if not ground.steps[here] >> direction & 1:
                continue
            after = here + ground.offsets[direction]
            if tally.reached[after] != now + 1:
                continue
            if tally.parent[here] == after or tally.parent[after] == here:
                continue
            crossed = tally.crossed[here] ^ tally.crossed[after]
            if direction == NORTH:
                crossed ^= tally.rays[here]
            if crossed == 0 or found == tally.loops.shape[0]:
                continue
            shared = common_ancestor(tally, here, after)
            growth = tally.growth[here] + tally.growth[after] - 2 * tally.growth[shared]
            growth += -1 if tally.times[here, direction] >= 2 else 1
            tally.loops[found, 0] = 2 * here + direction
            tally.loops[found, 1] = _odds(growth)
            found += 1
    return found


@lean_inner_kernel
def draw_loop(tally: Tally, found: int, random: NDArray[np.uint64]) -> int:
    """Return one of the loops found, by its odds."""
    total = 0
    for index in range(found):
        total += tally.loops[index, 1]
    left = (index_of(draw(random), DRAWS) * total) >> 20
    for index in range(found):
        left -= tally.loops[index, 1]
        if left < 0:
            return int(tally.loops[index, 0])
    return int(tally.loops[found - 1, 0])


@inlined
def _heading(ground: Ground, tally: Tally, depth: int) -> int:
    """Return how to go on from the stack's top: as in the old walk, or straight; -1 for any."""
    if depth < 2:
        return -1
    here = tally.stack[depth - 1]
    came = _direction(ground, tally.stack[depth - 2], here)
    if came < 0:
        return -1
    known = tally.order_of_old[here, came]
    return int(known) if known >= 0 else came


@lean_inner_kernel
def _list_jumps(tally: Tally) -> None:
    """Build the list of jumps of each cell, which begins with the cell's ``links``."""
    for jump in range(tally.counts[JUMPS]):
        for side in range(2):
            cell = tally.jump_ends[jump, side]
            tally.next_jump[jump, side] = tally.links[cell]
            tally.links[cell] = 2 * jump + side
        tally.jumped[jump] = 0


@inlined
def _next_step(ground: Ground, tally: Tally, here: int, heading: int) -> int:
    """Take an unused step; return its direction, or -1."""
    for turn in range(4):
        direction = (heading + turn) & 3
        after = here + ground.offsets[direction]
        edge = min(here, after)
        if tally.times[edge, direction & 1] > 0:
            tally.times[edge, direction & 1] -= 1
            return direction
    return -1


@inlined
def _next_jump(tally: Tally, here: int) -> int:
    """Take an unused jump; return twice its number plus its side, or -1."""
    while tally.links[here] >= 0:
        link = tally.links[here]
        tally.links[here] = tally.next_jump[link >> 1, link & 1]
        # A jump is in two lists, and is made once.
        if not tally.jumped[link >> 1]:
            tally.jumped[link >> 1] = 1
            return int(link)
    return -1


@lean_inner_kernel
def euler_walk(
    ground: Ground,
    walk: Walk,
    tally: Tally,
    end: int,
    random: NDArray[np.uint64],
) -> int:
    """Write into ``walk.cells`` a walk that takes each step as often as ``times`` says.

    Hierholzer's algorithm from the walk's ``end``, so that its result begins with the
    start. Uses up ``times``. If there is a choice it continues like the old walk
    (``order_of_old``), or straight. Returns the walk's length.
    """
    bound, stack = ground.bound, tally.stack
    _list_jumps(tally)
    stack[0] = end
    depth, length = 1, 0
    while depth:
        here = stack[depth - 1]
        if here < bound:
            heading = _heading(ground, tally, depth)
            if heading < 0:
                heading = draw(random) & 3
            direction = _next_step(ground, tally, here, heading)
            if direction >= 0:
                stack[depth] = here + ground.offsets[direction]
                depth += 1
                continue
            link = _next_jump(tally, here)
            if link >= 0:
                stack[depth] = bound + (link >> 1)
                stack[depth + 1] = tally.jump_ends[link >> 1, 1 - (link & 1)]
                depth += 2
                continue
        walk.cells[length] = here
        length += 1
        depth -= 1
    return length
