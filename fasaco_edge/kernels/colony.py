"""Ants of one cohort: equations (4) to (8) and the inner loops of Algorithm 1.

Source: Carr and Wang, "Fast-Spanning Ant Colony Optimisation (FaSACO) for
Mobile Robot Coverage Path Planning", 2022.

===========  ==========================================  ======================
Eq. (4)      pseudo-random proportional rule             ``_choose``
Eq. (5)      visibility; 1 for every neighbour, so       left out
             ``eta ** beta`` drops out
Eq. (6)      probability of the other branch of (4)      ``_choose``
Eq. (7)      local update, after every move              ``_step``
Eq. (8)      global update along the best walk           ``deposit``
===========  ==========================================  ======================

Where the paper is silent: a tie in (4) goes straight on; a dead end is left by
the shortest walk to the nearest cell not yet covered, whose moves are moves
like any other, (7) included. The paper prints "max p_k" for the second branch
of (4), which would make it the first again; as in ant colony systems, (6) is
drawn from.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel

NO_DIRECTION = -1
WORD = 0xFFFFFFFF


class Field(NamedTuple):
    """Where ants walk. Cells are flat indices ``row * cols + col``; n of them.

    Attributes:
        steps: step masks, uint8 (n,).
        to_cover: uint8 (n,), 1 where a visit is asked for.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        trail: pheromone on the move out of a cell in each direction, float64 (n, 4).
    """

    steps: NDArray[np.uint8]
    to_cover: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    trail: NDArray[np.float64]


class Rules(NamedTuple):
    """Constants of equations (4) to (8): q0, alpha and tau0; and the end of the walk."""

    q0: float
    alpha: float
    tau0: float
    return_home: bool


class Scratch(NamedTuple):
    """Working memory of one thread, n cells.

    Attributes:
        open: uint8 (n,), cells the current ant has not covered.
        seen: int64 (n,), number of the last search that reached the cell.
        came_from: int8 (n,), direction by which it was reached.
        queue: int64 (n,).
        searches: int64 (1,), how many searches there were.
    """

    open: NDArray[np.uint8]
    seen: NDArray[np.int64]
    came_from: NDArray[np.int8]
    queue: NDArray[np.int64]
    searches: NDArray[np.int64]


@kernel
def _draw(state: NDArray[np.int64]) -> float:
    """Advance a xoshiro128++ stream (Blackman and Vigna 2019); return a number in [0, 1).

    Words live in int64 and are masked, so that nothing overflows in plain Python.
    """
    total = (state[0] + state[3]) & WORD
    word = ((((total << 7) & WORD) | (total >> 25)) + state[0]) & WORD
    shifted = (state[1] << 9) & WORD
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= shifted
    state[3] = ((state[3] << 11) & WORD) | (state[3] >> 21)
    return float(word / 4294967296.0)


@kernel
def _choose(
    field: Field, scratch: Scratch, q0: float, here: int, heading: int, random: NDArray[np.int64]
) -> int:
    """Return the direction of the next move by equation (4), or NO_DIRECTION at a dead end."""
    mask = field.steps[here]
    total, best, best_value, options = 0.0, NO_DIRECTION, -1.0, 0
    for turn in range(4):
        direction = (heading + turn) & 3
        if mask >> direction & 1 and scratch.open[here + field.offsets[direction]]:
            value = field.trail[here, direction]
            total += value
            options += 1
            if value > best_value:
                best, best_value = direction, value
    if options <= 1 or _draw(random) <= q0:
        return best
    # Eq. (6)
    left = _draw(random) * total
    for turn in range(4):
        direction = (heading + turn) & 3
        if mask >> direction & 1 and scratch.open[here + field.offsets[direction]]:
            best = direction
            left -= field.trail[here, direction]
            if left < 0.0:
                break
    return best


@kernel
def _find(field: Field, scratch: Scratch, here: int, goal: int) -> int:
    """Search breadth first; return ``goal``, or with goal -1 the nearest open cell."""
    scratch.searches[0] += 1
    search = scratch.searches[0]
    scratch.seen[here] = search
    scratch.queue[0] = here
    head, tail = 0, 1
    while head < tail:
        cell = scratch.queue[head]
        head += 1
        for direction in range(4):
            if not field.steps[cell] >> direction & 1:
                continue
            after = cell + field.offsets[direction]
            if scratch.seen[after] == search:
                continue
            scratch.seen[after] = search
            scratch.came_from[after] = direction
            if after == goal or (goal < 0 and scratch.open[after]):
                return int(after)
            scratch.queue[tail] = after
            tail += 1
    return here


@kernel
def _step(field: Field, rules: Rules, here: int, direction: int) -> int:
    """Make one move, with the local update of equation (7); return the new cell."""
    trail = field.trail[here, direction]
    field.trail[here, direction] = (1.0 - rules.alpha) * trail + rules.alpha * rules.tau0
    return int(here + field.offsets[direction])


@kernel
def _reserve(walk: NDArray[np.int64], length: int) -> NDArray[np.int64]:
    """Return ``walk``, or a longer copy where it cannot hold ``length`` entries."""
    if length <= walk.size:
        return walk
    longer = np.empty(2 * length, np.int64)
    longer[: walk.size] = walk
    return longer


@kernel
def _go_to(
    field: Field, rules: Rules, scratch: Scratch, walk: NDArray[np.int64], length: int, goal: int
) -> tuple[NDArray[np.int64], int]:
    """Append the shortest walk to ``goal`` (-1: the nearest open cell), without its start."""
    here = walk[length - 1]
    goal = _find(field, scratch, here, goal)
    distance, cell = 0, goal
    while cell != here:
        cell -= field.offsets[scratch.came_from[cell]]
        distance += 1
    walk = _reserve(walk, length + distance)
    cell = goal
    for index in range(length + distance - 1, length - 1, -1):
        walk[index] = cell
        cell -= field.offsets[scratch.came_from[cell]]
    for index in range(length, length + distance):
        _step(field, rules, walk[index - 1], scratch.came_from[walk[index]])
    return walk, length + distance


@kernel
def _walk_one(
    field: Field,
    rules: Rules,
    scratch: Scratch,
    walk: NDArray[np.int64],
    start: int,
    velocity: int,
    random: NDArray[np.int64],
) -> tuple[NDArray[np.int64], int]:
    """Let one ant walk until every cell is covered; return its walk and the walk's length."""
    scratch.open[:] = field.to_cover
    remaining = np.sum(field.to_cover) - scratch.open[start]
    scratch.open[start] = 0
    walk[0] = start
    here, length, heading = start, 1, 0
    while remaining > 0:
        direction = _choose(field, scratch, rules.q0, here, heading, random)
        if direction == NO_DIRECTION:
            walk, length = _go_to(field, rules, scratch, walk, length, -1)
            here = walk[length - 1]
            heading = scratch.came_from[here]
            scratch.open[here] = 0
            remaining -= 1
            continue
        heading = direction
        walk = _reserve(walk, length + velocity)
        # A cohort of velocity v keeps straight on for up to v cells.
        for _ in range(velocity):
            here = _step(field, rules, here, direction)
            walk[length] = here
            length += 1
            scratch.open[here] = 0
            remaining -= 1
            straight_on = field.steps[here] >> direction & 1
            if not (straight_on and scratch.open[here + field.offsets[direction]]):
                break
    if rules.return_home and here != start:
        walk, length = _go_to(field, rules, scratch, walk, length, start)
    return walk, length


@kernel
def walk_ants(
    field: Field,
    rules: Rules,
    scratch: Scratch,
    start: int,
    velocity: int,
    streams: NDArray[np.int64],
    best: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Let ants walk one after the other; return the shortest walk, theirs or ``best``.

    Args:
        field: where they walk; the trail is updated.
        rules: constants.
        scratch: working memory.
        start: the cell all ants start from, from which all of ``to_cover`` is reachable.
        velocity: cells an ant keeps straight on for, at least 1.
        streams: int64 (ants, 4): state of each ant's random stream, words of 32 bits,
            not all zero; advanced in place.
        best: the best walk so far, int64 (length,); empty where there is none.
    """
    walk = np.empty(2 * field.steps.size + velocity, np.int64)
    for ant in range(streams.shape[0]):
        walk, length = _walk_one(field, rules, scratch, walk, start, velocity, streams[ant])
        if best.size == 0 or length < best.size:
            best = walk[:length].copy()
    return best


@kernel
def deposit(field: Field, alpha: float, amount: float, best: NDArray[np.int64]) -> None:
    """Strengthen the trail along ``best`` by equation (8), ``amount`` being delta phi."""
    for index in range(best.size - 1):
        here, gap = best[index], best[index + 1] - best[index]
        for direction in range(4):
            if field.offsets[direction] == gap and field.steps[here] >> direction & 1:
                trail = field.trail[here, direction]
                field.trail[here, direction] = (1.0 - alpha) * trail + alpha * amount
                break
