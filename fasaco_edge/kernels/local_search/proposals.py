"""Local search on a walk: a stream of small proposals that need no distances between cells.

============  =================================================  ==============
move          what it does                                       steps
============  =================================================  ==============
square flip   steps a-b and c-d become a-c and b-d, the part     0
              between is reversed (2-opt on a square)
end flip      the part after a step a-b is reversed, if the      0
              free end lies beside a
corner flip   a spare visit moves to the opposite corner of its  0
              square
shrink        a spike, or two spare visits between neighbours,   -2 (-1 at a
              or the free end, is left out                       free end)
============  =================================================  ==============

A visit is spare if its cell is visited more often than needed. If only steps count,
moves at no cost are always taken: they move spare visits around until two of them
meet and shrink. If turns count, most moves have a cost, and simulated annealing
decides (Metropolis).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import (
    COST,
    LENGTH,
    SPARE_CELLS,
    Ground,
    Prices,
    Walk,
    added,
    drop,
    is_at,
    leads,
    put,
    reverse,
    turning,
)
from fasaco_edge.kernels.random import draw, index_of

# -ln(u) for u uniform in (0, 1), in units of 1 / 65536: integers, so that decisions are
# equal on all machines.
EXPONENTIAL = np.round(-np.log((np.arange(4096) + 0.5) / 4096) * 65536).astype(np.int64)

# Out of 64 proposals at a spare visit, this many try to remove the visit.
REMOVALS_OF_64 = 40
# Half of the proposals go where a gain is possible: to cells with spare visits.
AT_SPARE_OF_256 = 128


@inlined
def accepts(delta: int, temperature_us: int, random: NDArray[np.uint64]) -> bool:
    """Return whether a change of cost [us] is taken at a temperature [us] (Metropolis)."""
    if delta <= 0:
        return True
    if temperature_us == 0:
        return False
    return bool(delta <= temperature_us * EXPONENTIAL[draw(random) & 4095] >> 16)


class _State(NamedTuple):
    """The walk and the acceptance parameters: arguments of ``improve``."""

    ground: Ground
    walk: Walk
    prices: Prices
    temperature_us: int
    random: NDArray[np.uint64]


@inlined
def _turn_at(walk: Walk, index: int, quarter_turn_us: int) -> int:
    """Return the cost of the turn at a visit, 0 at the walk's ends."""
    if index < 1 or index + 1 >= walk.counts[LENGTH]:
        return 0
    cells = walk.cells
    return turning(cells[index - 1], cells[index], cells[index + 1], quarter_turn_us)


@inlined
def _turn_in(walk: Walk, before: int, here: int, after: int, quarter_turn_us: int) -> int:
    """Return the cost of the turn at cell ``here`` between visits ``before`` and ``after``.

    Either may lie beyond the walk's ends: then there is no turn.
    """
    if before < 0 or after >= walk.counts[LENGTH]:
        return 0
    return turning(walk.cells[before], here, walk.cells[after], quarter_turn_us)


@inlined
def _propose_drop(state: _State, index: int, visits: int, delta: int) -> None:
    """Leave out one or two visits from ``index`` on if the change of cost [us] is accepted."""
    if accepts(delta, state.temperature_us, state.random):
        drop(state.ground, state.walk, index, visits)
        state.walk.counts[COST] += delta


@inlined
def _drop_end(state: _State) -> None:
    """Leave out the last visit."""
    last = state.walk.counts[LENGTH] - 1
    prices, cells = state.prices, state.walk.cells
    delta = -prices.step_us - _turn_at(state.walk, last - 1, prices.quarter_turn_us)
    delta -= added(state.ground, prices, cells[last - 1], cells[last])
    _propose_drop(state, last, 1, delta)


@inlined
def _drop_spike(state: _State, index: int) -> None:
    """Leave out visit ``index`` between two visits of one cell, and the second of the two."""
    walk, turn = state.walk, state.prices.quarter_turn_us
    delta = -2 * state.prices.step_us
    delta -= 2 * added(state.ground, state.prices, walk.cells[index - 1], walk.cells[index])
    if turn:
        delta -= 2 * turn + _turn_at(walk, index - 1, turn) + _turn_at(walk, index + 1, turn)
        delta += _turn_in(walk, index - 2, walk.cells[index - 1], index + 2, turn)
    _propose_drop(state, index, 2, delta)


@inlined
def _added_by(state: _State, first: int, last: int) -> int:
    """Return the additional prices of the steps from visit ``first`` to ``last`` [us]."""
    total, cells = 0, state.walk.cells
    for index in range(first, last):
        total += added(state.ground, state.prices, cells[index], cells[index + 1])
    return total


@inlined
def _drop_detour(state: _State, index: int) -> None:
    """Leave out visits ``index`` and ``index + 1``, whose neighbours are beside each other."""
    walk, turn = state.walk, state.prices.quarter_turn_us
    delta = -2 * state.prices.step_us - _added_by(state, index - 1, index + 2)
    delta += added(state.ground, state.prices, walk.cells[index - 1], walk.cells[index + 2])
    if turn:
        for place in range(index - 1, index + 3):
            delta -= _turn_at(walk, place, turn)
        before, after = walk.cells[index - 1], walk.cells[index + 2]
        if index > 1:
            delta += turning(walk.cells[index - 2], before, after, turn)
        if index + 3 < walk.counts[LENGTH]:
            delta += turning(before, after, walk.cells[index + 3], turn)
    _propose_drop(state, index, 2, delta)


@inlined
def _takes_flip(state: _State, first: int, delta: int) -> bool:
    """Return whether a change that keeps the walk's length is accepted; if so, count its cost.

    A change that begins at a held visit is accepted only if it gains.
    """
    if delta >= 0 and first < state.prices.held:
        return False
    if not accepts(delta, state.temperature_us, state.random):
        return False
    state.walk.counts[COST] += delta
    return True


@inlined
def _flip_corner(state: _State, index: int) -> None:
    """Move a visit to the opposite corner of the square that the walk turns in there."""
    ground, walk, turn = state.ground, state.walk, state.prices.quarter_turn_us
    cells = walk.cells
    before, here, after = cells[index - 1], cells[index], cells[index + 1]
    corner = before + after - here
    if corner == here or not (leads(ground, before, corner) and leads(ground, after, corner)):
        return
    prices = state.prices
    delta = added(ground, prices, before, corner) + added(ground, prices, corner, after)
    delta -= added(ground, prices, before, here) + added(ground, prices, here, after)
    if turn:
        delta -= _turn_at(walk, index - 1, turn) + _turn_at(walk, index + 1, turn)
        if index > 1:
            delta += turning(cells[index - 2], before, corner, turn)
        if index + 2 < walk.counts[LENGTH]:
            delta += turning(corner, after, cells[index + 2], turn)
    if _takes_flip(state, index, delta):
        put(ground, walk, index, corner)


@inlined
def _remove(state: _State, index: int, choice: int) -> None:
    """Leave out a spare visit, or move it."""
    ground, walk = state.ground, state.walk
    if index == 0:
        return
    last = walk.counts[LENGTH] - 1
    if index == last:
        if state.prices.free_end:
            _drop_end(state)
        return
    cells = walk.cells
    before, here, after = cells[index - 1], cells[index], cells[index + 1]
    if before == after:
        _drop_spike(state, index)
        return
    both_spare = index + 2 <= last and walk.visits[after] > ground.needed[after]
    if choice & 1 and both_spare and leads(ground, before, cells[index + 2]):
        _drop_detour(state, index)
        return
    if after - here != here - before:
        _flip_corner(state, index)


@inlined
def _turns_of_flip(walk: Walk, first: int, last: int, turn: int) -> int:
    """Return the change in cost of turns if visits ``first + 1`` to ``last`` are reversed."""
    cells, length = walk.cells, walk.counts[LENGTH]
    near, after, far = cells[first], cells[first + 1], cells[last]
    delta = turning(near, far, cells[last - 1], turn)
    delta -= turning(near, after, cells[first + 2], turn)
    if first > 0:
        delta += turning(cells[first - 1], near, far, turn)
        delta -= turning(cells[first - 1], near, after, turn)
    if last + 1 < length:
        beyond = cells[last + 1]
        delta += turning(cells[first + 2], after, beyond, turn)
        delta -= turning(cells[last - 1], far, beyond, turn)
        if last + 2 < length:
            delta += turning(after, beyond, cells[last + 2], turn)
            delta -= turning(far, beyond, cells[last + 2], turn)
    return int(delta)


@inlined
def _added_by_flip(ground: Ground, prices: Prices, walk: Walk, first: int, last: int) -> int:
    """Return the change in added prices of steps if visits ``first + 1`` to ``last`` reverse."""
    cells = walk.cells
    near, after, far = cells[first], cells[first + 1], cells[last]
    delta = added(ground, prices, near, far) - added(ground, prices, near, after)
    if last + 1 < walk.counts[LENGTH]:
        beyond = cells[last + 1]
        delta += added(ground, prices, after, beyond) - added(ground, prices, far, beyond)
    return int(delta)


@inlined
def _is_flip(ground: Ground, walk: Walk, first: int, last: int, back: int, free_end: bool) -> bool:
    """Return whether visits ``first + 1`` to ``last`` can be reversed.

    A flip replaces two steps by two new ones. One of these is known to exist: that between the
    second visits of both old steps if ``back``, else that between their first visits.
    """
    if first < 0 or last - first < 2:
        return False
    cells = walk.cells
    if back:
        return leads(ground, cells[first], cells[last])
    if last + 1 == walk.counts[LENGTH]:
        return free_end
    return leads(ground, cells[first + 1], cells[last + 1])


@inlined
def _flip_square(state: _State, index: int, direction: int, choice: int) -> None:
    """Flip the square beside visit ``index`` in ``direction``, if two steps run along it."""
    ground, walk, prices = state.ground, state.walk, state.prices
    here = walk.cells[index]
    if not ground.steps[here] >> direction & 1:
        return
    beside = here + ground.offsets[direction]
    other = walk.place[beside]
    if not is_at(walk, beside, other):
        return
    back = choice & 1
    first, last = min(index, other) - back, max(index, other) - back
    if not _is_flip(ground, walk, first, last, back, prices.free_end):
        return
    turn = prices.quarter_turn_us
    delta = _turns_of_flip(walk, first, last, turn) if turn else 0
    delta += _added_by_flip(ground, prices, walk, first, last)
    if _takes_flip(state, first + 1, delta):
        reverse(walk, first + 1, last)


@lean_kernel
def improve(
    ground: Ground,
    walk: Walk,
    prices: Prices,
    area: NDArray[np.int32],
    temperature_us: int,
    proposals: int,
    random: NDArray[np.uint64],
) -> None:
    """Make proposals at one temperature.

    Args:
        ground: where the walk goes.
        walk: changed in place; its length is below 2^22.
        prices: of the walk, whose cost is minimised.
        area: cells to make the proposals at, int32 (m,); empty for the whole walk.
        temperature_us: temperature [us]; at 0 no change for the worse is taken.
        proposals: how many to make.
        random: stream, uint64 (1,), not 0; advanced.
    """
    state = _State(ground, walk, prices, temperature_us, random)
    for _ in range(proposals):
        bits = draw(random)
        if area.size:
            cell = area[index_of(bits, area.size)]
        elif walk.counts[SPARE_CELLS] and bits >> 8 & 255 < AT_SPARE_OF_256:
            cell = walk.spare[index_of(bits, walk.counts[SPARE_CELLS])]
        else:
            index = index_of(bits, walk.counts[LENGTH])
            cell = walk.cells[index]
            walk.place[cell] = index
        index = walk.place[cell]
        if not is_at(walk, cell, index):
            continue
        direction, choice = bits & 3, bits >> 2 & 63
        if choice < REMOVALS_OF_64 and walk.visits[cell] > ground.needed[cell]:
            _remove(state, index, choice)
        else:
            _flip_square(state, index, direction, choice)
