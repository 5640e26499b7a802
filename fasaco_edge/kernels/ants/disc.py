"""Ants that rebuild a disc of a walk: a perturbation for local search, and its pheromone."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.disc_ant import walk_ant
from fasaco_edge.kernels.ants.fold import (
    AHEAD,
    ANTS,
    DISCS,
    Colony,
    direction_of,
    fold,
    list_ends,
    unfold,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import LENGTH, Ground, Prices, Walk, copy
from fasaco_edge.kernels.random import draw, index_of


@lean_inner_kernel
def _is_same(colony: Colony, items: int) -> bool:
    """Return whether an ant's sequence is the walk's own."""
    for item in range(items):  # noqa: SIM110 - numba has no generators in `all`
        if colony.new[item] != colony.old[item]:
            return False
    return True


@lean_inner_kernel
def _pull(
    ground: Ground, colony: Colony, sequence: NDArray[np.int32], items: int, towards: float
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
def cohort(colony: Colony) -> int:
    """Return the number of the cohort that rebuilds the present disc: they take turns."""
    return int((colony.counts[DISCS] - 1) % colony.rules.velocities.size)


@lean_inner_kernel
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
def strengthen(ground: Ground, walk: Walk, colony: Colony) -> None:
    """Strengthen the trail along the walk's moves in the last disc by equation (8)."""
    number, cells = colony.counts[DISCS], walk.cells
    for index in range(walk.counts[LENGTH] - 1):
        if colony.labels[cells[index]] == number:
            _pull(ground, colony, cells[index : index + 2], as_value(2), colony.rules.amount)
