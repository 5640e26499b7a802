"""One step of the dynamic program: the successor states of one cell."""

from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel
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
    """Return how many words of a state are in use, an even number: four identifiers each.

    Four of them are spare.
    """
    return (here.spare_id + 11) >> 3 << 1


@inlined
def _leads_nowhere(program: Program, ends: Ends, closed: int) -> bool:
    """Return whether the state in ``scratch`` is known to be infeasible for the remaining cells."""
    may_ring = ends.ring_price > 0
    if not ends.is_checked or (closed > 0 and not may_ring):
        return False
    is_open = ends.is_free and program.scratch[ends.end_id] != NO_END
    return is_stuck(program, is_open, may_ring)


@inlined
def _order_sides(program: Program, here: Here) -> int:
    """Order the lanes of the next sides; return which were swapped: 1 ahead, 2 below."""
    swaps = order_lanes(program.scratch, here.ahead_id) if here.to_ahead else 0
    if here.to_below:
        swaps += 2 * order_lanes(program.scratch, here.below_id)
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
    words, cost, base = _words(here), program.cost[layer, state], program.base
    for word in range(words):
        program.base_words[word] = program.words[layer, state, word]
    if here.from_behind:
        behind = take_in(base, here.ahead_id, here.spare_id)
    else:
        behind = at_rim(program, here.cell, here.behind)
    if here.from_above:
        above = take_in(base, here.below_id, here.spare_id + 2)
    else:
        above = at_rim(program, here.cell, here.above)
    may_end = ends.end_id >= 0 and base[ends.end_id] != NO_END
    kind, choice = (behind * 3 + above) * 2 + int(may_end), program.choice
    if choice.listed[kind] < 0:
        list_choices(program, here, ends, kind, behind, above, may_end, room)
    was_closed = program.closed[layer, state]
    brought = behind << 20 | above << 22 | int(ends.begin_id >= 0) << 26
    for number in range(choice.listed[kind]):
        key = choice.keys[kind, number]
        total = cost + (key >> CODE_BITS)
        if total >= threshold:
            break
        program.clock[EXPANDED] += 1
        if number == choice.named[kind]:
            name_ends(program, here, ends, kind, number, behind, above)
        closed = apply(program, ends, kind, number, was_closed, words)
        if closed > 1:
            total, closed = total + (closed - 1) * ends.ring_price, 1
        if closed < 0 or total >= threshold or _leads_nowhere(program, ends, closed):
            continue
        swaps = _order_sides(program, here)
        code = key & CODES | brought | swaps << 24
        made = file_state(program, 1 - layer, made, words, total, closed, state, code)
        if made == program.parent.size:
            made, cut = shrink(program, 1 - layer, made, words, beam)
            threshold = min(threshold, cut)
    return made, threshold


@lean_kernel
def decide(
    program: Program, here: Here, ends: Ends, layer: int, states: int, beam: int, limit: int
) -> int:
    """Write the states after a cell into the other layer; return their number."""
    program.clock[LAYER_STAMP] += 1
    for kind in range(KINDS):
        program.choice.listed[kind] = -1
    # Costs from which a state before the cell, and one after it, cannot stay below the limit.
    most, threshold = limit - program.left[here.number], limit - program.left[here.number + 1]
    cheapest = MUCH
    for state in range(states):
        cheapest = min(cheapest, program.cost[layer, state])
    made = as_value(0)
    for state in range(states):
        if program.cost[layer, state] < min(most, threshold):
            room = threshold - cheapest
            made, threshold = _expand(
                program, here, ends, layer, state, made, beam, threshold, room
            )
    if made > beam:
        made, _ = shrink(program, 1 - layer, made, _words(here), beam)
    for state in range(made):
        program.kept_parent[here.number + 1, state] = program.parent[state]
        program.kept_code[here.number + 1, state] = program.code[state]
    return made
