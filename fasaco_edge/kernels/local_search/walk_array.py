"""A covering walk as an array of cells, and its elementary changes.

Cells are flat indices of a ground that is framed by two cells without any step,
so that a neighbour is one addition away and never outside. Steps lead to a
neighbour; a cell may be visited more than once. ``place`` holds the index of one
visit of each cell; the index may be out of date, so it is checked before use.

A walk of this form stays connected through every change, and needs no distances:
a transfer is a run of cells that are also visited elsewhere.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.lattice.reach import walk_cost

LENGTH, SPARE_CELLS, COST = 0, 1, 2

# In ``needed``, for cells that no change may touch: more visits than any walk has.
FIXED = 1 << 30

# Width of the frame [cells].
FRAME = 2

# First bit of a cell's step mask for rooms: set if the step in that direction leads into another
# room.
ROOM_BIT = 4
ROOM_BITS = 0b1111 << ROOM_BIT


class Ground(NamedTuple):
    """The ground of the walk.

    Attributes:
        steps: step masks, uint8 (n,); 0 for a jump. Bits ``ROOM_BITS`` tell which
            steps lead into another room.
        needed: int32 (n,), how many visits the cell must keep: 1 where it is to be
            covered, 0 where it is not, FIXED where its visits must not change.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        bound: indices from here on are no cells but jumps, see ``regions``.
    """

    steps: NDArray[np.uint8]
    needed: NDArray[np.int32]
    offsets: NDArray[np.int64]
    bound: int


class Walk(NamedTuple):
    """The walk and counts over it.

    Attributes:
        cells: int32 (capacity,), the walk; beyond its length undefined.
        place: int32 (n,), index of one of the cell's visits.
        visits: int32 (n,), how often the cell is visited.
        spare: int32 (n,), cells with more visits than needed, in any order.
        spare_at: int32 (n,), the cell's index in ``spare``.
        counts: int64 (3,), LENGTH of the walk, number of SPARE_CELLS, COST [us].
    """

    cells: NDArray[np.int32]
    place: NDArray[np.int32]
    visits: NDArray[np.int32]
    spare: NDArray[np.int32]
    spare_at: NDArray[np.int32]
    counts: NDArray[np.int64]


class Prices(NamedTuple):
    """Prices of steps and turns, and limits to changes of a walk.

    Attributes:
        step_us, quarter_turn_us: [us]; a half turn is two quarter-turns.
        free_end: whether the walk may end anywhere.
        held: this many first visits change only for a gain.
        row_us, col_us: added to the price of a step along a row, along a column [us].
        room_us: added to the price of a step from one room into another [us].
    """

    step_us: int
    quarter_turn_us: int
    free_end: bool
    held: int = 0
    row_us: int = 0
    col_us: int = 0
    room_us: int = 0


@inlined
def copy(source: NDArray[np.int32], target: NDArray[np.int32], length: int) -> None:
    """Copy the first visits; a slice would test whether the two arrays overlap, and allocate."""
    for index in range(length):
        target[index] = source[index]


@inlined
def leads(ground: Ground, here: int, there: int) -> bool:
    """Return whether there is a step from ``here`` to ``there``."""
    gap, mask = there - here, ground.steps[here]
    if gap == 1:
        return bool(mask & 1)
    if gap == -1:
        return bool(mask & 4)
    if gap == ground.offsets[1]:
        return bool(mask & 2)
    if gap == ground.offsets[3]:
        return bool(mask & 8)
    return False


@inlined
def axis_of(one: int, other: int) -> int:
    """Return 0 for two cells side by side in a row, 1 in a column."""
    return 0 if abs(one - other) == 1 else 1


@inlined
def added(ground: Ground, prices: Prices, one: int, other: int) -> int:
    """Return the additional price of a step between two cells [us]."""
    axis = axis_of(one, other)
    price = prices.col_us if axis else prices.row_us
    if prices.room_us:
        way = ROOM_BIT + axis + 2 * (other < one)
        # One of the cells may lie at the rim of a region, and has no mask there.
        if (ground.steps[one] >> way | ground.steps[other] >> (way ^ 2)) & 1:
            price += prices.room_us
    return price


@inlined
def turning(before: int, here: int, after: int, quarter_turn_us: int) -> int:
    """Return the cost [us] of the turn between two steps."""
    first, second = here - before, after - here
    if first == second:
        return 0
    return 2 * quarter_turn_us if first == -second else quarter_turn_us


@inlined
def add_visit(ground: Ground, walk: Walk, cell: int) -> None:
    """Count one visit more."""
    walk.visits[cell] += 1
    if walk.visits[cell] == ground.needed[cell] + 1:
        last = walk.counts[SPARE_CELLS]
        walk.spare_at[cell] = last
        walk.spare[last] = cell
        walk.counts[SPARE_CELLS] = last + 1


@inlined
def take_visit(ground: Ground, walk: Walk, cell: int) -> None:
    """Count one visit less."""
    walk.visits[cell] -= 1
    if walk.visits[cell] == ground.needed[cell]:
        last = walk.counts[SPARE_CELLS] - 1
        moved, hole = walk.spare[last], walk.spare_at[cell]
        walk.spare[hole] = moved
        walk.spare_at[moved] = hole
        walk.counts[SPARE_CELLS] = last


@lean_kernel
def recount(ground: Ground, walk: Walk, length: int, prices: Prices) -> None:
    """Set the walk to ``cells[:length]``: all counts and indices."""
    walk.visits[:] = 0
    walk.place[:] = 0
    walk.counts[LENGTH] = length
    walk.counts[SPARE_CELLS] = 0
    for index in range(length):
        cell = walk.cells[index]
        add_visit(ground, walk, cell)
        walk.place[cell] = index
    cost = walk_cost(walk.cells[:length], prices.step_us, prices.quarter_turn_us)
    for index in range(1, length):
        one, other = walk.cells[index - 1], walk.cells[index]
        # Jumps have no direction.
        if abs(other - one) == 1 or abs(other - one) == ground.offsets[1]:
            cost += added(ground, prices, one, other)
    walk.counts[COST] = cost


@inlined
def is_at(walk: Walk, cell: int, index: int) -> bool:
    """Return whether visit ``index`` of the walk, if it exists, is a visit of ``cell``."""
    return bool(0 <= index < walk.counts[LENGTH] and walk.cells[index] == cell)


@lean_inner_kernel
def find_visit(ground: Ground, walk: Walk, cell: int) -> None:
    """Set ``place`` of a cell that is visited: beside its neighbours' visits, else by search."""
    if is_at(walk, cell, walk.place[cell]):
        return
    for direction in range(4):
        if not ground.steps[cell] >> direction & 1:
            continue
        beside = cell + ground.offsets[direction]
        index = walk.place[beside]
        if not is_at(walk, beside, index):
            continue
        for near in (index - 1, index + 1):
            if is_at(walk, cell, near):
                walk.place[cell] = near
                return
    for index in range(walk.counts[LENGTH]):
        if walk.cells[index] == cell:
            walk.place[cell] = index
            return


@inlined
def reverse(walk: Walk, first: int, last: int) -> None:
    """Reverse the visits from ``first`` to ``last``."""
    cells, place = walk.cells, walk.place
    while first < last:
        one, other = cells[first], cells[last]
        cells[first] = other
        cells[last] = one
        place[other] = first
        place[one] = last
        first += 1
        last -= 1
    if first == last:
        place[cells[first]] = first


@inlined
def put(ground: Ground, walk: Walk, index: int, cell: int) -> None:
    """Make visit ``index`` a visit of ``cell``."""
    before = walk.cells[index]
    walk.cells[index] = cell
    walk.place[cell] = index
    add_visit(ground, walk, cell)
    take_visit(ground, walk, before)
    if walk.visits[before]:
        find_visit(ground, walk, before)


@lean_inner_kernel
def drop(ground: Ground, walk: Walk, index: int, visits: int) -> None:
    """Leave out one or two visits from ``index`` on."""
    cells, place = walk.cells, walk.place
    first, last = cells[index], cells[index + visits - 1]
    length = walk.counts[LENGTH] - visits
    for after in range(index, length):
        cell = cells[after + visits]
        cells[after] = cell
        place[cell] = after
    walk.counts[LENGTH] = length
    take_visit(ground, walk, first)
    if visits == 2:
        take_visit(ground, walk, last)
    for cell in (first, last):
        if walk.visits[cell]:
            find_visit(ground, walk, cell)
