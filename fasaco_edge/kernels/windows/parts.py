"""Connected parts of the undecided cells of a window, and states that can no longer cover them.

A walk that enters a part leaves it again, or ends there. So an even number of open ends leads into
each part; into one part an odd number may lead if the walk may end there. At least one open end
leads into each part with a cell to cover, unless the part may have a ring of its own, a closed
walk. States that break these rules are dropped.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel
from fasaco_edge.kernels.lattice.areas import root
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.windows.memory import NO_END, Parts, WindowCells
from fasaco_edge.kernels.windows.passages import END

# Limit on the parts that are checked: bits of a word.
MOST_PARTS = 62
# A part that was not split is checked once it has at most this many cells left.
FEW_CELLS = 3

PARTS, LEADS = 0, 1


@lean_inner_kernel
def prepare_parts(
    ground: Ground, parts: Parts, cells: WindowCells, count: int, ahead: int, below: int, begin: int
) -> None:
    """Find the cut vertices of parts; label the parts of the whole window."""
    for number in range(count):
        cell = cells.listed[number]
        parts.root[cell] = cell
        parts.number[cell] = number
    for number in range(count - 1, -1, -1):
        cell = cells.listed[number]
        joined = 0
        for direction in (ahead, below):
            beside = cell + ground.offsets[direction]
            if ground.steps[cell] >> direction & 1 and cells.inside[beside]:
                top = root(parts.root, beside)
                if top != cell:
                    parts.root[top] = cell
                    joined += 1
        parts.splits[number] = joined > 1
    label_parts(ground, parts, cells, as_value(0), count, begin)


@lean_inner_kernel
def label_parts(
    ground: Ground, parts: Parts, cells: WindowCells, first: int, count: int, begin: int
) -> None:
    """Label the parts of the cells from number ``first`` on."""
    for number in range(first, count):
        parts.label[cells.listed[number]] = NO_END
    labels = 0
    for number in range(first, count):
        if parts.label[cells.listed[number]] != NO_END:
            continue
        parts.label[cells.listed[number]] = labels
        parts.queue[0] = cells.listed[number]
        head, tail, needed = 0, 1, 0
        while head < tail:
            cell = parts.queue[head]
            head += 1
            needed += int(ground.needed[cell] > 0 or cell == begin)
            for direction in range(4):
                beside = cell + ground.offsets[direction]
                if not ground.steps[cell] >> direction & 1 or not cells.inside[beside]:
                    continue
                if parts.number[beside] >= first and parts.label[beside] == NO_END:
                    parts.label[beside] = labels
                    parts.queue[tail] = beside
                    tail += 1
        parts.left[labels], parts.needed[labels] = tail, needed
        labels += 1
    parts.sizes[PARTS] = labels


@inlined
def leads_to(parts: Parts, identifier: int, cell: int) -> None:
    """Note that the end ``identifier`` leads into the part of a cell."""
    parts.leads[parts.sizes[LEADS], 0] = identifier
    parts.leads[parts.sizes[LEADS], 1] = parts.label[cell]
    parts.sizes[LEADS] += 1


@lean_inner_kernel
def list_rim(
    parts: Parts, rim: NDArray[np.int32], number: int, first: int, ids: int, is_free: bool
) -> None:
    """Note which part the ends at the rim lead into, for the cells after ``number``."""
    for identifier in range(first, ids):
        cell = rim[identifier, 0]
        if is_free and rim[identifier, 1] == END:
            continue
        if parts.number[cell] > number:
            leads_to(parts, identifier, cell)


@inlined
def is_stuck(parts: Parts, state: NDArray[np.int16], is_open: bool, may_ring: bool) -> bool:
    """Return whether a state cannot cover the remaining cells.

    Args:
        parts: connected parts of the remaining cells.
        state: int16 (MOST_IDS,), the mate of each identifier; NO_END if there is no open end.
        is_open: whether the walk may end in any remaining cell.
        may_ring: whether a part of two cells or more may have a ring of its own.
    """
    odd, met = 0, 0
    for index in range(parts.sizes[LEADS]):
        label = int(parts.leads[index, 1])
        if label < MOST_PARTS and state[parts.leads[index, 0]] != NO_END:
            bit = 1 << label
            odd ^= bit
            met |= bit
    for label in range(min(parts.sizes[PARTS], MOST_PARTS)):
        bit = 1 << label
        is_bound = parts.left[label] == 1 or not may_ring
        if is_bound and parts.needed[label] > 0 and not met & bit:
            return True
    return bool(odd & (odd - 1)) if is_open else odd != 0
