"""States of the program: a choice for a cell applied to one, states filed, the dearest dropped."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_kernel
from fasaco_edge.kernels.windows.memory import LAYER_STAMP, NO_END, Ends, Here, Program


@inlined
def take_in(base: NDArray[np.int16], first: int, spare: int) -> int:
    """Name the ends at two identifiers of the frontier anew; return how many there are."""
    found = 0
    for lane in range(2):
        mate = base[first + lane]
        if mate != NO_END:
            base[spare + found], base[mate] = mate, spare + found
            base[first + lane] = NO_END
            found += 1
    return found


@inlined
def _name(program: Program, size: int, cell: int, direction: int, lanes: int, first: int) -> int:
    """Append the identifiers of a side to ``taken``: from ``first`` on; -1 for those at the rim."""
    for lane in range(lanes):
        at_rim = program.ident[cell, 2 * direction + lane]
        program.taken[size + lane] = at_rim if first < 0 else first + lane
    return size + lanes


@inlined
def apply(
    program: Program,
    here: Here,
    ends: Ends,
    code: int,
    behind: int,
    above: int,
    was_closed: int,
    words: int,
) -> int:
    """Write the state after a choice into ``scratch``; return how many rings are closed, or -1."""
    taken, mates = program.taken, program.scratch
    pairing, ahead, below = code & 255, code >> 8 & 3, code >> 10 & 3
    cell, spare = here.cell, here.spare_id
    size = _name(program, 0, cell, here.behind, behind, spare if here.from_behind else -1)
    size = _name(program, size, cell, here.above, above, spare + 2 if here.from_above else -1)
    first_new = size
    size = _name(program, size, cell, here.ahead, ahead, here.ahead_id if here.to_ahead else -1)
    first_below = size
    size = _name(program, size, cell, here.below, below, here.below_id if here.to_below else -1)
    last_new = size
    if ends.begin_id >= 0:
        taken[size] = ends.begin_id
        size += 1
    if code >> 12 & 1:
        taken[size] = ends.end_id
        size += 1
    if was_closed and size and not ends.ring_price:
        return -1
    closed = was_closed
    for word in range(words):
        program.scratch_words[word] = program.base_words[word]
    for pair in range(size >> 1):
        at, to = program.pairs[pairing, 2 * pair], program.pairs[pairing, 2 * pair + 1]
        one, other = taken[at], taken[to]
        is_new = here.to_ahead if first_new <= at < first_below else here.to_below
        is_new = is_new and first_new <= at < last_new
        other_new = here.to_ahead if first_new <= to < first_below else here.to_below
        other_new = other_new and first_new <= to < last_new
        if is_new and other_new:
            mates[one], mates[other] = other, one
        elif is_new:
            mate = mates[other]
            mates[one], mates[mate] = mate, one
            mates[other] = NO_END
        elif other_new:
            mate = mates[one]
            mates[other], mates[mate] = mate, other
            mates[one] = NO_END
        else:
            if mates[one] == other:
                if not ends.may_close or (closed and not ends.ring_price):
                    return -1
                closed += 1
            else:
                mate, further = mates[one], mates[other]
                mates[mate], mates[further] = further, mate
            mates[one] = mates[other] = NO_END
    return closed


@inlined
def order_lanes(mates: NDArray[np.int16], first: int) -> int:
    """Order the two lanes of a side, which differ in name only; return 1 if they change places."""
    one, other = mates[first], mates[first + 1]
    if NO_END in (one, other) or one == first + 1 or one < other:
        return 0
    mates[first], mates[first + 1] = other, one
    mates[other], mates[one] = first, first + 1
    return 1


@inlined
def _hash(state: NDArray[np.int64], words: int) -> int:
    value = 1469598103934665603
    for word in range(words):
        value = (value ^ state[word]) * -7046029254386353131
        value ^= value >> 29
    return value


@inlined
def _same(one: NDArray[np.int64], other: NDArray[np.int64], words: int) -> bool:
    word = 0
    while word < words and one[word] == other[word]:
        word += 1
    return word == words


@inlined
def file_state(
    program: Program,
    layer: int,
    made: int,
    words: int,
    cost: int,
    closed: int,
    parent: int,
    code: int,
) -> int:
    """File the state in ``scratch``, or its lower cost; return how many states there are."""
    mask = program.table.size - 1
    stamp = program.clock[LAYER_STAMP]
    slot = _hash(program.scratch_words, words) & mask
    while program.stamp[slot] == stamp:
        found = program.table[slot]
        is_same = program.closed[layer, found] == closed
        if is_same and _same(program.words[layer, found], program.scratch_words, words):
            if cost < program.cost[layer, found]:
                program.cost[layer, found] = cost
                program.parent[found], program.code[found] = parent, code
            return made
        slot = (slot + 1) & mask
    program.stamp[slot], program.table[slot] = stamp, made
    for word in range(words):
        program.words[layer, made, word] = program.scratch_words[word]
    program.cost[layer, made], program.closed[layer, made] = cost, closed
    program.parent[made], program.code[made] = parent, code
    return made + 1


@lean_kernel
def shrink(program: Program, layer: int, made: int, words: int, beam: int) -> tuple[int, int]:
    """Keep the ``beam`` cheapest states; return how many, and the cost from which on none is."""
    cost, order = program.cost[layer], program.order
    for state in range(made):
        order[state] = cost[state]
    cut = _nth(order, made, beam)
    ties = beam
    for state in range(made):
        ties -= int(cost[state] < cut)
    program.clock[LAYER_STAMP] += 1
    stamp, mask = program.clock[LAYER_STAMP], program.table.size - 1
    kept = 0
    for state in range(made):
        if cost[state] > cut:
            continue
        if cost[state] == cut:
            if ties <= 0:
                continue
            ties -= 1
        if kept != state:
            for word in range(words):
                program.words[layer, kept, word] = program.words[layer, state, word]
            cost[kept], program.closed[layer, kept] = cost[state], program.closed[layer, state]
            program.parent[kept], program.code[kept] = program.parent[state], program.code[state]
        slot = _hash(program.words[layer, kept], words) & mask
        while program.stamp[slot] == stamp:
            slot = (slot + 1) & mask
        program.stamp[slot], program.table[slot] = stamp, kept
        kept += 1
    return kept, cut


@lean_kernel
def _nth(values: NDArray[np.int64], size: int, place: int) -> int:
    """Return what is at ``place`` when the first ``size`` values are in order (Hoare, 1961)."""
    first, last = 0, size - 1
    while first < last:
        pivot = values[(first + last) >> 1]
        low, high = first, last
        while low <= high:
            while values[low] < pivot:
                low += 1
            while values[high] > pivot:
                high -= 1
            if low <= high:
                values[low], values[high] = values[high], values[low]
                low += 1
                high -= 1
        if place <= high:
            last = high
        elif place >= low:
            first = low
        else:
            break
    return int(values[place])
