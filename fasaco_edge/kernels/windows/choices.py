"""Choices of passages for a cell of a window, and their costs."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import ROOM_BIT, Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import (
    AHEAD,
    BELOW,
    CODE_BITS,
    ENDING,
    FIRST_PAIRING,
    MOST_PAIRS,
    MUCH,
    Ends,
    Here,
    Program,
    Terms,
    at_rim,
)
from fasaco_edge.kernels.windows.passages import NONE, SLOTS, Passages, passage_cost, side_of

# Steps of the noise; sides of a passage that are the walk's begin, and its end.
UNITS = 1024
WALK_BEGINS, WALK_ENDS = 4, 5


@inlined
def _price(
    ground: Ground,
    passages: Passages,
    terms: Terms,
    cell: int,
    one: int,
    other: int,
    may_end: bool,
) -> int:
    """Return the reduced cost of a passage from a side, MUCH if there is none."""
    if other < WALK_BEGINS:
        if not ground.steps[cell] >> other & 1:
            return MUCH
        cost = passage_cost(one, other, terms.step, terms.turn)
        return int(cost + terms.prices[cell, one] + terms.prices[cell, other])
    if other == WALK_BEGINS:
        if cell != passages.ends[0]:
            return MUCH
        return int(terms.step // 2 + terms.prices[cell, one] + terms.begin_price)
    is_free = terms.free_end and ground.needed[cell] > 0
    if not may_end or not (is_free or cell == passages.ends[1]):
        return MUCH
    return int(terms.step // 2 + terms.prices[cell, one] + terms.end_price)


@lean_inner_kernel
def price_cells(
    ground: Ground,
    passages: Passages,
    terms: Terms,
    program: Program,
    count: int,
    noise: int,
    random: NDArray[np.uint64],
    may_end: bool,
) -> tuple[int, int]:
    """Write the cells' reduced costs; return the present cost by them, and the last needed cell."""
    now, last = 0, -1
    for index in range(count):
        cell = program.cells.listed[index]
        mask = ground.steps[cell]
        least = MUCH
        for one in range(6):
            for other in range(one, 6):
                cost = MUCH
                if one < WALK_BEGINS and mask >> one & 1:
                    cost = _price(ground, passages, terms, cell, one, other, may_end)
                if cost < MUCH and noise:
                    cost += index_of(draw(random), UNITS) * noise // UNITS
                program.reduced[index, one, other] = program.reduced[index, other, one] = cost
                least = min(least, cost)
        needs = ground.needed[cell] > 0 or cell == passages.ends[0]
        program.left[index] = max(least, 0) if needs else 0
        for slot in range(SLOTS):
            other = passages.partner[cell, slot]
            if other != NONE and other > slot:
                now += program.reduced[index, side_of(slot), side_of(other)]
        if needs:
            last = index
    program.left[count] = 0
    for index in range(count - 1, -1, -1):
        program.left[index] += program.left[index + 1]
    return now, last


@lean_inner_kernel
def list_choices(
    program: Program,
    here: Here,
    ends: Ends,
    kind: int,
    behind: int,
    above: int,
    may_end: bool,
    most: int,
) -> None:
    """List a cell's choices below a cost, cheapest first."""
    keys = program.choice.keys[kind]
    reduced, kinds, pairs = program.reduced[here.number], program.kinds, program.pairs
    at_ahead = at_rim(program.cells.ident, here.cell, here.ahead)
    at_below = at_rim(program.cells.ident, here.cell, here.below)
    last_ahead = 2 if here.to_ahead else at_ahead
    last_below = 2 if here.to_below else at_below
    listed = 0
    for lanes in range(18):
        # All numbers of lanes ahead and below, and whether the walk ends here.
        ahead, below, ending = lanes // 6, lanes // 2 % 3, lanes % 2
        if not (0 if here.to_ahead else at_ahead) <= ahead <= last_ahead:
            continue
        if not (0 if here.to_below else at_below) <= below <= last_below:
            continue
        begins = int(ends.begin_id >= 0)
        size = behind + above + ahead + below + begins + ending
        is_empty = size == 0 and ends.is_needed
        if not int(ends.is_given) <= ending <= int(may_end):
            continue
        if size & 1 or size > 2 * MOST_PAIRS or is_empty:
            continue
        filled = _fill(kinds, 0, behind, here.behind)
        filled = _fill(kinds, filled, above, here.above)
        filled = _fill(kinds, filled, ahead, here.ahead)
        filled = _fill(kinds, filled, below, here.below)
        filled = _fill(kinds, filled, begins, WALK_BEGINS)
        _fill(kinds, filled, ending, WALK_ENDS)
        half = size >> 1
        for pairing in range(FIRST_PAIRING[half], FIRST_PAIRING[half + 1]):
            cost = 0
            for pair in range(half):
                one, other = pairs[pairing, 2 * pair], pairs[pairing, 2 * pair + 1]
                cost += reduced[kinds[one], kinds[other]]
            if cost < most:
                code = ahead << AHEAD | below << BELOW | ending << ENDING | pairing
                keys[listed] = cost << CODE_BITS | code
                listed += 1
    _sort(keys, listed)
    program.choice.listed[kind], program.choice.named[kind] = listed, 0


@inlined
def _fill(kinds: NDArray[np.int64], first: int, lanes: int, direction: int) -> int:
    """Write a side's direction for each of its lanes; return where the next one begins."""
    for lane in range(lanes):
        kinds[first + lane] = direction
    return first + lanes


@inlined
def _sort(keys: NDArray[np.int64], size: int) -> None:
    """Sort the first ``size`` keys (Shell, 1959)."""
    gap = 1
    while gap < size // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for at in range(gap, size):
            key, place = keys[at], at
            while place >= gap and keys[place - gap] > key:
                keys[place] = keys[place - gap]
                place -= gap
            keys[place] = key
        gap //= 3


@inlined
def _added(ground: Ground, terms: Terms, cell: int, side: int) -> int:
    """Return what is added to half a step through a side; nothing at the walk's ends."""
    if side >= WALK_BEGINS:
        return 0
    price = terms.col if side & 1 else terms.row
    if ground.steps[cell] >> (ROOM_BIT + side) & 1:
        price += terms.room
    return price


@lean_inner_kernel
def real_cost(
    ground: Ground, passages: Passages, terms: Terms, cells: NDArray[np.int32], count: int
) -> int:
    """Return the cost of the passages of the first ``count`` cells, without prices."""
    total = 0
    for index in range(count):
        cell = cells[index]
        for slot in range(SLOTS):
            other = passages.partner[cell, slot]
            if other != NONE and other > slot:
                one, two = side_of(slot), side_of(other)
                total += passage_cost(one, two, terms.step, terms.turn)
                total += _added(ground, terms, cell, one) + _added(ground, terms, cell, two)
    return total
