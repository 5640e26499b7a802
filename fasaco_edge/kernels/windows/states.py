"""States of the program: apply a choice to a state, file states, drop the most expensive."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_kernel
from fasaco_edge.kernels.windows.memory import (
    AHEAD,
    BELOW,
    ENDING,
    FIRST_NEW,
    LAYER_STAMP,
    MOST_PAIRS,
    NO_END,
    NO_PAIR,
    PAIRING,
    SECOND_NEW,
    Ends,
    Here,
    Program,
)

# The lowest bits of a slot's entry are the state, the others the stamp of its layer.
INDEX_BITS, INDICES = 16, 65535


@inlined
def take_in(base: NDArray[np.int16], first: int, spare: int) -> int:
    """Rename the ends at two identifiers of the frontier; return their number."""
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
def name_ends(
    program: Program,
    here: Here,
    ends: Ends,
    kind: int,
    number: int,
    behind: int,
    above: int,
) -> None:
    """Write which identifiers a choice pairs up, and which of them are new."""
    taken, choice = program.taken, program.choice
    code = choice.keys[kind, number]
    ahead, below = code >> AHEAD & 3, code >> BELOW & 3
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
    if code >> ENDING & 1:
        taken[size] = ends.end_id
        size += 1
    for pair in range(size >> 1):
        how = 0
        for end in range(2):
            at = program.pairs[code & PAIRING, 2 * pair + end]
            is_new = here.to_ahead if at < first_below else here.to_below
            if is_new and first_new <= at < last_new:
                how |= FIRST_NEW << end
            choice.ends[kind, number, 2 * pair + end] = taken[at]
        choice.how[kind, number, pair] = how
    if size >> 1 < MOST_PAIRS:
        choice.how[kind, number, size >> 1] = NO_PAIR
    choice.named[kind] = number + 1


@inlined
def apply(program: Program, ends: Ends, kind: int, number: int, was_closed: int, words: int) -> int:
    """Write the state after a choice into ``scratch``; return how many rings are closed, or -1."""
    choice, mates = program.choice, program.scratch
    if was_closed and choice.how[kind, number, 0] != NO_PAIR and not ends.ring_price:
        return -1
    closed = was_closed
    for word in range(words):
        program.scratch_words[word] = program.base_words[word]
    for pair in range(MOST_PAIRS):
        how = choice.how[kind, number, pair]
        if how == NO_PAIR:
            break
        one, other = choice.ends[kind, number, 2 * pair], choice.ends[kind, number, 2 * pair + 1]
        if how == FIRST_NEW | SECOND_NEW:
            mates[one], mates[other] = other, one
        elif how == FIRST_NEW:
            mate = mates[other]
            mates[one], mates[mate] = mate, one
            mates[other] = NO_END
        elif how == SECOND_NEW:
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
    """Return the hash of a state: its highest bits depend on the whole state."""
    one, other = 1469598103934665603, 6148914691236517205
    # Two chains: each multiplication waits for the last one.
    for word in range(0, words, 2):
        one = (one ^ state[word]) * -7046029254386353131
        other = (other ^ state[word + 1]) * -4417276706812531889
    return one ^ other * -7046029254386353131


@inlined
def _slot_of(value: int, mask: int) -> int:
    return (value >> 48 ^ value >> 32) & mask


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
    """File the state in ``scratch``, or its lower cost; return the number of states."""
    mask = program.table.size - 1
    stamp = program.clock[LAYER_STAMP]
    value = _hash(program.scratch_words, words)
    slot = _slot_of(value, mask)
    while program.table[slot] >> INDEX_BITS == stamp:
        found = program.table[slot] & INDICES
        is_same = program.hash[found] == value and program.closed[layer, found] == closed
        if is_same and _same(program.words[layer, found], program.scratch_words, words):
            if cost < program.cost[layer, found]:
                program.cost[layer, found] = cost
                program.parent[found], program.code[found] = parent, code
            return made
        slot = (slot + 1) & mask
    program.table[slot] = stamp << INDEX_BITS | made
    for word in range(words):
        program.words[layer, made, word] = program.scratch_words[word]
    program.cost[layer, made], program.closed[layer, made] = cost, closed
    program.parent[made], program.code[made], program.hash[made] = parent, code, value
    return made + 1


@lean_kernel
def shrink(program: Program, layer: int, made: int, words: int, beam: int) -> tuple[int, int]:
    """Keep the ``beam`` cheapest states; return their number, and the least cost dropped."""
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
            program.hash[kept] = program.hash[state]
        slot = _slot_of(program.hash[kept], mask)
        while program.table[slot] >> INDEX_BITS == stamp:
            slot = (slot + 1) & mask
        program.table[slot] = stamp << INDEX_BITS | kept
        kept += 1
    return kept, cut


@lean_kernel
def _nth(values: NDArray[np.int64], size: int, place: int) -> int:
    """Return the value at ``place`` if the first ``size`` values were sorted (Hoare, 1961)."""
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
