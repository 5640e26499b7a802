"""Passages: a covering walk taken apart into its visits of cells.

A step is walked at most twice, each time in a lane of its own. So a cell has eight slots
``2 * direction + lane``, two lanes at each of its four sides, and a visit is a passage, which joins
two of the slots. The walk's two ends are slots, too: BEGIN in its first cell, END in its last one.
END is taken to be connected with BEGIN outside of the ground, so that every walk is one ring of
passages.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import NORTH
from fasaco_edge.kernels.jit import inlined, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import Ground

SLOTS = 10
BEGIN, END, NONE = 8, 9, -1
LANES = 2


class Passages(NamedTuple):
    """The passages of a walk over a framed ground of n cells.

    Attributes:
        partner: int8 (n, 10), the slot that each slot is joined with; NONE for unused slots.
        ends: int64 (2,), the cells that the walk begins and ends in.
    """

    partner: NDArray[np.int8]
    ends: NDArray[np.int64]


@inlined
def side_of(slot: int) -> int:
    """Return the direction of a slot; 4 for BEGIN, 5 for END."""
    return slot >> 1 if slot < BEGIN else slot - 4


@inlined
def across(passages: Passages, offsets: NDArray[np.int64], cell: int, slot: int) -> tuple[int, int]:
    """Return the cell and the slot that the walk enters when it leaves by a slot."""
    if slot == BEGIN:
        return passages.ends[1], END
    if slot == END:
        return passages.ends[0], BEGIN
    direction = slot >> 1
    return cell + offsets[direction], 2 * ((direction + 2) & 3) + (slot & 1)


@lean_kernel
def passages_of(
    ground: Ground, walk: NDArray[np.int32], lanes: NDArray[np.uint8], passages: Passages
) -> bool:
    """Write a walk's passages; return False if a step is walked three times.

    Args:
        ground: framed.
        walk: int32 (k,), framed cells, two or more.
        lanes: uint8 (n, 2), working memory.
        passages: out.
    """
    partner, offsets = passages.partner, ground.offsets
    for cell in range(partner.shape[0]):
        for slot in range(SLOTS):
            partner[cell, slot] = NONE
        lanes[cell, 0] = lanes[cell, 1] = 0
    passages.ends[0], passages.ends[1] = walk[0], walk[walk.size - 1]
    came_by = BEGIN
    for index in range(walk.size - 1):
        here, after = walk[index], walk[index + 1]
        direction = 0
        while here + offsets[direction] != after:
            direction += 1
        lower = min(here, after)
        lane = lanes[lower, direction & 1]
        if lane == LANES:
            return False
        lanes[lower, direction & 1] = lane + 1
        slot = 2 * direction + lane
        partner[here, came_by], partner[here, slot] = slot, came_by
        came_by = 2 * ((direction + 2) & 3) + lane
    last = walk[walk.size - 1]
    partner[last, came_by], partner[last, END] = END, came_by
    return True


@lean_kernel
def walk_of(ground: Ground, passages: Passages, walk: NDArray[np.int32]) -> int:
    """Write the walk, framed cells, into int32 (capacity,), long enough; return its length."""
    cell, slot, length = passages.ends[0], BEGIN, 0
    while True:
        walk[length] = cell
        length += 1
        slot = passages.partner[cell, slot]
        if slot == END:
            return length
        cell, slot = across(passages, ground.offsets, cell, slot)


@inlined
def passage_cost(one: int, other: int, step: int, turn: int) -> int:
    """Return the cost of a passage between two sides, by direction; 4 and 5 are the walk's ends."""
    if one >= NORTH + 3 or other >= NORTH + 3:
        return step // 2
    gap = (one - other) & 3
    if gap == 2:
        return step
    return step + 2 * turn if gap == 0 else step + turn
