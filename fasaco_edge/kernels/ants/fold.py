"""Fold of a walk: the part within a disc is taken out, so that ants can rebuild it.

The walk enters and leaves the disc several times. Each of its stretches outside of the disc becomes
a tunnel: an ant enters at one end, at no cost, and continues at the other. So ants can join lanes
that are far apart in the walk. The first stretch stays first, and the last one last. The ant's
sequence of cells and tunnels is then unfolded into a walk.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.regions import neighbourhood
from fasaco_edge.kernels.local_search.walk_array import (
    LENGTH,
    Ground,
    Prices,
    Walk,
    leads,
    recount,
)

# Limits: cells of a disc, tunnels, and items of a sequence, which are cells and tunnels.
MOST_CELLS, MOST_TUNNELS, MOST_ITEMS = 300, 64, 2048
# Limit on the cells visited by the search for a way out of a dead end.
FARTHEST = 300
# In place of a heading, before the first move.
AHEAD = 4
NOTHING = -1
# Entries of ``DiscColony.counts``.
SEARCHES, DISCS, ANTS = range(3)


class AntRules(NamedTuple):
    """Constants of the ants.

    Attributes:
        q0, alpha, tau0: of equations (4), (7) and (8).
        powers: float64 (5,): eta ** beta of a move, by the number of its quarter-turns.
        ants: number of ants that rebuild a disc; the cheapest counts.
        radius: least and largest radius of a disc.
        velocities: int64 (cohorts,): velocity of each cohort; the cohorts take turns.
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


class DiscColony(NamedTuple):
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
        counts: int64 (3,): SEARCHES, DISCS and ANTS so far.
        saved_us: int64 (cohorts,): cost saved so far by the discs that each cohort rebuilt [us].
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
    saved_us: NDArray[np.int64]
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
def wide(number: int) -> int:
    """Return a number of an array as a 64-bit integer, as the kernels of an ant expect it."""
    return int(np.int64(number))


@inlined
def quarters_between(one: int, other: int) -> int:
    """Return the quarter-turns between two directions."""
    if one == AHEAD or other == AHEAD or one == other:  # noqa: PLR1714, SIM109 - numba has no `in`
        return 0
    return 2 if one ^ other == 2 else 1


@lean_inner_kernel
def direction_of(ground: Ground, one: int, other: int) -> int:
    """Return the direction of a step, or AHEAD for none."""
    for direction in range(4):
        if ground.offsets[direction] == other - one and ground.steps[one] >> direction & 1:
            return direction
    return AHEAD


@lean_inner_kernel
def end_at(colony: DiscColony, cell: int) -> int:
    """Return the first tunnel end at a cell whose tunnel is not taken, or NOTHING."""
    end = colony.first_end[cell]
    while end != NOTHING and colony.is_taken[end >> 1]:
        end = colony.next_end[end]
    return wide(end)


@lean_inner_kernel
def inward_from(ground: Ground, colony: DiscColony, cells: NDArray[np.int32], end: int) -> int:
    """Return the direction of the first step into a tunnel, or AHEAD if it has no step."""
    first, last = colony.tunnels[end >> 1, 0], colony.tunnels[end >> 1, 1]
    if first == last:
        return AHEAD
    if end & 1:
        return direction_of(ground, cells[last], cells[last - 1])
    return direction_of(ground, cells[first], cells[first + 1])


@lean_inner_kernel
def _mark(ground: Ground, walk: Walk, colony: DiscColony, centre: int, radius: int) -> int:
    """Label the cells of a disc and list them in ``colony.area``; return their number."""
    cells, labels, number = walk.cells, colony.labels, colony.counts[DISCS]
    colony.queue[0] = centre
    size = neighbourhood(ground, colony.queue[:1], radius, labels, number, colony.area)
    # Cells at a jump, which is no step, stay outside.
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


@lean_inner_kernel
def fold(
    ground: Ground, walk: Walk, prices: Prices, colony: DiscColony, centre: int, radius: int
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
        goal = wide(cells[colony.tunnels[last, 0]])
    elif not prices.free_end:
        goal = wide(cells[length - 1])
    return Disc(inside, tunnels, items, head, last, goal)


@lean_inner_kernel
def list_ends(walk: Walk, colony: DiscColony, disc: Disc, is_listed: bool) -> None:
    """List the tunnels' ends by their cells, or remove them from the list."""
    for tunnel in range(disc.tunnels):
        for side in range(2):
            cell = walk.cells[colony.tunnels[tunnel, side]]
            if not is_listed:
                colony.first_end[cell] = NOTHING
            elif not side or colony.tunnels[tunnel, 0] != colony.tunnels[tunnel, 1]:
                colony.next_end[2 * tunnel + side] = colony.first_end[cell]
                colony.first_end[cell] = 2 * tunnel + side


@lean_inner_kernel
def open_disc(ground: Ground, colony: DiscColony, disc: Disc) -> int:
    """Open the cells and tunnels of a disc; return their number."""
    count = disc.tunnels
    for index in range(disc.cells):
        cell = colony.area[index]
        if ground.needed[cell] > 0:
            colony.is_open[cell] = 1
            count += 1
    colony.is_taken[: disc.tunnels + 1] = 0
    return count


@lean_inner_kernel
def unfold(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    colony: DiscColony,
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
