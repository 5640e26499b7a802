"""Kicks: change the walk where local search cannot, improve it, keep it or take it back.

Three kinds: the free end moves; a loop round a hole is added (see ``parity``);
or, where turns count, a spot is only heated up. Where steps alone count, the
whole walk is mixed afterwards, as what can be spared must travel to meet. Where
turns count, the surroundings are annealed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_kernel
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

PROPOSALS, KICKS = 0, 1

# Temperatures of an annealing, from 1 down to 1 / 5, in units of 1 / 1024.
COOLING = np.round(1024 * 0.2 ** (np.arange(8) / 7)).astype(np.int64)


class KickRules(NamedTuple):
    """How to kick.

    Attributes:
        limit: cells that a search for another end or a loop settles.
        mixing: proposals for each cell of the walk, or of the surroundings.
        radius: steps from what was changed to the rim of the surroundings; -1 for
            the whole walk, at temperature 0.
        heat_us: temperature that an annealing begins with [us].
        patience_us: temperature at which a worse walk is gone on with [us].
        loops_of_256: so many of 256 kicks change the end or add a loop.
        steady: whether what need not change stays in the order it is in.
        strict: whether a walk that costs the same as the one before is taken back.
    """

    limit: int
    mixing: int
    radius: int
    heat_us: int
    patience_us: int
    loops_of_256: int
    steady: bool = False
    strict: bool = False


class Memory(NamedTuple):
    """What a search remembers, and its working memory.

    Attributes:
        saved: int32 (room,), the walk before the kick.
        best: int32 (room,), the best walk.
        best_counts: int64 (3,), its counts as in ``Walk``.
        touched: int32 (n,), cells that the kick changed something at.
        area: int32 (n,), their surroundings.
        marked: int32 (n,), number of the last kick whose surroundings hold the cell.
        work: int64 (2,), PROPOSALS and KICKS so far.
    """

    saved: NDArray[np.int32]
    best: NDArray[np.int32]
    best_counts: NDArray[np.int64]
    touched: NDArray[np.int32]
    area: NDArray[np.int32]
    marked: NDArray[np.int32]
    work: NDArray[np.int64]


@lean_kernel
def remember(walk: Walk, memory: Memory) -> None:
    """Let the walk be the best one."""
    copy(walk.cells, memory.best, walk.counts[LENGTH])
    for index in range(walk.counts.size):
        memory.best_counts[index] = walk.counts[index]


@lean_kernel
def recall(ground: Ground, walk: Walk, prices: Prices, memory: Memory) -> None:
    """Go back to the best walk."""
    length = memory.best_counts[LENGTH]
    copy(memory.best, walk.cells, length)
    recount(ground, walk, length, prices)


@inlined
def _change_way(ground: Ground, tally: Tally, memory: Memory, cell: int, root: int, at: int) -> int:
    """Change the steps on the way from ``root`` to ``cell``; list it from ``touched[at]`` on."""
    while cell != root:
        before = tally.parent[cell]
        change_step(ground, tally, cell, before)
        memory.touched[at] = cell
        at += 1
        cell = before
    memory.touched[at] = root
    return at + 1


@lean_kernel
def _move_end(
    ground: Ground,
    walk: Walk,
    tally: Tally,
    memory: Memory,
    rules: KickRules,
    random: NDArray[np.uint64],
) -> int:
    """Let the walk end elsewhere; return how many cells were touched."""
    root = walk.cells[walk.counts[LENGTH] - 1]
    settled = search_ways(ground, tally, root, rules.limit, random)
    if settled < 2:
        return 0
    return _change_way(ground, tally, memory, draw_end(tally, settled, random), root, 0)


@lean_kernel
def _add_loop(
    ground: Ground,
    walk: Walk,
    tally: Tally,
    memory: Memory,
    rules: KickRules,
    random: NDArray[np.uint64],
) -> int:
    """Add a loop round a hole near some visit; return how many cells were touched."""
    root = walk.cells[index_of(draw(random), walk.counts[LENGTH])]
    if root >= ground.bound:
        return 0
    settled = search_ways(ground, tally, root, rules.limit, random)
    found = find_loops(ground, tally, settled)
    if not found:
        return 0
    step = draw_loop(tally, found, random)
    one = step >> 1
    other = one + ground.offsets[step & 1]
    shared = common_ancestor(tally, one, other)
    change_step(ground, tally, one, other)
    touched = _change_way(ground, tally, memory, one, shared, 0)
    return _change_way(ground, tally, memory, other, shared, touched)


@lean_kernel
def _change_parity(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    tally: Tally,
    memory: Memory,
    rules: KickRules,
    random: NDArray[np.uint64],
) -> int:
    """Move the end or add a loop; return how many cells were touched, 0 if nothing was."""
    length = walk.counts[LENGTH]
    count_steps(ground, walk, tally)
    if rules.steady:
        note_order(ground, walk, tally)
    end = walk.cells[length - 1]
    if prices.free_end and draw(random) & 1:
        touched = _move_end(ground, walk, tally, memory, rules, random)
        end = memory.touched[0]
    else:
        touched = _add_loop(ground, walk, tally, memory, rules, random)
    if touched == 0 or length + touched + 1 > walk.cells.size:
        return 0
    length = euler_walk(ground, walk, tally, end, rules.steady, random)
    recount(ground, walk, length, prices)
    return touched


@lean_kernel
def _settle(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    memory: Memory,
    rules: KickRules,
    touched: int,
    random: NDArray[np.uint64],
) -> None:
    """Improve the walk after a kick: all of it, or the surroundings, cooling down."""
    if rules.radius < 0:
        proposals = rules.mixing * walk.counts[LENGTH]
        improve(ground, walk, prices, memory.area[:0], 0, proposals, random)
        memory.work[PROPOSALS] += proposals
        return
    number = memory.work[KICKS] + 1
    around = memory.touched[:touched]
    size = neighbourhood(ground, around, rules.radius, memory.marked, number, memory.area)
    proposals = rules.mixing * size // COOLING.size
    for level in COOLING:
        heat = rules.heat_us * level >> 10
        improve(ground, walk, prices, memory.area[:size], heat, proposals, random)
        memory.work[PROPOSALS] += proposals


@lean_kernel
def touch_up(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    memory: Memory,
    rules: KickRules,
    touched: int,
    random: NDArray[np.uint64],
) -> None:
    """Improve the walk around the first ``touched`` cells of ``memory.touched``.

    If that gains nothing the walk stays as it was.
    """
    length, cost = walk.counts[LENGTH], walk.counts[COST]
    copy(walk.cells, memory.saved, length)
    _settle(ground, walk, prices, memory, rules, touched, random)
    memory.work[KICKS] += 1
    if walk.counts[COST] < cost:
        remember(walk, memory)
    else:
        copy(memory.saved, walk.cells, length)
        recount(ground, walk, length, prices)


@lean_kernel
def kick(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    tally: Tally,
    memory: Memory,
    rules: KickRules,
    kicks: int,
    random: NDArray[np.uint64],
) -> None:
    """Kick the walk so many times; ``memory.best`` follows the best one.

    Args:
        ground: where the walk goes.
        walk: changed in place; a worse walk may be left behind.
        prices: what is to become less.
        tally, memory: working memory, and the best walk.
        rules: how to kick.
        kicks: how many.
        random: stream, uint64 (1,), not 0; advanced.
    """
    for _ in range(kicks):
        length, cost = walk.counts[LENGTH], walk.counts[COST]
        copy(walk.cells, memory.saved, length)
        if draw(random) & 255 < rules.loops_of_256:
            touched = _change_parity(ground, walk, prices, tally, memory, rules, random)
        else:
            touched = 0
        if touched == 0:
            # Nothing to change there: heat up a spot.
            spot = walk.cells[index_of(draw(random), walk.counts[LENGTH])]
            if spot < ground.bound:
                memory.touched[0] = spot
                touched = 1
        _settle(ground, walk, prices, memory, rules, touched, random)
        memory.work[KICKS] += 1
        if walk.counts[COST] < memory.best_counts[COST]:
            remember(walk, memory)
        elif rules.strict or not accepts(walk.counts[COST] - cost, rules.patience_us, random):
            copy(memory.saved, walk.cells, length)
            recount(ground, walk, length, prices)
