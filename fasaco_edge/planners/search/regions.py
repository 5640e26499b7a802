"""Regions for local search: squares of a large ground, and neighbourhoods of changes.

Each pass shifts the squares, so that borders move inside. A repair works on neighbourhoods of the
changed cells, each small enough to be perturbed as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.local_search.regions import RegionBox, neighbourhood
from fasaco_edge.kernels.local_search.walk_array import FRAME
from fasaco_edge.planners.problem import FramedGround
from fasaco_edge.planners.search.search_trail import SearchTrail
from fasaco_edge.planners.search.walk_region import WalkRegion

# A ground with up to this many cells to cover, on a lattice that is not too large, is one region.
ONE_REGION = 8_000
LATTICE_OF_ONE = 5 * ONE_REGION

# Edge of a square region, in cells.
EDGE = 80

# Shift of the squares of each pass, in halves of an edge: row, column.
SHIFTS = ((0, 0), (1, 1), (1, 0), (0, 1))


def is_one_region(rows: int, cols: int, cells: int) -> bool:
    """Return whether a lattice with this many cells to cover is searched as a whole."""
    return cells <= ONE_REGION and rows * cols <= LATTICE_OF_ONE


def regions_of(framed: FramedGround, cells: int, number: int) -> Iterator[RegionBox]:
    """Yield the regions of pass ``number`` over a ground with this many cells to cover."""
    if is_one_region(framed.rows, framed.cols, cells):
        labels = np.zeros(framed.ground.bound, np.int32)
        yield RegionBox(labels, 0, FRAME, FRAME, framed.rows, framed.cols)
        return
    row_shift, col_shift = (half * EDGE // 2 for half in SHIFTS[number % len(SHIFTS)])
    across = framed.width // EDGE + 2
    rows = (np.arange(framed.rows + 2 * FRAME) + row_shift) // EDGE
    cols = (np.arange(framed.width) + col_shift) // EDGE
    labels = (rows[:, None] * across + cols).astype(np.int32).ravel()
    for row in np.unique(rows[FRAME : FRAME + framed.rows]).tolist():
        for col in np.unique(cols[FRAME : FRAME + framed.cols]).tolist():
            first_row, last_row = _span(row, row_shift, framed.rows)
            first_col, last_col = _span(col, col_shift, framed.cols)
            yield RegionBox(
                labels,
                row * across + col,
                first_row,
                first_col,
                last_row - first_row,
                last_col - first_col,
            )


def _span(number: int, shift: int, size: int) -> tuple[int, int]:
    """Return the range of region ``number`` along one axis, inside the frame."""
    first = max(number * EDGE - shift, FRAME)
    return first, min((number + 1) * EDGE - shift, FRAME + size)


# Radius of a neighbourhood [steps]: walks are as good with 10 and 20, and worse with 3.
RADIUS = 6
# Limits on a neighbourhood: on the changed cells that it starts from, and on all its cells.
MOST_CHANGED, MOST_CELLS = 1_000, 3_000
# Radius of a spot: a neighbourhood without a change, where the walk is to be improved.
SPOT_RADIUS = 20
GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)
# Spare capacity: visits by which a walk may grow temporarily.
SPARE_VISITS = 600


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhood:
    """A region of any shape.

    Attributes:
        box: its cells.
        changed: int32 (n,), the changed cells, as cells of the region's own ground.
        is_first: whether the robot and the cells just ahead of it are in it.
    """

    box: RegionBox
    changed: NDArray[np.int32]
    is_first: bool

    def walk_region(self, walk: NDArray[np.int32], trail: SearchTrail) -> WalkRegion:
        """Return memory for the region and the parts of a walk (framed cells) inside it."""
        inside = self.box.labels[walk] == self.box.label
        jumps = int(np.count_nonzero(np.diff(inside))) // 2 + 1
        visits = int(np.count_nonzero(inside)) + 4 * jumps + SPARE_VISITS
        return WalkRegion(self.box.rows, self.box.cols, visits, jumps, trail)


def neighbourhoods(
    framed: FramedGround, ahead: NDArray[np.int32], changed: NDArray[np.int32]
) -> Iterator[Neighbourhood]:
    """Yield the neighbourhood of the robot, and then the neighbourhoods of other changes.

    Args:
        framed: the ground.
        ahead: int32 (m,), the cells just ahead of the robot, framed.
        changed: int32 (n,), framed cells, in the order of the walk.
    """
    yield (first := _around(framed, ahead, changed, is_first=True))
    left = changed[first.box.labels[changed] == 0]
    while left.size:
        yield (place := _around(framed, left[:0], left, is_first=False))
        left = left[place.box.labels[left] == 0]


def spot(framed: FramedGround, walk: NDArray[np.int32], number: int) -> Neighbourhood:
    """Return a neighbourhood at a spot along a walk, framed cells int32 (n,).

    Any range of successive numbers gives spots spread evenly along the walk.
    """
    at = int(walk.size * (number * GOLDEN_RATIO % 1.0))
    return _around(framed, walk[:0], walk[at : at + 1], is_first=False, radius=SPOT_RADIUS)


def _around(
    framed: FramedGround,
    ahead: NDArray[np.int32],
    changed: NDArray[np.int32],
    *,
    is_first: bool,
    radius: int = RADIUS,
) -> Neighbourhood:
    labels = np.zeros(framed.ground.bound, np.int32)
    found = np.empty(MOST_CELLS, np.int32)
    begin = np.concatenate((ahead, changed[:MOST_CHANGED]))
    size = neighbourhood(framed.ground, begin, radius, labels, 1, found)
    rows, cols = np.divmod(found[:size], framed.width)
    row, col = int(rows.min()), int(cols.min())
    box = RegionBox(labels, 1, row, col, int(rows.max()) - row + 1, int(cols.max()) - col + 1)
    inside = changed[labels[changed] == 1]
    rows, cols = np.divmod(inside, framed.width)
    local = (rows - row + FRAME) * (box.cols + 2 * FRAME) + cols - col + FRAME
    return Neighbourhood(box, local.astype(np.int32), is_first)
