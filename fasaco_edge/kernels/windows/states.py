"""States of the dynamic program: apply a choice, merge equal states, drop the dearest ones."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel
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
    Choices,
    CurrentCell,
    EndRules,
    Program,
    States,
)

# The lowest bits of a slot's entry are the state, the others the stamp of its layer.
INDEX_BITS, INDICES = 16, 65535


@inlined
def take_incoming(base: NDArray[np.int16], first: int, spare: int) -> int:
    """Rename the ends at identifiers ``first`` and ``first + 1``; return how many there were."""
    found = 0
    for lane in range(2):
        mate = base[first + lane]
        if mate != NO_END:
            base[spare + found], base[mate] = mate, spare + found
            base[first + lane] = NO_END
            found += 1
    return found


@inlined
def _name(
    taken: NDArray[np.int16],
    ident: NDArray[np.int16],
    size: int,
    cell: int,
    direction: int,
    lanes: int,
    first: int,
) -> int:
    """Append a side's identifiers to ``taken``: ``first`` and the next; if -1, those at the rim."""
    for lane in range(lanes):
        at_rim = ident[cell, 2 * direction + lane]
        taken[size + lane] = at_rim if first < 0 else first + lane
    return size + lanes


@inlined
def list_pairs(
    program: Program,
    here: CurrentCell,
    ends: EndRules,
    kind: int,
    number: int,
    behind: int,
    above: int,
) -> None:
    """Write which identifiers a choice pairs up, and which of them are new."""
    taken, ident, choice = program.taken, program.cells.ident, program.choice
    code = choice.keys[kind, number]
    ahead, below = code >> AHEAD & 3, code >> BELOW & 3
    cell, spare = here.cell, here.spare_id
    size = _name(taken, ident, 0, cell, here.behind, behind, spare if here.from_behind else -1)
    size = _name(taken, ident, size, cell, here.above, above, spare + 2 if here.from_above else -1)
    first_new = size
    size = _name(
        taken, ident, size, cell, here.ahead, ahead, here.ahead_id if here.to_ahead else -1
    )
    first_below = size
    size = _name(
        taken, ident, size, cell, here.below, below, here.below_id if here.to_below else -1
    )
    last_new = size
    if ends.begin_id >= 0:
        taken[size] = ends.begin_id
        size += 1
    if code >> ENDING & 1:
        taken[size] = ends.end_id
        size += 1
    for pair in range(size >> 1):
        new_ends = 0
        for end in range(2):
            at = program.pairs[code & PAIRING, 2 * pair + end]
            is_new = here.to_ahead if at < first_below else here.to_below
            if is_new and first_new <= at < last_new:
                new_ends |= FIRST_NEW << end
            choice.ends[kind, number, 2 * pair + end] = taken[at]
        choice.new_ends[kind, number, pair] = new_ends
    if size >> 1 < MOST_PAIRS:
        choice.new_ends[kind, number, size >> 1] = NO_PAIR
    choice.named[kind] = number + 1


@inlined
def apply_choice(
    states: States,
    choice: Choices,
    ends: EndRules,
    kind: int,
    number: int,
    was_closed: int,
    words: int,
) -> int:
    """Write the state after a choice into ``scratch``; return how many rings are closed, or -1."""
    mates = states.scratch
    if was_closed and choice.new_ends[kind, number, 0] != NO_PAIR and not ends.ring_price:
        return -1
    closed = was_closed
    for word in range(words):
        states.scratch_words[word] = states.base_words[word]
    for pair in range(MOST_PAIRS):
        new_ends = choice.new_ends[kind, number, pair]
        if new_ends == NO_PAIR:
            break
        one, other = choice.ends[kind, number, 2 * pair], choice.ends[kind, number, 2 * pair + 1]
        if new_ends == FIRST_NEW | SECOND_NEW:
            mates[one], mates[other] = other, one
        elif new_ends == FIRST_NEW:
            mate = mates[other]
            mates[one], mates[mate] = mate, one
            mates[other] = NO_END
        elif new_ends == SECOND_NEW:
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
    # Two independent chains, as each multiplication waits for the one before it.
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
    states: States,
    layer: int,
    made: int,
    words: int,
    cost: int,
    closed: int,
    parent: int,
    code: int,
) -> int:
    """Add the state in ``scratch``, or lower an equal state's cost; return the number of states."""
    mask = states.table.size - 1
    stamp = states.clock[LAYER_STAMP]
    value = _hash(states.scratch_words, words)
    slot = _slot_of(value, mask)
    while states.table[slot] >> INDEX_BITS == stamp:
        found = states.table[slot] & INDICES
        is_same = states.hash[found] == value and states.closed[layer, found] == closed
        if is_same and _same(states.words[layer, found], states.scratch_words, words):
            if cost < states.cost[layer, found]:
                states.cost[layer, found] = cost
                states.parent[found], states.code[found] = parent, code
            return made
        slot = (slot + 1) & mask
    states.table[slot] = stamp << INDEX_BITS | made
    for word in range(words):
        states.words[layer, made, word] = states.scratch_words[word]
    states.cost[layer, made], states.closed[layer, made] = cost, closed
    states.parent[made], states.code[made], states.hash[made] = parent, code, value
    return made + 1


@lean_inner_kernel
def shrink(states: States, layer: int, made: int, words: int, beam: int) -> tuple[int, int]:
    """Keep the ``beam`` cheapest states; return their number, and the least cost dropped."""
    cost, order = states.cost[layer], states.order
    for state in range(made):
        order[state] = cost[state]
    cut = _nth(order, made, beam)
    ties = beam
    for state in range(made):
        ties -= int(cost[state] < cut)
    states.clock[LAYER_STAMP] += 1
    stamp, mask = states.clock[LAYER_STAMP], states.table.size - 1
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
                states.words[layer, kept, word] = states.words[layer, state, word]
            cost[kept], states.closed[layer, kept] = cost[state], states.closed[layer, state]
            states.parent[kept], states.code[kept] = states.parent[state], states.code[state]
            states.hash[kept] = states.hash[state]
        slot = _slot_of(states.hash[kept], mask)
        while states.table[slot] >> INDEX_BITS == stamp:
            slot = (slot + 1) & mask
        states.table[slot] = stamp << INDEX_BITS | kept
        kept += 1
    return kept, cut


@lean_inner_kernel
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
