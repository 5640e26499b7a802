"""Usage patterns of a cell's sides, for the dynamic program over bands (``kernels.bound.bands``).

A pattern (way) has for each side to a cell of the same band the number of its uses, 0, 1, or 2 and
more, in two bits by direction. Its cost is that of the cheapest passages with these uses.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.feasible import NO_SIDE
from fasaco_edge.kernels.bound.lines import Lines, StepPrices
from fasaco_edge.kernels.bound.passages import cheapest, sides_of, use_side
from fasaco_edge.kernels.jit import inlined, lean_kernel

# Number of patterns: two bits for each direction, for 0, 1 or 2 uses of a side.
PATTERNS = 256
# Numbers of patterns of the two sides behind a cell, and of the two ahead of it.
INCOMING, OUTGOING = 16, 9


class BandMemory(NamedTuple):
    """Working memory of the program, and each band's limit.

    Attributes:
        sums: int64 (3,), TOTAL, SAVING, BAND.
        limit: int64 (k,), excess from which states are dropped [half us].
        found: int64 (k, 2), excess without the walk's free end and with it, at least.
        is_met: uint8 (k,), whether the excess with the free end is exact, or cannot be known.
        entry: int32, by state its number in ``value``, or -1.
        value, state, parent, pattern: int64 and int32 (n,), states of one band cell by cell:
            excess, the state, its predecessor, and the pattern of the cell's sides.
            begins: int32, where the states after each cell begin.
            codes: int16 (16, 81), by mask of inner sides all their patterns, in order; counts
            int32 (16,), their number.
        cost: int64 (3, PATTERNS), of the ways to use a cell's sides: of passages alone, and with
            one and two visits of one side.
        how: int16 (PATTERNS,), the last passage of each way, and the way without it.
        listed: int32 (2, INCOMING), number of patterns listed by incoming uses, without the free
            end and with it.
        ways: int16 (2, INCOMING, OUTGOING), these; priced: int64, their excess.
    """

    sums: NDArray[np.int64]
    limit: NDArray[np.int64]
    found: NDArray[np.int64]
    is_met: NDArray[np.uint8]
    entry: NDArray[np.int32]
    value: NDArray[np.int64]
    state: NDArray[np.int32]
    parent: NDArray[np.int32]
    pattern: NDArray[np.int32]
    begins: NDArray[np.int32]
    codes: NDArray[np.int16]
    counts: NDArray[np.int32]
    cost: NDArray[np.int64]
    how: NDArray[np.int16]
    listed: NDArray[np.int32]
    ways: NDArray[np.int16]
    priced: NDArray[np.int64]


@inlined
def halves_of(lines: Lines, cell: int) -> int:
    """Return the number of a cell's visits with one side only: the walk's first and last visit."""
    return int(cell == lines.start) + int(cell == lines.end)


@inlined
def least_of(lines: Lines, prices: StepPrices, cell: int, step: int, turn: int) -> int:
    """Return the least cost of a cell."""
    sides = sides_of(lines, prices, cell)
    halves = halves_of(lines, cell)
    if halves:
        return halves * (step // 2 + min(sides))
    return cheapest(sides, step, turn) if lines.wanted[cell] else 0


@inlined
def _with_side(inner: int, way: int, side: int) -> int:
    """Return a pattern with one more use of a side."""
    if not inner >> side & 1 or way >> 2 * side & 2:
        return way
    return way + (1 << 2 * side)


@lean_kernel
def _price_ways(
    lines: Lines,
    prices: StepPrices,
    memory: BandMemory,
    inner: int,
    cell: int,
    highest: int,
    step: int,
    turn: int,
) -> tuple[int, int]:
    """Price all patterns of a cell that passages below ``highest`` can form.

    Returns:
        The cheapest passage between sides that lead out of the band: its price, and which one it
        is, as 4 * side + side.
    """
    plain, codes = memory.cost[0], memory.codes[inner]
    sides = sides_of(lines, prices, cell)
    for number in range(memory.counts[inner]):
        plain[codes[number]] = NO_SIDE
    plain[0] = 0
    outer, outside = NO_SIDE, 0
    for one in range(4):
        for other in range(one, 4):
            turns = 2 if one == other else (one ^ other) & 1
            price = step + turns * turn + sides[one] + sides[other]
            if price >= highest:
                continue
            if not inner >> one & 1 and not inner >> other & 1:
                if price < outer:
                    outer, outside = price, 4 * one + other
                continue
            # Ways with more uses come later: so a passage may be taken again.
            for number in range(memory.counts[inner]):
                way = codes[number]
                if plain[way] + price < highest:
                    more = _with_side(inner, _with_side(inner, way, one), other)
                    if plain[way] + price < plain[more]:
                        plain[more] = plain[way] + price
                        memory.how[more] = (4 * one + other) << 8 | way
    return outer, outside


@lean_kernel
def _add_half(
    memory: BandMemory,
    source: int,
    target: int,
    inner: int,
    sides: tuple[int, int, int, int],
    step: int,
) -> None:
    """Price all patterns of a row of ``cost`` with one more visit that has one side only."""
    codes = memory.codes[inner]
    for number in range(memory.counts[inner]):
        memory.cost[target, codes[number]] = NO_SIDE
    for number in range(memory.counts[inner]):
        cost = memory.cost[source, codes[number]]
        if cost >= NO_SIDE:
            continue
        for side in range(4):
            if sides[side] < NO_SIDE:
                more = _with_side(inner, codes[number], side)
                price = cost + step // 2 + sides[side]
                memory.cost[target, more] = min(memory.cost[target, more], price)


@lean_kernel
def list_ways(
    lines: Lines,
    prices: StepPrices,
    memory: BandMemory,
    inner: int,
    cell: int,
    limit: int,
    saving: int,
    step: int,
    turn: int,
) -> None:
    """List a cell's patterns by incoming uses, with their excess."""
    sides, least = sides_of(lines, prices, cell), least_of(lines, prices, cell, step, turn)
    # First and last visits may have a negative cost.
    highest = limit + saving + max(least, 0)
    outer, _ = _price_ways(lines, prices, memory, inner, cell, highest, step, turn)
    for coming in range(INCOMING):
        memory.listed[0, coming] = memory.listed[1, coming] = 0
    halves = halves_of(lines, cell)
    for number in range(halves):
        _add_half(memory, number, number + 1, inner, sides, step)
    if lines.wanted[cell]:
        if lines.end < 0:
            _add_half(memory, 0, 1, inner, sides, step)
            _list(memory, 1, 1, inner, least, limit - saving)
        memory.cost[0, 0] = outer
    _list(memory, 0, halves, inner, least, limit)


@inlined
def _list(memory: BandMemory, layer: int, row: int, inner: int, least: int, limit: int) -> None:
    """List the patterns of a row of ``cost`` whose excess is below the limit."""
    for number in range(memory.counts[inner]):
        way = int(memory.codes[inner, number])
        excess = memory.cost[row, way] - least
        if excess < limit:
            coming = way >> 4
            count = memory.listed[layer, coming]
            memory.ways[layer, coming, count] = way
            memory.priced[layer, coming, count] = excess
            memory.listed[layer, coming] = count + 1


@lean_kernel
def use_way(
    lines: Lines,
    prices: StepPrices,
    memory: BandMemory,
    inner: int,
    cell: int,
    pattern: int,
    highest: int,
    step: int,
    turn: int,
    times: int,
) -> None:
    """Count the use of a cell's sides, as the cheapest passages use them in a way."""
    highest += max(least_of(lines, prices, cell, step, turn), 0)
    way = pattern & PATTERNS - 1
    _, outside = _price_ways(lines, prices, memory, inner, cell, highest, step, turn)
    plain, use = memory.cost[0], prices.use
    sides = sides_of(lines, prices, cell)
    halves = halves_of(lines, cell) + (pattern >> 8)
    # The half visits that lead to the way at the least cost, from passages alone.
    rest, one, other, least = way, -1, -1, NO_SIDE
    if halves:
        for number in range(memory.counts[inner]):
            before = int(memory.codes[inner, number])
            if plain[before] >= NO_SIDE:
                continue
            for side in range(4):
                if sides[side] >= NO_SIDE:
                    continue
                with_one = _with_side(inner, before, side)
                for second in range(4 if halves > 1 else 1):
                    cost, more = plain[before] + sides[side], with_one
                    if halves > 1:
                        if sides[second] >= NO_SIDE:
                            continue
                        cost += sides[second]
                        more = _with_side(inner, more, second)
                    if more == way and cost < least:
                        rest, one, other, least = before, side, second, cost
        use_side(lines, use, cell, one, times)
        if halves > 1:
            use_side(lines, use, cell, other, times)
    elif way == 0 and lines.wanted[cell]:
        use_side(lines, use, cell, outside >> 2, times)
        use_side(lines, use, cell, outside & 3, times)
    while rest:
        taken = int(memory.how[rest])
        use_side(lines, use, cell, taken >> 10, times)
        use_side(lines, use, cell, taken >> 8 & 3, times)
        rest = taken & PATTERNS - 1
