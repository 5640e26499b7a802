"""Ants that rebuild a disc of a walk: a perturbation for local search, and its pheromone.

An ant walks through the disc over open cells and tunnels (``fold``). It chooses its moves by
equations (4) to (6) of Carr and Wang 2022 (``kernels.ants.colony``), where eta in (5) is 1 over the
seconds of a move with its turns. An ant of velocity v keeps straight on for up to v cells. A dead
end is left by the shortest way to the nearest open cell or tunnel.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.fold import (
    AHEAD,
    ANTS,
    DISCS,
    FARTHEST,
    MOST_ITEMS,
    NOTHING,
    SEARCHES,
    Disc,
    DiscColony,
    direction_of,
    end_at,
    fold,
    inward_from,
    list_ends,
    open_disc,
    quarters_between,
    unfold,
    wide,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import LENGTH, Ground, Prices, Walk, copy
from fasaco_edge.kernels.random import draw, draw_share, index_of


class _Ant(NamedTuple):
    """An ant: items in ``DiscColony.new``, its cell and heading, and its cost so far [us]."""

    items: int
    here: int
    heading: int
    cost: int


LOST = _Ant(NOTHING, 0, 0, 0)


@lean_inner_kernel
def _search(ground: Ground, colony: DiscColony, here: int, goal: int) -> int:
    """Return the nearest open cell or tunnel end, or a given ``goal``; NOTHING if it is too far."""
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
                return wide(after)
            if goal == NOTHING and (colony.is_open[after] or end_at(colony, after) != NOTHING):
                return wide(after)
    return NOTHING


@lean_inner_kernel
def _go_to(ground: Ground, prices: Prices, colony: DiscColony, ant: _Ant, goal: int) -> _Ant:
    """Return the ant at the nearest open cell or tunnel end, or at ``goal``; LOST if it is too far.

    The cell reached is not added to the ant's sequence.
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
        direction = wide(colony.came_from[cell])
        cost += quarters_between(heading, direction) * prices.quarter_turn_us
        heading = direction
    return _Ant(ant.items + steps - 1, found, heading, cost)


@lean_inner_kernel
def _choose(
    ground: Ground,
    colony: DiscColony,
    cells: NDArray[np.int32],
    ant: _Ant,
    random: NDArray[np.uint64],
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
    if choices < 2 or draw_share(random) <= rules.q0:
        return best
    # Equation (6)
    left = draw_share(random) * total
    for turn in range(4):
        direction = (ant.heading + turn) & 3
        weight = _weight(ground, colony, cells, ant, direction)
        if weight > 0.0:
            best = direction
            left -= weight
            if left < 0.0:
                break
    return best


@lean_inner_kernel
def _weight(
    ground: Ground, colony: DiscColony, cells: NDArray[np.int32], ant: _Ant, direction: int
) -> float:
    """Return tau * eta ** beta of a move; 0 if it leads to no open cell or tunnel."""
    if not ground.steps[ant.here] >> direction & 1:
        return 0.0
    after = ant.here + ground.offsets[direction]
    end = end_at(colony, after)
    if not colony.is_open[after] and end == NOTHING:
        return 0.0
    quarters = quarters_between(ant.heading, direction)
    if end != NOTHING:
        quarters += quarters_between(direction, inward_from(ground, colony, cells, end))
    return float(colony.trail[ant.here, direction] * colony.rules.powers[quarters])


@lean_inner_kernel
def _first(ground: Ground, colony: DiscColony, cells: NDArray[np.int32], head: int) -> _Ant:
    """Return an ant at the end of the first stretch, or at the walk's first cell."""
    if head == NOTHING:
        colony.new[0] = cells[0]
        return _Ant(as_value(1), wide(cells[0]), as_value(AHEAD), as_value(0))
    heading = as_value(AHEAD)
    if head > 0:
        heading = direction_of(ground, cells[head - 1], cells[head])
    return _Ant(as_value(0), wide(cells[head]), heading, as_value(0))


@lean_inner_kernel
def walk_ant(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: DiscColony,
    disc: Disc,
    velocity: int,
    random: NDArray[np.uint64],
) -> tuple[int, int]:
    """Let an ant walk through the disc into ``colony.new``.

    Returns:
        Length of its sequence, NOTHING if it gave up, and its cost [us].
    """
    cells, turn_us = walk.cells, prices.quarter_turn_us
    left = open_disc(ground, colony, disc)
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
            cost = prices.step_us + quarters_between(ant.heading, direction) * turn_us
            run = run + 1 if is_run else 1
            here = wide(ant.here + ground.offsets[direction])
            ant = _Ant(ant.items, here, direction, ant.cost + cost)
        end = end_at(colony, ant.here)
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


@lean_inner_kernel
def _pass(
    ground: Ground,
    prices: Prices,
    colony: DiscColony,
    cells: NDArray[np.int32],
    ant: _Ant,
    end: int,
) -> _Ant:
    """Return the ant at the other end of a tunnel."""
    colony.new[ant.items] = -1 - end
    colony.is_taken[end >> 1] = 1
    inward = inward_from(ground, colony, cells, end)
    cost = ant.cost + quarters_between(ant.heading, inward) * prices.quarter_turn_us
    outward = inward_from(ground, colony, cells, end ^ 1)
    heading = ant.heading if outward == AHEAD else (outward + 2) & 3
    here = wide(cells[colony.tunnels[end >> 1, 1 - (end & 1)]])
    return _Ant(ant.items + 1, here, heading, cost)


@lean_inner_kernel
def _end(
    ground: Ground,
    prices: Prices,
    colony: DiscColony,
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
        inward = inward_from(ground, colony, cells, 2 * disc.last)
        cost += quarters_between(ant.heading, inward) * prices.quarter_turn_us
    return ant.items + 1, cost


@lean_inner_kernel
def _is_same(colony: DiscColony, items: int) -> bool:
    """Return whether an ant's sequence is the walk's own."""
    for item in range(items):  # noqa: SIM110 - numba has no generators in `all`
        if colony.new[item] != colony.old[item]:
            return False
    return True


@lean_inner_kernel
def _pull(
    ground: Ground, colony: DiscColony, sequence: NDArray[np.int32], items: int, towards: float
) -> None:
    """Pull the trail on a sequence's moves between cells towards a value, by the weight alpha."""
    alpha = colony.rules.alpha
    for item in range(items - 1):
        here, after = sequence[item], sequence[item + 1]
        if here < 0 or after < 0:
            continue
        direction = direction_of(ground, here, after)
        if direction != AHEAD:
            before = colony.trail[here, direction]
            colony.trail[here, direction] = (1.0 - alpha) * before + alpha * towards


@inlined
def cohort(colony: DiscColony) -> int:
    """Return the number of the cohort that rebuilds the present disc; the cohorts take turns."""
    return int((colony.counts[DISCS] - 1) % colony.rules.velocities.size)


@lean_inner_kernel
def rebuild_disc(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: DiscColony,
    saved: NDArray[np.int32],
    random: NDArray[np.uint64],
) -> int:
    """Rebuild a disc of a walk by the cheapest ant whose walk differs from the present one.

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
    colony.counts[DISCS] += 1
    velocity = rules.velocities[cohort(colony)]
    if centre >= ground.bound:
        return 0
    least, most = rules.radius
    radius = least + index_of(draw(random), most - least + 1)
    disc = fold(ground, walk, prices, colony, centre, radius)
    if disc.items == 0 or disc.head + 1 < prices.held:
        return 0
    list_ends(walk, colony, disc, True)
    kept, cheapest = as_value(0), as_value(0)
    for _ in range(rules.ants):
        items, cost = walk_ant(ground, walk, prices, colony, disc, velocity, random)
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
    list_ends(walk, colony, disc, False)
    if kept == 0 or length + kept >= walk.cells.size:
        return 0
    unfold(ground, walk, prices, colony, disc.head, kept, saved)
    return disc.cells


@lean_inner_kernel
def strengthen(ground: Ground, walk: Walk, colony: DiscColony) -> None:
    """Strengthen the trail along the walk's moves in the last disc by equation (8)."""
    number, cells = colony.counts[DISCS], walk.cells
    for index in range(walk.counts[LENGTH] - 1):
        if colony.labels[cells[index]] == number:
            _pull(ground, colony, cells[index : index + 2], as_value(2), colony.rules.amount)
