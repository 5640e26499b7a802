"""A tighter bound: bands of cells with consistent passages, solved exactly.

Solved cell by cell, the relaxation of ``kernels.bound.turns`` is as weak as its fractional optimum:
half a passage along a cell and half a passage across it cost less than any whole one. Here the
cells of a band, some rows wide, have whole passages, and each step within the band is left as often
as it is entered; between bands, flow balance stays relaxed and is only priced. A dynamic program
over the frontier finds the cheapest choice. A state is the use of each step that leads on from the
cells behind: 0, 1, or 2 and more, which count as the same and so only lower the bound.

All prices are feasible, so no passage has a negative reduced cost, and the cost of a choice above
the cheapest passages of all cells (its excess) only grows. States above a limit are dropped; if
every choice of a band exceeds the limit, its excess is at least the limit.

Source: Guignard and Kim, "Lagrangean decomposition", 1987, for bounds by parts solved exactly.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.feasible import NO_SIDE, make_feasible
from fasaco_edge.kernels.bound.lines import Lines, StepPrices
from fasaco_edge.kernels.bound.passages import cheapest, follow, sides_of, use_passage
from fasaco_edge.kernels.bound.ways import (
    BandMemory,
    least_of,
    list_ways,
    use_way,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel

# A band's next limit is the excess found plus a quarter of it, plus 1 / SLACK of a corner.
SLACK = 8
# Entries of ``sums``: the bound so far, the largest saving by the walk's free end, and the next
# band.
TOTAL, SAVING, BAND = 0, 1, 2


class Bands(NamedTuple):
    """Cells by bands, column by column.

    Attributes:
        order: int32 (m,), cells in the order of the program.
        place: uint8 (m,), row of each cell within its band.
        inner: uint8 (m,), mask of each cell's sides to cells of the same band.
        first: int32 (k + 1,), where each band begins in the order.
        width: rows of the widest band.
    """

    order: NDArray[np.int32]
    place: NDArray[np.uint8]
    inner: NDArray[np.uint8]
    first: NDArray[np.int32]
    width: int


@lean_kernel
def begin_bands(lines: Lines, prices: StepPrices, memory: BandMemory, step: int, turn: int) -> None:
    """Begin an iteration: make the prices feasible, and bound each cell by itself.

    Args:
        lines: the cells, two or more.
        prices: changed in place.
        memory: changed in place.
        step, turn: a step and a quarter-turn [half us], the step an even number.
    """
    make_feasible(lines, prices, step, turn)
    total, saving = 0, 0
    for cell in range(lines.sides.size):
        prices.use[0, cell] = prices.use[1, cell] = 0
        least = least_of(lines, prices, cell, step, turn)
        total += least
        if lines.end < 0 and lines.wanted[cell]:
            saving = max(saving, least - step // 2 - min(sides_of(lines, prices, cell)))
    memory.sums[TOTAL], memory.sums[SAVING], memory.sums[BAND] = total, saving, 0


@lean_kernel
def solve_bands(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    step: int,
    turn: int,
    cells: int,
) -> bool:
    """Solve the next bands, up to a number of cells; return whether any is left."""
    saving, band = memory.sums[SAVING], memory.sums[BAND]
    until = bands.first[band] + cells
    while band < bands.first.size - 1 and bands.first[band] < until:
        if _solve(lines, prices, bands, memory, band, step, turn, saving):
            _trace(lines, prices, bands, memory, band, as_value(0), step, turn, saving, as_value(1))
        else:
            _use_cells(lines, prices, bands, band, step, turn)
        memory.sums[TOTAL] += memory.found[band, 0]
        band += 1
    memory.sums[BAND] = band
    return bool(band < bands.first.size - 1)


@lean_kernel
def end_bands(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    step: int,
    turn: int,
    pace: int,
) -> int:
    """Return the bound of the prices [half us], and move the prices by the pace [half us]."""
    total = memory.sums[TOTAL]
    if lines.end < 0:
        total += _end(lines, prices, bands, memory, step, turn, memory.sums[SAVING])
    for band in range(bands.first.size - 1):
        memory.limit[band] = memory.found[band, 0] * 5 // 4 + (step + turn) // SLACK + 1
    follow(lines, prices, pace)
    return int(total)


@lean_kernel
def _end(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    step: int,
    turn: int,
    saving: int,
) -> int:
    """Let the walk end in the band where that is cheapest; return the additional cost."""
    while True:
        ends, cost = as_value(0), NO_SIDE
        for band in range(bands.first.size - 1):
            if memory.found[band, 1] - memory.found[band, 0] < cost:
                ends, cost = band, memory.found[band, 1] - memory.found[band, 0]
        if memory.is_met[ends]:
            break
        memory.limit[ends] *= 2
        if not _solve(lines, prices, bands, memory, ends, step, turn, saving):
            return cost
    if _solve(lines, prices, bands, memory, ends, step, turn, saving):
        _trace(lines, prices, bands, memory, ends, as_value(0), step, turn, saving, as_value(-1))
        _trace(lines, prices, bands, memory, ends, as_value(1), step, turn, saving, as_value(1))
    return cost


@lean_kernel
def _solve(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    band: int,
    step: int,
    turn: int,
    saving: int,
) -> bool:
    """Solve a band with a sufficient limit; return False if its states do not fit the memory."""
    while True:
        if not _expand(lines, prices, bands, memory, band, step, turn, saving):
            memory.is_met[band] = 1
            return False
        limit = memory.limit[band]
        memory.is_met[band] = memory.found[band, 1] < limit - saving
        memory.found[band, 1] = min(memory.found[band, 1], limit - saving)
        if memory.found[band, 0] < limit:
            return True
        memory.limit[band] = 2 * limit


@lean_kernel
def _expand(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    band: int,
    step: int,
    turn: int,
    saving: int,
) -> bool:
    """Expand a band's states, and note its least excess; return as ``_solve`` does.

    States without the free end are kept below the limit, states with it below the limit minus
    the largest saving by that end.
    """
    first, last = bands.first[band], bands.first[band + 1]
    limit, below, free = memory.limit[band], 2 * bands.width, 2 * bands.width + 2
    value, state, entry, begins = memory.value, memory.state, memory.entry, memory.begins
    begins[0], begins[1] = 0, 1
    value[0], state[0], memory.parent[0], memory.pattern[0] = 0, 0, -1, 0
    for index in range(first, last):
        cell, number = bands.order[index], index - first
        inner, ahead = int(bands.inner[cell]), 2 * int(bands.place[cell])
        list_ways(lines, prices, memory, inner, cell, limit, saving, step, turn)
        made = begins[number + 1]
        for old in range(begins[number], begins[number + 1]):
            before = int(state[old])
            coming = (before >> ahead & 3) | (before >> below & 3) << 2
            rest = before & ~(3 << ahead | 3 << below)
            for layer in range(1 if before >> free else 2):
                most = (limit - saving if before >> free | layer else limit) - value[old]
                for which in range(memory.listed[layer, coming]):
                    if memory.priced[layer, coming, which] >= most:
                        continue
                    excess = value[old] + memory.priced[layer, coming, which]
                    way = int(memory.ways[layer, coming, which])
                    after = rest | (way & 3) << ahead | (way >> 2 & 3) << below | layer << free
                    known = entry[after]
                    if known < 0:
                        if made == value.size:
                            _forget(memory, begins[number + 1], made)
                            _note_least(memory, band, begins[number], begins[number + 1], free)
                            # Dropped states have at least the limit.
                            least = min(memory.found[band, 0], limit)
                            memory.found[band, 0] = least
                            memory.found[band, 1] = min(memory.found[band, 1], least - saving)
                            return False
                        known = made
                        entry[after] = made
                        state[made] = after
                        value[made] = excess + 1
                        made += 1
                    if excess < value[known]:
                        value[known], memory.parent[known] = excess, old
                        memory.pattern[known] = way | layer << 8
        _forget(memory, begins[number + 1], made)
        begins[number + 2] = made
    _note_least(memory, band, begins[last - first], begins[last - first + 1], free)
    return True


@inlined
def _forget(memory: BandMemory, first: int, last: int) -> None:
    """Clear the numbers of states."""
    for index in range(first, last):
        memory.entry[memory.state[index]] = -1


@inlined
def _note_least(memory: BandMemory, band: int, first: int, last: int, free: int) -> None:
    """Note the least excess among states, without the free end and with it."""
    memory.found[band, 0] = memory.found[band, 1] = NO_SIDE
    for index in range(first, last):
        layer = int(memory.state[index]) >> free
        memory.found[band, layer] = min(memory.found[band, layer], memory.value[index])


@lean_kernel
def _trace(
    lines: Lines,
    prices: StepPrices,
    bands: Bands,
    memory: BandMemory,
    band: int,
    layer: int,
    step: int,
    turn: int,
    saving: int,
    times: int,
) -> None:
    """Count the use of sides by the best choice of the band solved last."""
    highest = memory.limit[band] + saving
    first, last, free = bands.first[band], bands.first[band + 1], 2 * bands.width + 2
    at, least = -1, NO_SIDE
    for index in range(memory.begins[last - first], memory.begins[last - first + 1]):
        if int(memory.state[index]) >> free == layer and memory.value[index] < least:
            at, least = index, memory.value[index]
    for index in range(last - 1, first - 1, -1):
        if at < 0:
            return
        cell = bands.order[index]
        inner, pattern = int(bands.inner[cell]), memory.pattern[at]
        use_way(lines, prices, memory, inner, cell, pattern, highest, step, turn, times)
        at = memory.parent[at]


@lean_kernel
def _use_cells(
    lines: Lines, prices: StepPrices, bands: Bands, band: int, step: int, turn: int
) -> None:
    """Count the use of sides by the cheapest passages of each cell of a band."""
    for index in range(bands.first[band], bands.first[band + 1]):
        cell = bands.order[index]
        sides = sides_of(lines, prices, cell)
        if lines.wanted[cell]:
            least = cheapest(sides, step, turn)
            use_passage(lines, prices.use, cell, sides, least, step, turn, as_value(1))
