"""Dynamic program over a window, see ``kernels.windows``: its begin, lines of cells, and result.

Costs are reduced by the prices of steps (``kernels.bound.turns``): no passage has a negative
reduced cost, so the undecided cells cost at least the sum of their cheapest passages, and states
that cannot be cheaper than the present walk are dropped. If more states are left than the beam
takes, the most expensive ones are dropped, too. All amounts are half microseconds.

On a whole ground a narrow beam soon holds no state that can still become a single ring. So several
rings may close there at a price (``ring_price``), and ``kernels.windows.search`` joins them.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.windows.choices import decide, price_cells, real_cost
from fasaco_edge.kernels.windows.memory import (
    AHEAD,
    BEGIN_ID,
    BELOW,
    COUNT,
    END_ID,
    ENDING,
    IDS,
    LAST,
    LAYER,
    LIMIT,
    LINE,
    MOST_IDS,
    NO_END,
    NUMBER,
    PAIRING,
    RING_PRICE,
    STATES,
    CurrentCell,
    EndRules,
    Parts,
    Program,
    WalkPrices,
    WindowCells,
)
from fasaco_edge.kernels.windows.parts import (
    FEW_CELLS,
    LEADS,
    label_parts,
    leads_to,
    list_rim,
    prepare_parts,
)
from fasaco_edge.kernels.windows.passages import BEGIN, END, NONE, SLOTS, Passages, across
from fasaco_edge.kernels.windows.window import (
    WalkWindow,
    cell_at,
    directions_of,
    shape_of,
)


@lean_kernel
def begin_window(
    ground: Ground,
    passages: Passages,
    terms: WalkPrices,
    window: WalkWindow,
    program: Program,
    noise: int,
    allowance: int,
    ring_price: int,
    random: NDArray[np.uint64],
) -> None:
    """Begin to solve a window: ``advance_window`` until no line is left, then ``end_window``.

    Args:
        ground: framed.
        passages: of the walk.
        terms: costs and end of the walk.
        window: the window.
        program: memory.
        noise: largest random amount added to each passage's cost, so that the walk may become a
            little more expensive.
        allowance: accepted increase in cost, to join several rings in the window into one.
        ring_price: see above.
        random: state of the stream, uint64 (1,).
    """
    lines, wide = shape_of(window)
    at, cells, count = program.at, program.cells, as_value(0)
    for line in range(lines):
        for place in range(wide):
            cell = cell_at(window, line, place)
            if ground.steps[cell]:
                cells.listed[count] = cell
                cells.inside[cell] = 1
                count += 1
    first = 2 * wide + 2
    ids = _name_rim(ground, passages, cells, first, count)
    at[LINE], at[NUMBER], at[LAYER], at[STATES] = 0, 0, 0, 0
    at[COUNT], at[IDS], at[BEGIN_ID], at[END_ID] = count, ids, -1, -1
    at[RING_PRICE] = ring_price
    for index in range(first, ids):
        if cells.rim[index, 1] == BEGIN:
            at[BEGIN_ID] = index
        if cells.rim[index, 1] == END:
            at[END_ID] = index
    if ids < 0:
        return
    may_end = at[END_ID] >= 0
    now, last = price_cells(ground, passages, terms, program, count, noise, random, may_end)
    at[LIMIT], at[LAST] = now + allowance - (0 if noise else 1), last
    if at[LIMIT] <= program.left[0]:
        return
    _join_outside(ground, passages, cells, program.states.mates[0, 0], first, ids)
    program.states.cost[0, 0], program.states.closed[0, 0] = 0, 0
    ahead, below = directions_of(window)
    begin = _begin_of(passages, at)
    prepare_parts(ground, program.parts, cells, count, ahead, below, begin)
    at[STATES] = 1


@inlined
def _begin_of(passages: Passages, at: NDArray[np.int64]) -> int:
    """Return the cell the walk begins in, if that is in the window, else -1."""
    return int(passages.ends[0]) if at[BEGIN_ID] >= 0 else -1


@lean_kernel
def advance_window(
    ground: Ground,
    passages: Passages,
    terms: WalkPrices,
    window: WalkWindow,
    program: Program,
    beam: int,
) -> bool:
    """Decide the next line of cells; return whether any are left. ``beam``: most states kept."""
    lines, wide = shape_of(window)
    at, parts, cells = program.at, program.parts, program.cells
    line = at[LINE]
    if line == lines or not at[STATES]:
        return False
    ahead, below = directions_of(window)
    begin, end_id, count = _begin_of(passages, at), at[END_ID], at[COUNT]
    is_free = end_id >= 0 and terms.free_end
    for place in range(wide):
        cell = cell_at(window, line, place)
        if not ground.steps[cell] or not at[STATES]:
            continue
        number = at[NUMBER]
        inside, ids = cells.inside, at[IDS]
        here = _here(ground, inside, cell, number, 2 * place, 2 * wide, ahead, below, ids)
        begins = at[BEGIN_ID] if cell == begin else -1
        is_needed = ground.needed[cell] > 0 or begins >= 0
        is_checked = _part_with(ground, parts, cells, cell, number, count, begin)
        if is_checked:
            parts.sizes[LEADS] = 0
            _list_frontier(ground, parts, window, line, place, here)
            list_rim(parts, cells.rim, number, 2 * wide + 2, ids, is_free)
        price = at[RING_PRICE]
        may_close = price > 0 or number >= at[LAST]
        is_given = end_id >= 0 and not is_free and cell == passages.ends[1]
        ends = EndRules(begins, end_id, is_needed, may_close, price, is_given, is_free, is_checked)
        at[STATES] = decide(program, here, ends, at[LAYER], at[STATES], beam, at[LIMIT])
        at[LAYER] = 1 - at[LAYER]
        at[NUMBER] = number + 1
    at[LINE] = line + 1
    return bool(at[STATES] > 0 and line + 1 < lines)


@lean_kernel
def end_window(
    ground: Ground, passages: Passages, terms: WalkPrices, window: WalkWindow, program: Program
) -> int:
    """Put the best state's passages back, if they cost less.

    Returns:
        The change of the walk's cost [half us], 0 for none.
    """
    at, cells, states, (_, wide) = program.at, program.cells, program.states, shape_of(window)
    layer, end_id, count = at[LAYER], at[END_ID], at[COUNT]
    best, cost = as_value(-1), at[LIMIT]
    for state in range(at[STATES]):
        is_whole = states.closed[layer, state] == 1
        if end_id >= 0 and states.mates[layer, state, end_id] != NO_END:
            is_whole = False
        if is_whole and states.cost[layer, state] < cost:
            best, cost = state, states.cost[layer, state]
    for index in range(2 * wide + 2, at[IDS]):
        cells.ident[cells.rim[index, 0], cells.rim[index, 1]] = NO_END
    for index in range(count):
        cells.inside[cells.listed[index]] = 0
    if best < 0:
        return 0
    before = real_cost(ground, passages, terms, cells.listed, count)
    _put_back(passages, program, window, best, count)
    return real_cost(ground, passages, terms, cells.listed, count) - before


@lean_inner_kernel
def _name_rim(
    ground: Ground, passages: Passages, cells: WindowCells, first: int, count: int
) -> int:
    """Give identifiers to the slots that lead out of the window; return their number, or -1."""
    ids = first
    for index in range(count):
        cell = cells.listed[index]
        for slot in range(SLOTS):
            if passages.partner[cell, slot] == NONE:
                continue
            if slot < BEGIN and cells.inside[cell + ground.offsets[slot >> 1]]:
                continue
            if ids >= MOST_IDS - 8:
                for other in range(first, ids):
                    cells.ident[cells.rim[other, 0], cells.rim[other, 1]] = NO_END
                return -1
            cells.ident[cell, slot] = ids
            cells.rim[ids, 0], cells.rim[ids, 1] = cell, slot
            ids += 1
    return ids


@lean_inner_kernel
def _join_outside(
    ground: Ground,
    passages: Passages,
    cells: WindowCells,
    mates: NDArray[np.int16],
    first: int,
    ids: int,
) -> None:
    """Write the first state: how the walk outside joins the slots at the rim."""
    for index in range(MOST_IDS):
        mates[index] = NO_END
    for index in range(first, ids):
        if mates[index] != NO_END:
            continue
        cell, slot = across(passages, ground.offsets, cells.rim[index, 0], cells.rim[index, 1])
        while not cells.inside[cell] or cells.ident[cell, slot] == NO_END:
            slot = passages.partner[cell, slot]
            cell, slot = across(passages, ground.offsets, cell, slot)
        other = cells.ident[cell, slot]
        mates[index], mates[other] = other, index


@lean_inner_kernel
def _part_with(
    ground: Ground, parts: Parts, cells: WindowCells, cell: int, index: int, count: int, begin: int
) -> bool:
    """Take a cell out of its part; return whether to check states for it."""
    label = parts.label[cell]
    parts.left[label] -= 1
    parts.needed[label] -= int(ground.needed[cell] > 0 or cell == begin)
    if parts.splits[index]:
        label_parts(ground, parts, cells, index + 1, count, begin)
        return True
    return bool(0 < parts.left[label] <= FEW_CELLS)


@lean_inner_kernel
def _list_frontier(
    ground: Ground, parts: Parts, window: WalkWindow, line: int, place: int, here: CurrentCell
) -> None:
    """Note which part each identifier of the frontier leads into, once the cell is decided."""
    lines, wide = shape_of(window)
    for column in range(wide):
        after = line + 1 if column <= place else line
        if after in (0, lines):
            continue
        cell = cell_at(window, after, column)
        if ground.steps[cell] >> here.above & 1:
            for lane in range(2):
                leads_to(parts, 2 * column + lane, cell)
    if here.to_ahead:
        for lane in range(2):
            leads_to(parts, here.ahead_id + lane, here.cell + ground.offsets[here.ahead])


@inlined
def _here(
    ground: Ground,
    inside: NDArray[np.uint8],
    cell: int,
    index: int,
    below_id: int,
    ahead_id: int,
    ahead: int,
    below: int,
    spare_id: int,
) -> CurrentCell:
    behind, above, mask = (ahead + 2) & 3, (below + 2) & 3, ground.steps[cell]
    offsets = ground.offsets
    return CurrentCell(
        cell,
        index,
        behind,
        above,
        ahead,
        below,
        bool(mask >> behind & 1 and inside[cell + offsets[behind]]),
        bool(mask >> above & 1 and inside[cell + offsets[above]]),
        bool(mask >> ahead & 1 and inside[cell + offsets[ahead]]),
        bool(mask >> below & 1 and inside[cell + offsets[below]]),
        below_id,
        ahead_id,
        spare_id,
    )


@lean_inner_kernel
def _put_back(
    passages: Passages,
    program: Program,
    window: WalkWindow,
    state: int,
    count: int,
) -> None:
    """Write the passages of a final state."""
    ahead, below = directions_of(window)
    behind, above = (ahead + 2) & 3, (below + 2) & 3
    taken, partner = program.taken, passages.partner
    for index in range(count, 0, -1):
        cell, code = program.cells.listed[index - 1], program.kept_code[index, state]
        swaps, size = code >> 24, 0
        for lane in range(code >> 20 & 3):
            taken[size] = 2 * behind + lane
            size += 1
        for lane in range(code >> 22 & 3):
            taken[size] = 2 * above + lane
            size += 1
        for lane in range(code >> AHEAD & 3):
            taken[size] = 2 * ahead + (1 - lane if swaps & 1 else lane)
            size += 1
        for lane in range(code >> BELOW & 3):
            taken[size] = 2 * below + (1 - lane if swaps & 2 else lane)
            size += 1
        if swaps & 4:
            taken[size] = BEGIN
            size += 1
        if code >> ENDING & 1:
            taken[size] = END
            size += 1
            passages.ends[1] = cell
        for slot in range(SLOTS):
            partner[cell, slot] = NONE
        for pair in range(size >> 1):
            one = taken[program.pairs[code & PAIRING, 2 * pair]]
            other = taken[program.pairs[code & PAIRING, 2 * pair + 1]]
            partner[cell, one], partner[cell, other] = other, one
        state = program.kept_parent[index, state]
