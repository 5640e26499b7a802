"""Perturbations: change the walk in ways local search cannot, improve it, then keep or revert it.

Four kinds: ants rebuild a disc (``kernels.ants.disc``); the free end moves; a loop around a hole
is added (see ``parity``); or, if turns count, only the temperature rises at a spot. If only steps
count, proposals are then made all over the walk, as spare visits must travel to meet. If turns
count, the surroundings are annealed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.disc import cohort, rebuild_disc, strengthen
from fasaco_edge.kernels.ants.fold import DiscColony
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.local_search.parity import (
    Tally,
    change_step,
    common_ancestor,
    count_steps,
    draw_end,
    draw_loop,
    euler_walk,
    find_loops,
    note_order,
    search_ways,
)
from fasaco_edge.kernels.local_search.proposals import accepts, improve
from fasaco_edge.kernels.local_search.regions import neighbourhood
from fasaco_edge.kernels.local_search.walk_array import (
    COST,
    LENGTH,
    Ground,
    Prices,
    Walk,
    copy,
    recount,
)
from fasaco_edge.kernels.random import draw, index_of

# Entries of ``SearchMemory.work``.
PROPOSALS, PERTURBATIONS = 0, 1
# No cells are given: the perturbation draws the cells that it changes.
DRAWN = -1

# After ants have rebuilt a disc, the cells up to this many steps around it are improved, too.
AROUND_DISC = 2
# Temperatures of an annealing, from 1 down to 1 / 5, in units of 1 / 1024.
COOLING = np.round(1024 * 0.2 ** (np.arange(8) / 7)).astype(np.int64)


class PerturbationRules(NamedTuple):
    """Parameters of perturbations.

    Attributes:
        limit: the search for another end or for a loop stops after this many cells.
        proposals: proposals for each visit of the walk, or each cell of the surroundings.
        radius: steps from the changed cells to the rim of the surroundings; -1 for the whole walk,
            at temperature 0.
        temperature_us: temperature that an annealing begins with [us].
        acceptance_us: temperature at which a worse walk is kept [us].
        loops_of_256: out of 256 perturbations, how many change the end or add a loop.
        ants_of_256: out of 256 perturbations, the number in which ants rebuild a disc.
        strict: whether a walk of equal cost is reverted.
    """

    limit: int
    proposals: int
    radius: int
    temperature_us: int
    acceptance_us: int
    loops_of_256: int
    ants_of_256: int = 0
    strict: bool = False


class SearchMemory(NamedTuple):
    """The best walk of a search, and working memory.

    Attributes:
        saved: int32 (capacity,), the walk before the perturbation.
        best: int32 (capacity,), the best walk.
        best_counts: int64 (3,), its counts as in ``Walk``.
        touched: int32 (n,), cells where the perturbation changed something.
        area: int32 (n,), surroundings of the touched cells.
        marked: int32 (n,), number of the last perturbation whose surroundings hold the cell.
        work: int64 (2,), number of PROPOSALS, which includes moves of ants, and of PERTURBATIONS.
    """

    saved: NDArray[np.int32]
    best: NDArray[np.int32]
    best_counts: NDArray[np.int64]
    touched: NDArray[np.int32]
    area: NDArray[np.int32]
    marked: NDArray[np.int32]
    work: NDArray[np.int64]


class LocalSearch(NamedTuple):
    """A local search: the ground, the walk, its prices, working memory, and ants.

    The walk is changed in place; in the end it may be worse than ``memory.best``.
    """

    ground: Ground
    walk: Walk
    prices: Prices
    tally: Tally
    memory: SearchMemory
    colony: DiscColony


@lean_kernel
def remember(walk: Walk, memory: SearchMemory) -> None:
    """Store the walk as the best one."""
    copy(walk.cells, memory.best, walk.counts[LENGTH])
    for index in range(walk.counts.size):
        memory.best_counts[index] = walk.counts[index]


@inlined
def _load(
    ground: Ground, walk: Walk, prices: Prices, cells: NDArray[np.int32], length: int
) -> None:
    """Set the walk to ``cells[:length]``, int32 (capacity,)."""
    copy(cells, walk.cells, length)
    recount(ground, walk, length, prices)


@lean_kernel
def recall(ground: Ground, walk: Walk, prices: Prices, memory: SearchMemory) -> None:
    """Go back to the best walk."""
    _load(ground, walk, prices, memory.best, memory.best_counts[LENGTH])


@inlined
def _change_way(tally: Tally, touched: NDArray[np.int32], cell: int, root: int, at: int) -> int:
    """Change the steps on the way from ``root`` to ``cell``; list its cells in ``touched[at:]``."""
    while cell != root:
        before = tally.parent[cell]
        change_step(tally.times, cell, before)
        touched[at] = cell
        at += 1
        cell = before
    touched[at] = root
    return at + 1


@lean_inner_kernel
def _move_end(
    ground: Ground,
    walk: Walk,
    tally: Tally,
    touched: NDArray[np.int32],
    limit: int,
    random: NDArray[np.uint64],
) -> int:
    """Move the walk's end elsewhere; return how many cells were touched."""
    root = walk.cells[walk.counts[LENGTH] - 1]
    settled = search_ways(ground, tally, root, limit, random)
    if settled < 2:
        return 0
    return _change_way(tally, touched, draw_end(tally, settled, random), root, as_value(0))


@lean_inner_kernel
def _add_loop(
    ground: Ground,
    walk: Walk,
    tally: Tally,
    touched: NDArray[np.int32],
    limit: int,
    random: NDArray[np.uint64],
) -> int:
    """Add a loop round a hole near some visit; return how many cells were touched."""
    root = walk.cells[index_of(draw(random), walk.counts[LENGTH])]
    if root >= ground.bound:
        return 0
    settled = search_ways(ground, tally, root, limit, random)
    found = find_loops(ground, tally, settled)
    if not found:
        return 0
    step = draw_loop(tally, found, random)
    one = step >> 1
    other = one + ground.offsets[step & 1]
    shared = common_ancestor(tally, one, other)
    change_step(tally.times, one, other)
    listed = _change_way(tally, touched, one, shared, as_value(0))
    return _change_way(tally, touched, other, shared, listed)


@lean_inner_kernel
def _change_parity(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    tally: Tally,
    touched: NDArray[np.int32],
    limit: int,
    random: NDArray[np.uint64],
) -> int:
    """Move the end or add a loop; return how many cells were touched, 0 if nothing was."""
    length = walk.counts[LENGTH]
    count_steps(ground, walk, tally)
    note_order(ground, walk, tally)
    end = walk.cells[length - 1]
    if prices.free_end and draw(random) & 1:
        count = _move_end(ground, walk, tally, touched, limit, random)
        end = touched[0]
    else:
        count = _add_loop(ground, walk, tally, touched, limit, random)
    if count == 0 or length + count + 1 > walk.cells.size:
        return 0
    length = euler_walk(ground, walk, tally, end, random)
    recount(ground, walk, length, prices)
    return count


@lean_inner_kernel
def _settle(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    memory: SearchMemory,
    rules: PerturbationRules,
    touched: int,
    radius: int,
    random: NDArray[np.uint64],
) -> None:
    """Improve the walk after a perturbation: all of it, or the surroundings, cooling down.

    Args:
        ground, walk, prices, memory: see above.
        rules, random: as for ``perturb``.
        touched: number of cells in ``memory.touched``.
        radius: steps from those cells to the rim of the surroundings; -1 for the whole walk.
    """
    if radius < 0:
        proposals = rules.proposals * walk.counts[LENGTH]
        improve(ground, walk, prices, memory.area[:0], as_value(0), proposals, random)
        memory.work[PROPOSALS] += proposals
        return
    number = memory.work[PERTURBATIONS] + 1
    around = memory.touched[:touched]
    size = neighbourhood(ground, around, radius, memory.marked, number, memory.area)
    proposals = rules.proposals * size // COOLING.size
    for level in COOLING:
        temperature_us = rules.temperature_us * level >> 10
        improve(ground, walk, prices, memory.area[:size], temperature_us, proposals, random)
        memory.work[PROPOSALS] += proposals


@lean_kernel
def perturb(
    search: LocalSearch,
    rules: PerturbationRules,
    times: int,
    given: int,
    random: NDArray[np.uint64],
) -> None:
    """Perturb the walk ``times`` times; ``memory.best`` holds the best walk.

    Args:
        search: changed in place.
        rules: how to perturb.
        times: how often.
        given: number of cells in ``memory.touched``: the walk is not changed at random, only
            improved around these cells. DRAWN to change the walk at cells drawn at random.
        random: stream, uint64 (1,), not 0; advanced.
    """
    ground, walk, prices, tally, memory, colony = search
    for _ in range(times):
        length, cost = walk.counts[LENGTH], walk.counts[COST]
        copy(walk.cells, memory.saved, length)
        touched, by_ants = given, as_value(0)
        if given == DRAWN:
            kind = draw(random) & 255
            touched = as_value(0)
            if kind < rules.loops_of_256:
                touched = _change_parity(
                    ground, walk, prices, tally, memory.touched, rules.limit, random
                )
            elif kind < rules.loops_of_256 + rules.ants_of_256:
                touched = by_ants = rebuild_disc(ground, walk, prices, colony, memory.saved, random)
                copy(colony.area, memory.touched, touched)
                memory.work[PROPOSALS] += colony.rules.ants * touched
            if touched == 0:
                # Nothing to change there: anneal around a spot.
                spot = walk.cells[index_of(draw(random), walk.counts[LENGTH])]
                if spot < ground.bound:
                    memory.touched[0] = spot
                    touched = 1
        radius = AROUND_DISC if by_ants else rules.radius
        _settle(ground, walk, prices, memory, rules, touched, radius, random)
        memory.work[PERTURBATIONS] += 1
        if walk.counts[COST] < memory.best_counts[COST]:
            if by_ants:
                gain_us = memory.best_counts[COST] - walk.counts[COST]
                colony.saved_us[cohort(colony)] += gain_us
            remember(walk, memory)
        elif rules.strict or not accepts(walk.counts[COST] - cost, rules.acceptance_us, random):
            _load(ground, walk, prices, memory.saved, length)
        if by_ants:
            strengthen(ground, walk, colony)
