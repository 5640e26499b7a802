"""Connected parts of the undecided cells of a window, and states that can no longer cover them.

A walk that enters a part leaves it again, except at its end. So the number of open ends that lead
into a part is even, or odd in one part while the walk may end there; and each part with a cell to
cover has at least one open end, unless it may have a ring of its own. A state that breaks this rule
is infeasible and is dropped.
"""

from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel
from fasaco_edge.kernels.lattice.areas import root
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.windows.memory import NO_END, Program
from fasaco_edge.kernels.windows.passages import END

# Limit on the parts that are checked: bits of a word.
MOST_PARTS = 62
# A part that was not split is checked once it has at most this many cells left.
FEW_CELLS = 3

PARTS, LEADS = 0, 1


@lean_kernel
def prepare_parts(
    ground: Ground, program: Program, count: int, ahead: int, below: int, begin: int
) -> None:
    """Find the cut vertices of parts; label the parts of the whole window."""
    parts, cells = program.parts, program.cells
    for number in range(count):
        parts.root[cells[number]] = cells[number]
        parts.number[cells[number]] = number
    for number in range(count - 1, -1, -1):
        cell = cells[number]
        joined = 0
        for direction in (ahead, below):
            beside = cell + ground.offsets[direction]
            if ground.steps[cell] >> direction & 1 and program.inside[beside]:
                top = root(parts.root, beside)
                if top != cell:
                    parts.root[top] = cell
                    joined += 1
        parts.splits[number] = joined > 1
    label_parts(ground, program, as_value(0), count, begin)


@lean_kernel
def label_parts(ground: Ground, program: Program, first: int, count: int, begin: int) -> None:
    """Label the parts of the cells from number ``first`` on."""
    parts, cells = program.parts, program.cells
    for number in range(first, count):
        parts.label[cells[number]] = NO_END
    labels = 0
    for number in range(first, count):
        if parts.label[cells[number]] != NO_END:
            continue
        parts.label[cells[number]] = labels
        parts.queue[0] = cells[number]
        head, tail, needed = 0, 1, 0
        while head < tail:
            cell = parts.queue[head]
            head += 1
            needed += int(ground.needed[cell] > 0 or cell == begin)
            for direction in range(4):
                beside = cell + ground.offsets[direction]
                if not ground.steps[cell] >> direction & 1 or not program.inside[beside]:
                    continue
                if parts.number[beside] >= first and parts.label[beside] == NO_END:
                    parts.label[beside] = labels
                    parts.queue[tail] = beside
                    tail += 1
        parts.left[labels], parts.needed[labels] = tail, needed
        labels += 1
    parts.sizes[PARTS] = labels


@inlined
def leads_to(program: Program, identifier: int, cell: int) -> None:
    """Note that an identifier leads into the part of a cell."""
    parts = program.parts
    parts.leads[parts.sizes[LEADS], 0] = identifier
    parts.leads[parts.sizes[LEADS], 1] = parts.label[cell]
    parts.sizes[LEADS] += 1


@lean_kernel
def list_rim(program: Program, number: int, first: int, ids: int, is_free: bool) -> None:
    """Note which part each identifier of the rim leads into, if its cell comes after a number."""
    for identifier in range(first, ids):
        cell = program.rim[identifier, 0]
        if is_free and program.rim[identifier, 1] == END:
            continue
        if program.parts.number[cell] > number:
            leads_to(program, identifier, cell)


@inlined
def is_stuck(program: Program, is_open: bool, may_ring: bool) -> bool:
    """Return whether the state in ``scratch`` cannot cover the remaining cells.

    Args:
        program: the memory.
        is_open: whether the walk may end in any remaining cell.
        may_ring: whether a part of two cells or more may have a ring of its own.
    """
    parts = program.parts
    odd, met = 0, 0
    for index in range(parts.sizes[LEADS]):
        label = int(parts.leads[index, 1])
        if label < MOST_PARTS and program.scratch[parts.leads[index, 0]] != NO_END:
            bit = 1 << label
            odd ^= bit
            met |= bit
    for label in range(min(parts.sizes[PARTS], MOST_PARTS)):
        bit = 1 << label
        is_bound = parts.left[label] == 1 or not may_ring
        if is_bound and parts.needed[label] > 0 and not met & bit:
            return True
    return bool(odd & (odd - 1)) if is_open else odd != 0
