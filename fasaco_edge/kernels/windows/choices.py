"""Choices: the passages that a cell may have, their costs, and the states that they lead to."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel
from fasaco_edge.kernels.local_search.walk_array import ROOM_BIT, Ground
from fasaco_edge.kernels.random import draw, index_of
from fasaco_edge.kernels.windows.memory import (
    AHEAD,
    BELOW,
    CODE_BITS,
    ENDING,
    EXPANDED,
    FIRST_PAIRING,
    KINDS,
    LAYER_STAMP,
    MOST_PAIRS,
    NO_END,
    TOO_MUCH,
    CurrentCell,
    EndRules,
    Parts,
    Program,
    WalkPrices,
    lanes_at_rim,
)
from fasaco_edge.kernels.windows.parts import is_stuck
from fasaco_edge.kernels.windows.passages import NONE, SLOTS, Passages, passage_cost, side_of
from fasaco_edge.kernels.windows.states import (
    apply_choice,
    file_state,
    list_pairs,
    order_lanes,
    shrink,
    take_incoming,
)

# Steps of the noise; sides of a passage that are the walk's begin, and its end.
UNITS = 1024
WALK_BEGINS, WALK_ENDS = 4, 5


@inlined
def _price(
    ground: Ground,
    passages: Passages,
    terms: WalkPrices,
    cell: int,
    one: int,
    other: int,
    may_end: bool,
) -> int:
    """Return the reduced cost of a passage from a side, TOO_MUCH if there is none."""
    if other < WALK_BEGINS:
        if not ground.steps[cell] >> other & 1:
            return TOO_MUCH
        cost = passage_cost(one, other, terms.step, terms.turn)
        return int(cost + terms.prices[cell, one] + terms.prices[cell, other])
    if other == WALK_BEGINS:
        if cell != passages.ends[0]:
            return TOO_MUCH
        return int(terms.step // 2 + terms.prices[cell, one] + terms.begin_price)
    is_free = terms.free_end and ground.needed[cell] > 0
    if not may_end or not (is_free or cell == passages.ends[1]):
        return TOO_MUCH
    return int(terms.step // 2 + terms.prices[cell, one] + terms.end_price)


@lean_inner_kernel
def price_cells(
    ground: Ground,
    passages: Passages,
    terms: WalkPrices,
    program: Program,
    count: int,
    noise: int,
    random: NDArray[np.uint64],
    may_end: bool,
) -> tuple[int, int]:
    """Write the reduced costs; return the present walk's reduced cost, and the last needed cell."""
    now, last = 0, -1
    for index in range(count):
        cell = program.cells.listed[index]
        mask = ground.steps[cell]
        least = TOO_MUCH
        for one in range(6):
            for other in range(one, 6):
                cost = TOO_MUCH
                if one < WALK_BEGINS and mask >> one & 1:
                    cost = _price(ground, passages, terms, cell, one, other, may_end)
                if cost < TOO_MUCH and noise:
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
    here: CurrentCell,
    ends: EndRules,
    kind: int,
    behind: int,
    above: int,
    may_end: bool,
    most: int,
) -> None:
    """List a cell's choices below a cost, cheapest first."""
    keys = program.choice.keys[kind]
    reduced, sides, pairs = program.reduced[here.number], program.sides, program.pairs
    at_ahead = lanes_at_rim(program.cells.ident, here.cell, here.ahead)
    at_below = lanes_at_rim(program.cells.ident, here.cell, here.below)
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
        filled = _fill(sides, 0, behind, here.behind)
        filled = _fill(sides, filled, above, here.above)
        filled = _fill(sides, filled, ahead, here.ahead)
        filled = _fill(sides, filled, below, here.below)
        filled = _fill(sides, filled, begins, WALK_BEGINS)
        _fill(sides, filled, ending, WALK_ENDS)
        half = size >> 1
        for pairing in range(FIRST_PAIRING[half], FIRST_PAIRING[half + 1]):
            cost = 0
            for pair in range(half):
                one, other = pairs[pairing, 2 * pair], pairs[pairing, 2 * pair + 1]
                cost += reduced[sides[one], sides[other]]
            if cost < most:
                code = ahead << AHEAD | below << BELOW | ending << ENDING | pairing
                keys[listed] = cost << CODE_BITS | code
                listed += 1
    _sort(keys, listed)
    program.choice.listed[kind], program.choice.named[kind] = listed, 0


@inlined
def _fill(sides: NDArray[np.int64], first: int, lanes: int, direction: int) -> int:
    """Write a side's direction for each of its lanes; return where the next one begins."""
    for lane in range(lanes):
        sides[first + lane] = direction
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
def _added(ground: Ground, terms: WalkPrices, cell: int, side: int) -> int:
    """Return the additional price of half a step through a side; nothing at the walk's ends."""
    if side >= WALK_BEGINS:
        return 0
    price = terms.col if side & 1 else terms.row
    if ground.steps[cell] >> (ROOM_BIT + side) & 1:
        price += terms.room
    return price


@lean_inner_kernel
def real_cost(
    ground: Ground, passages: Passages, terms: WalkPrices, cells: NDArray[np.int32], count: int
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


CODES = (1 << CODE_BITS) - 1


@inlined
def _words(here: CurrentCell) -> int:
    """Return how many words of a state are in use, rounded up to an even number.

    A word holds four identifiers; the four spare ones count.
    """
    return (here.spare_id + 11) >> 3 << 1


@inlined
def _leads_nowhere(parts: Parts, state: NDArray[np.int16], ends: EndRules, closed: int) -> bool:
    """Return whether a state is known to be infeasible for the remaining cells."""
    may_ring = ends.ring_price > 0
    if not ends.is_checked or (closed > 0 and not may_ring):
        return False
    is_open = ends.is_free and state[ends.end_id] != NO_END
    return is_stuck(parts, state, is_open, may_ring)


@inlined
def _order_sides(state: NDArray[np.int16], here: CurrentCell) -> int:
    """Order the lanes ahead and below; return which were swapped: 1 ahead, 2 below."""
    swaps = order_lanes(state, here.ahead_id) if here.to_ahead else 0
    if here.to_below:
        swaps += 2 * order_lanes(state, here.below_id)
    return swaps


@inlined
def _expand(
    program: Program,
    here: CurrentCell,
    ends: EndRules,
    layer: int,
    state: int,
    made: int,
    beam: int,
    threshold: int,
    room: int,
) -> tuple[int, int]:
    """File all successors of a state; return the number of states, and the new threshold."""
    states, ident = program.states, program.cells.ident
    words, cost, base = _words(here), states.cost[layer, state], states.base
    for word in range(words):
        states.base_words[word] = states.words[layer, state, word]
    if here.from_behind:
        behind = take_incoming(base, here.ahead_id, here.spare_id)
    else:
        behind = lanes_at_rim(ident, here.cell, here.behind)
    if here.from_above:
        above = take_incoming(base, here.below_id, here.spare_id + 2)
    else:
        above = lanes_at_rim(ident, here.cell, here.above)
    may_end = ends.end_id >= 0 and base[ends.end_id] != NO_END
    kind, choice = (behind * 3 + above) * 2 + int(may_end), program.choice
    if choice.listed[kind] < 0:
        list_choices(program, here, ends, kind, behind, above, may_end, room)
    was_closed = states.closed[layer, state]
    brought = behind << 20 | above << 22 | int(ends.begin_id >= 0) << 26
    for number in range(choice.listed[kind]):
        key = choice.keys[kind, number]
        total = cost + (key >> CODE_BITS)
        if total >= threshold:
            break
        states.clock[EXPANDED] += 1
        if number == choice.named[kind]:
            list_pairs(program, here, ends, kind, number, behind, above)
        closed = apply_choice(states, choice, ends, kind, number, was_closed, words)
        if closed > 1:
            total, closed = total + (closed - 1) * ends.ring_price, 1
        is_out = closed < 0 or total >= threshold
        if is_out or _leads_nowhere(program.parts, states.scratch, ends, closed):
            continue
        swaps = _order_sides(states.scratch, here)
        code = key & CODES | brought | swaps << 24
        made = file_state(states, 1 - layer, made, words, total, closed, state, code)
        if made == states.parent.size:
            made, cut = shrink(states, 1 - layer, made, words, beam)
            threshold = min(threshold, cut)
    return made, threshold


@lean_inner_kernel
def decide(
    program: Program,
    here: CurrentCell,
    ends: EndRules,
    layer: int,
    count: int,
    beam: int,
    limit: int,
) -> int:
    """Write the states after a cell into the other layer; return their number."""
    states = program.states
    states.clock[LAYER_STAMP] += 1
    for kind in range(KINDS):
        program.choice.listed[kind] = -1
    # A state of cost ``most`` before the cell, or ``threshold`` after it, cannot beat the limit.
    most, threshold = limit - program.left[here.number], limit - program.left[here.number + 1]
    cheapest = TOO_MUCH
    for state in range(count):
        cheapest = min(cheapest, states.cost[layer, state])
    made = as_value(0)
    for state in range(count):
        if states.cost[layer, state] < min(most, threshold):
            room = threshold - cheapest
            made, threshold = _expand(
                program, here, ends, layer, state, made, beam, threshold, room
            )
    if made > beam:
        made, _ = shrink(states, 1 - layer, made, _words(here), beam)
    for state in range(made):
        program.kept_parent[here.number + 1, state] = states.parent[state]
        program.kept_code[here.number + 1, state] = states.code[state]
    return made
