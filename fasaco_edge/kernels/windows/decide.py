"""One step of the dynamic program: the successor states of one cell.

Read ``passages`` (sides, lanes) and ``memory`` (identifiers, mates) first.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel
from fasaco_edge.kernels.windows.choices import list_choices
from fasaco_edge.kernels.windows.memory import (
    CODE_BITS,
    EXPANDED,
    KINDS,
    LAYER_STAMP,
    MUCH,
    NO_END,
    Ends,
    Here,
    Parts,
    Program,
    at_rim,
)
from fasaco_edge.kernels.windows.parts import is_stuck
from fasaco_edge.kernels.windows.states import (
    apply,
    file_state,
    name_ends,
    order_lanes,
    shrink,
    take_in,
)

CODES = (1 << CODE_BITS) - 1


@inlined
def _words(here: Here) -> int:
    """Return how many words of a state are in use, rounded up to an even number.

    A word holds four identifiers; the four spare ones count.
    """
    return (here.spare_id + 11) >> 3 << 1


@inlined
def _leads_nowhere(parts: Parts, state: NDArray[np.int16], ends: Ends, closed: int) -> bool:
    """Return whether a state is known to be infeasible for the remaining cells."""
    may_ring = ends.ring_price > 0
    if not ends.is_checked or (closed > 0 and not may_ring):
        return False
    is_open = ends.is_free and state[ends.end_id] != NO_END
    return is_stuck(parts, state, is_open, may_ring)


@inlined
def _order_sides(state: NDArray[np.int16], here: Here) -> int:
    """Order the lanes ahead and below; return which were swapped: 1 ahead, 2 below."""
    swaps = order_lanes(state, here.ahead_id) if here.to_ahead else 0
    if here.to_below:
        swaps += 2 * order_lanes(state, here.below_id)
    return swaps


@inlined
def _expand(
    program: Program,
    here: Here,
    ends: Ends,
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
        behind = take_in(base, here.ahead_id, here.spare_id)
    else:
        behind = at_rim(ident, here.cell, here.behind)
    if here.from_above:
        above = take_in(base, here.below_id, here.spare_id + 2)
    else:
        above = at_rim(ident, here.cell, here.above)
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
            name_ends(program, here, ends, kind, number, behind, above)
        closed = apply(states, choice, ends, kind, number, was_closed, words)
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
    program: Program, here: Here, ends: Ends, layer: int, count: int, beam: int, limit: int
) -> int:
    """Write the states after a cell into the other layer; return their number."""
    states = program.states
    states.clock[LAYER_STAMP] += 1
    for kind in range(KINDS):
        program.choice.listed[kind] = -1
    # A state of cost ``most`` before the cell, or ``threshold`` after it, cannot beat the limit.
    most, threshold = limit - program.left[here.number], limit - program.left[here.number + 1]
    cheapest = MUCH
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
