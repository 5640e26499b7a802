"""Ants that rebuild a disc of a walk: a perturbation for local search.

The cells of a disc are opened. Each stretch of the walk outside of it is a tunnel: an ant enters it
at either end and leaves it at the other. So an ant may join lanes that are far apart in the walk.
The first stretch stays first, and the last one last. An ant chooses its moves by equations (4) to
(6) of Carr and Wang 2022 (``kernels.ants.colony``), where eta in (5) is 1 over the seconds of a
move with its turns. Ants of velocity v keep straight on for up to v cells. A dead end is left by
the shortest way to the nearest open cell or tunnel.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel
from fasaco_edge.kernels.local_search.regions import neighbourhood
from fasaco_edge.kernels.local_search.walk_array import (
    LENGTH,
    Ground,
    Prices,
    Walk,
    copy,
    leads,
    recount,
)
from fasaco_edge.kernels.random import draw, index_of

# Limits: cells of a disc, tunnels, and items of a sequence, which are cells and tunnels.
MOST_CELLS, MOST_TUNNELS, MOST_ITEMS = 300, 64, 2048
# Cells that a search for the way out of a dead end settles.
FARTHEST = 300
# No heading, as before the first move.
AHEAD = 4
NOTHING = -1
# Entries of ``Colony.counts``.
SEARCHES, DISCS, ANTS, SAVED_US = range(4)


class AntRules(NamedTuple):
    """Constants of the ants.

    Attributes:
        q0, alpha, tau0: of equations (4), (7) and (8).
        powers: float64 (5,): eta ** beta of a move with so many quarter-turns.
        ants: number of ants that rebuild a disc; the cheapest counts.
        radius: least and largest radius of a disc.
        velocities: int64 (cohorts,): velocity of each cohort, which take turns.
        amount: delta phi of equation (8).
    """

    q0: float
    alpha: float
    tau0: float
    powers: NDArray[np.float64]
    ants: int
    radius: tuple[int, int]
    velocities: NDArray[np.int64]
    amount: float


class Colony(NamedTuple):
    """The trail, and the working memory of the ants.

    A sequence describes a walk through a disc: cells, and tunnels as ``-1 - end``. Tunnel i has
    the ends 2 i, its first visit, and 2 i + 1, its last.

    Attributes:
        trail: float64 (n, 4): pheromone on the move out of a cell in each direction, above 0.
        is_open: uint8 (n,): 1 for cells to visit.
        labels: int32 (n,): number of the last disc that held the cell.
        area: int32 (MOST_CELLS,): cells of the disc.
        tunnels: int32 (MOST_TUNNELS, 2): first and last visit of each stretch.
        first_end: int32 (n,): the first tunnel end at a cell, or NOTHING.
        next_end: int32 (2 * MOST_TUNNELS,): the next tunnel end at the same cell, or NOTHING.
        is_taken: uint8 (MOST_TUNNELS + 1,): 1 for tunnels that the ant has passed.
        old, new, best: int32 (MOST_ITEMS,): sequences.
        seen: int32 (n,): number of the last search that reached the cell.
        came_from: int8 (n,): direction by which it was reached.
        queue: int32 (FARTHEST + 4,).
        counts: int64 (4,): SEARCHES, DISCS, ANTS and SAVED_US so far.
        rules: constants.
    """

    trail: NDArray[np.float64]
    is_open: NDArray[np.uint8]
    labels: NDArray[np.int32]
    area: NDArray[np.int32]
    tunnels: NDArray[np.int32]
    first_end: NDArray[np.int32]
    next_end: NDArray[np.int32]
    is_taken: NDArray[np.uint8]
    old: NDArray[np.int32]
    new: NDArray[np.int32]
    best: NDArray[np.int32]
    seen: NDArray[np.int32]
    came_from: NDArray[np.int8]
    queue: NDArray[np.int32]
    counts: NDArray[np.int64]
    rules: AntRules


class Disc(NamedTuple):
    """A walk folded at a disc.

    Attributes:
        cells: number of cells in the disc.
        tunnels: number of tunnels that an ant passes, without the last stretch.
        items: length of the walk's own sequence.
        head: last visit of the first stretch, or NOTHING if the walk begins in the disc.
        last: number of the last stretch, or NOTHING if the walk ends in the disc.
        goal: the cell in which an ant ends, or NOTHING for anywhere.
    """

    cells: int
    tunnels: int
    items: int
    head: int
    last: int
    goal: int


@inlined
def _unit(random: NDArray[np.uint64]) -> float:
    """Return a random number in [0, 1)."""
    return float(draw(random) >> 10) / 9007199254740992.0


@inlined
def _wide(number: int) -> int:
    """Return a number of an array as a 64-bit integer: the fields of an ant have one type."""
    return int(np.int64(number))


@inlined
def _quarters(one: int, other: int) -> int:
    """Return the quarter-turns between two directions."""
    if one == AHEAD or other == AHEAD or one == other:  # noqa: PLR1714, SIM109 - numba has no `in`
        return 0
    return 2 if one ^ other == 2 else 1


@lean_kernel
def _direction(ground: Ground, one: int, other: int) -> int:
    """Return the direction of a step, or AHEAD for none."""
    for direction in range(4):
        if ground.offsets[direction] == other - one and ground.steps[one] >> direction & 1:
            return direction
    return AHEAD


@lean_kernel
def _end_at(colony: Colony, cell: int) -> int:
    """Return the first tunnel end at a cell that is not taken, or NOTHING."""
    end = colony.first_end[cell]
    while end != NOTHING and colony.is_taken[end >> 1]:
        end = colony.next_end[end]
    return _wide(end)


@lean_kernel
def _inward(ground: Ground, colony: Colony, cells: NDArray[np.int32], end: int) -> int:
    """Return the direction of the first step into a tunnel, or AHEAD if it has no step."""
    first, last = colony.tunnels[end >> 1, 0], colony.tunnels[end >> 1, 1]
    if first == last:
        return AHEAD
    if end & 1:
        return _direction(ground, cells[last], cells[last - 1])
    return _direction(ground, cells[first], cells[first + 1])


@lean_kernel
def _search(ground: Ground, colony: Colony, here: int, goal: int) -> int:
    """Return the nearest open cell or tunnel end, or ``goal`` if it is given; NOTHING if far."""
    colony.counts[SEARCHES] += 1
    number = np.int32(colony.counts[SEARCHES])
    colony.seen[here] = number
    colony.queue[0] = here
    head, tail = 0, 1
    while head < tail < FARTHEST:
        cell = colony.queue[head]
        head += 1
        for direction in range(4):
            after = cell + ground.offsets[direction]
            if not ground.steps[cell] >> direction & 1 or colony.seen[after] == number:
                continue
            colony.seen[after] = number
            colony.came_from[after] = direction
            colony.queue[tail] = after
            tail += 1
            if after == goal:
                return _wide(after)
            if goal == NOTHING and (colony.is_open[after] or _end_at(colony, after) != NOTHING):
                return _wide(after)
    return NOTHING


class _Ant(NamedTuple):
    """An ant: items in ``Colony.new``, its cell and heading, and its cost so far [us]."""

    items: int
    here: int
    heading: int
    cost: int


LOST = _Ant(NOTHING, 0, 0, 0)


@lean_kernel
def _go_to(ground: Ground, prices: Prices, colony: Colony, ant: _Ant, goal: int) -> _Ant:
    """Return the ant at the nearest open cell or tunnel end, or at ``goal``; LOST if that is far.

    The cell that it reaches is not listed.
    """
    found = _search(ground, colony, ant.here, goal)
    if found == NOTHING:
        return LOST
    steps, cell = 0, found
    while cell != ant.here:
        cell -= ground.offsets[colony.came_from[cell]]
        steps += 1
    if ant.items + steps + 2 >= MOST_ITEMS:
        return LOST
    cell = found
    for place in range(ant.items + steps - 2, ant.items - 1, -1):
        cell -= ground.offsets[colony.came_from[cell]]
        colony.new[place] = cell
    cost, heading = ant.cost + steps * prices.step_us, ant.heading
    for place in range(ant.items, ant.items + steps):
        cell = colony.new[place] if place < ant.items + steps - 1 else found
        direction = _wide(colony.came_from[cell])
        cost += _quarters(heading, direction) * prices.quarter_turn_us
        heading = direction
    return _Ant(ant.items + steps - 1, found, heading, cost)


@lean_kernel
def _choose(
    ground: Ground, colony: Colony, cells: NDArray[np.int32], ant: _Ant, random: NDArray[np.uint64]
) -> int:
    """Return a direction to an open cell or tunnel by equation (4); AHEAD for none."""
    rules = colony.rules
    total, best, most, choices = 0.0, AHEAD, 0.0, 0
    for turn in range(4):
        direction = (ant.heading + turn) & 3
        weight = _weight(ground, colony, cells, ant, direction)
        if weight > 0.0:
            total += weight
            choices += 1
        if weight > most:
            best, most = direction, weight
    if choices < 2 or _unit(random) <= rules.q0:
        return best
    # Equation (6)
    left = _unit(random) * total
    for turn in range(4):
        direction = (ant.heading + turn) & 3
        weight = _weight(ground, colony, cells, ant, direction)
        if weight > 0.0:
            best = direction
            left -= weight
            if left < 0.0:
                break
    return best


@lean_kernel
def _weight(
    ground: Ground, colony: Colony, cells: NDArray[np.int32], ant: _Ant, direction: int
) -> float:
    """Return tau * eta ** beta of a move; 0 if it leads to no open cell or tunnel."""
    if not ground.steps[ant.here] >> direction & 1:
        return 0.0
    after = ant.here + ground.offsets[direction]
    end = _end_at(colony, after)
    if not colony.is_open[after] and end == NOTHING:
        return 0.0
    quarters = _quarters(ant.heading, direction)
    if end != NOTHING:
        quarters += _quarters(direction, _inward(ground, colony, cells, end))
    return float(colony.trail[ant.here, direction] * colony.rules.powers[quarters])


@lean_kernel
def _open(ground: Ground, colony: Colony, disc: Disc) -> int:
    """Open the cells and tunnels of a disc; return their number."""
    count = disc.tunnels
    for index in range(disc.cells):
        cell = colony.area[index]
        if ground.needed[cell] > 0:
            colony.is_open[cell] = 1
            count += 1
    colony.is_taken[: disc.tunnels + 1] = 0
    return count


@lean_kernel
def _first(ground: Ground, colony: Colony, cells: NDArray[np.int32], head: int) -> _Ant:
    """Return an ant at the end of the first stretch, or at the walk's first cell."""
    if head == NOTHING:
        colony.new[0] = cells[0]
        return _Ant(as_value(1), _wide(cells[0]), as_value(AHEAD), as_value(0))
    heading = as_value(AHEAD)
    if head > 0:
        heading = _direction(ground, cells[head - 1], cells[head])
    return _Ant(as_value(0), _wide(cells[head]), heading, as_value(0))


@lean_kernel
def _walk_one(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: Colony,
    disc: Disc,
    velocity: int,
    random: NDArray[np.uint64],
) -> tuple[int, int]:
    """Let an ant walk through the disc into ``colony.new``.

    Returns:
        Its items and its cost [us]; NOTHING items if it gave up.
    """
    cells, turn_us = walk.cells, prices.quarter_turn_us
    left = _open(ground, colony, disc)
    ant = _first(ground, colony, cells, disc.head)
    if disc.head == NOTHING:
        left -= colony.is_open[ant.here]
        colony.is_open[ant.here] = 0
    run = 0
    while left > 0:
        if ant.items + 2 >= MOST_ITEMS:
            return NOTHING, 0
        direction = ant.heading
        # A cohort of velocity v keeps straight on for up to v cells.
        is_run = 0 < run < velocity and _weight(ground, colony, cells, ant, direction) > 0.0
        if not is_run:
            direction = _choose(ground, colony, cells, ant, random)
        if direction == AHEAD:
            ant = _go_to(ground, prices, colony, ant, as_value(NOTHING))
            if ant.items == NOTHING:
                return NOTHING, 0
            run = 0
        else:
            cost = prices.step_us + _quarters(ant.heading, direction) * turn_us
            run = run + 1 if is_run else 1
            here = _wide(ant.here + ground.offsets[direction])
            ant = _Ant(ant.items, here, direction, ant.cost + cost)
        end = _end_at(colony, ant.here)
        left -= 1
        if end == NOTHING:
            colony.new[ant.items] = ant.here
            colony.is_open[ant.here] = 0
            ant = _Ant(ant.items + 1, ant.here, ant.heading, ant.cost)
        else:
            ant = _pass(ground, prices, colony, cells, ant, end)
            run = 0
    if disc.goal != NOTHING and (ant.here != disc.goal or disc.last != NOTHING):
        return _end(ground, prices, colony, cells, disc, ant)
    return ant.items, ant.cost


@lean_kernel
def _pass(
    ground: Ground,
    prices: Prices,
    colony: Colony,
    cells: NDArray[np.int32],
    ant: _Ant,
    end: int,
) -> _Ant:
    """Return the ant at the other end of a tunnel."""
    colony.new[ant.items] = -1 - end
    colony.is_taken[end >> 1] = 1
    inward = _inward(ground, colony, cells, end)
    cost = ant.cost + _quarters(ant.heading, inward) * prices.quarter_turn_us
    outward = _inward(ground, colony, cells, end ^ 1)
    heading = ant.heading if outward == AHEAD else (outward + 2) & 3
    here = _wide(cells[colony.tunnels[end >> 1, 1 - (end & 1)]])
    return _Ant(ant.items + 1, here, heading, cost)


@lean_kernel
def _end(
    ground: Ground,
    prices: Prices,
    colony: Colony,
    cells: NDArray[np.int32],
    disc: Disc,
    ant: _Ant,
) -> tuple[int, int]:
    """Let the ant go to its goal; return its items, or NOTHING, and its cost [us]."""
    if ant.here == disc.goal:
        return NOTHING, 0
    ant = _go_to(ground, prices, colony, ant, disc.goal)
    if ant.items == NOTHING:
        return NOTHING, 0
    cost = ant.cost
    if disc.last == NOTHING:
        colony.new[ant.items] = disc.goal
    else:
        colony.new[ant.items] = -1 - 2 * disc.last
        inward = _inward(ground, colony, cells, 2 * disc.last)
        cost += _quarters(ant.heading, inward) * prices.quarter_turn_us
    return ant.items + 1, cost


@lean_kernel
def _mark(ground: Ground, walk: Walk, colony: Colony, centre: int, radius: int) -> int:
    """Label the cells of a disc and list them in ``colony.area``; return their number."""
    cells, labels, number = walk.cells, colony.labels, colony.counts[DISCS]
    colony.queue[0] = centre
    size = neighbourhood(ground, colony.queue[:1], radius, labels, number, colony.area)
    # A jump is no step: the cells at its ends stay outside.
    for index in range(walk.counts[LENGTH] - 1):
        if not leads(ground, cells[index], cells[index + 1]):
            for cell in (cells[index], cells[index + 1]):
                if labels[cell] == number:
                    labels[cell] = 0
    inside = 0
    for index in range(size):
        if labels[colony.area[index]] == number:
            colony.area[inside] = colony.area[index]
            inside += 1
    return inside


@lean_kernel
def _fold(
    ground: Ground, walk: Walk, prices: Prices, colony: Colony, centre: int, radius: int
) -> Disc:
    """Fold the walk at a disc; no cells if there are too many tunnels."""
    cells, length, labels = walk.cells, walk.counts[LENGTH], colony.labels
    number = colony.counts[DISCS]
    inside = _mark(ground, walk, colony, centre, radius)
    tunnels, items, index, head, last = 0, 0, 0, NOTHING, NOTHING
    while index < length:
        if tunnels == MOST_TUNNELS or items == MOST_ITEMS:
            return Disc(0, 0, 0, 0, 0, 0)
        if labels[cells[index]] == number:
            colony.old[items] = cells[index]
            items += 1
            index += 1
            continue
        first = index
        while index < length and labels[cells[index]] != number:
            index += 1
        if first == 0:
            head = index - 1
            continue
        colony.tunnels[tunnels, 0], colony.tunnels[tunnels, 1] = first, index - 1
        colony.old[items] = -1 - 2 * tunnels
        items += 1
        if index == length:
            last = tunnels
        else:
            tunnels += 1
    goal = NOTHING
    if last != NOTHING:
        goal = _wide(cells[colony.tunnels[last, 0]])
    elif not prices.free_end:
        goal = _wide(cells[length - 1])
    return Disc(inside, tunnels, items, head, last, goal)


@lean_kernel
def _list_ends(walk: Walk, colony: Colony, disc: Disc, is_listed: bool) -> None:
    """List the tunnels' ends by their cells, or remove them from the list."""
    for tunnel in range(disc.tunnels):
        for side in range(2):
            cell = walk.cells[colony.tunnels[tunnel, side]]
            if not is_listed:
                colony.first_end[cell] = NOTHING
            elif not side or colony.tunnels[tunnel, 0] != colony.tunnels[tunnel, 1]:
                colony.next_end[2 * tunnel + side] = colony.first_end[cell]
                colony.first_end[cell] = 2 * tunnel + side


@lean_kernel
def _is_same(colony: Colony, items: int) -> bool:
    """Return whether an ant's sequence is the walk's own."""
    for item in range(items):  # noqa: SIM110 - numba has no generators in `all`
        if colony.new[item] != colony.old[item]:
            return False
    return True


@lean_kernel
def _pull(
    ground: Ground, colony: Colony, sequence: NDArray[np.int32], items: int, towards: float
) -> None:
    """Pull the trail on a sequence's moves between cells towards a value, by the weight alpha."""
    alpha = colony.rules.alpha
    for item in range(items - 1):
        here, after = sequence[item], sequence[item + 1]
        if here < 0 or after < 0:
            continue
        direction = _direction(ground, here, after)
        if direction != AHEAD:
            before = colony.trail[here, direction]
            colony.trail[here, direction] = (1.0 - alpha) * before + alpha * towards


@lean_kernel
def rebuild_disc(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: Colony,
    saved: NDArray[np.int32],
    random: NDArray[np.uint64],
) -> int:
    """Rebuild a disc of a walk by the cheapest ant whose walk differs.

    Each ant's moves get the local update (7).

    Args:
        ground, walk, prices: of a local search; the walk is changed.
        colony: trail and memory.
        saved: int32 (capacity,), a copy of the walk.
        random: stream, uint64 (1,), not 0; advanced.

    Returns:
        Number of the disc's cells, in ``colony.area``; 0 if the walk is unchanged.
    """
    rules, length = colony.rules, walk.counts[LENGTH]
    centre = walk.cells[index_of(draw(random), length)]
    velocity = rules.velocities[colony.counts[DISCS] % rules.velocities.size]
    colony.counts[DISCS] += 1
    if centre >= ground.bound:
        return 0
    least, most = rules.radius
    radius = least + index_of(draw(random), most - least + 1)
    disc = _fold(ground, walk, prices, colony, centre, radius)
    if disc.items == 0 or disc.head + 1 < prices.held:
        return 0
    _list_ends(walk, colony, disc, True)
    kept, cheapest = as_value(0), as_value(0)
    for _ in range(rules.ants):
        items, cost = _walk_one(ground, walk, prices, colony, disc, velocity, random)
        for index in range(disc.cells):
            colony.is_open[colony.area[index]] = 0
        if items <= 0:
            continue
        _pull(ground, colony, colony.new, items, rules.tau0)
        if kept and cost >= cheapest:
            continue
        if items != disc.items or not _is_same(colony, items):
            kept, cheapest = items, cost
            copy(colony.new, colony.best, items)
    colony.counts[ANTS] += rules.ants
    _list_ends(walk, colony, disc, False)
    if kept == 0 or length + kept >= walk.cells.size:
        return 0
    _unfold(ground, walk, prices, colony, disc.head, kept, saved)
    return disc.cells


@lean_kernel
def _unfold(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: Colony,
    head: int,
    items: int,
    saved: NDArray[np.int32],
) -> None:
    """Replace the walk by the head of ``saved`` and the best sequence."""
    at = head + 1
    for item in range(items):
        cell = colony.best[item]
        if cell >= 0:
            walk.cells[at] = cell
            at += 1
            continue
        end = -1 - cell
        first, last = colony.tunnels[end >> 1, 0], colony.tunnels[end >> 1, 1]
        for index in range(last - first + 1):
            walk.cells[at] = saved[last - index] if end & 1 else saved[first + index]
            at += 1
    recount(ground, walk, at, prices)


@lean_kernel
def strengthen(ground: Ground, walk: Walk, colony: Colony) -> None:
    """Strengthen the trail along the walk's moves in the last disc by equation (8)."""
    number, cells = colony.counts[DISCS], walk.cells
    for index in range(walk.counts[LENGTH] - 1):
        if colony.labels[cells[index]] == number:
            _pull(ground, colony, cells[index : index + 2], as_value(2), colony.rules.amount)
