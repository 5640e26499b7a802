"""Where a repair looks: neighbourhoods of what changed, each small enough to be kicked whole."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.neighbourhood import neighbourhood
from fasaco_edge.kernels.regions import Box
from fasaco_edge.kernels.walk_array import FRAME
from fasaco_edge.planners.framed import FramedGround
from fasaco_edge.planners.patch import Patch

# Steps from what changed to the rim: in trials 10 and 20 gained nothing more, 3 lost.
RADIUS = 6
# Changed cells that one neighbourhood begins with at most, and its cells.
MOST_CHANGED, MOST_CELLS = 1_000, 3_000
# The same where nothing has changed, and a walk is to be made better somewhere.
SPOT_RADIUS = 20
GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)
# A walk may become longer for a while.
ROOM = 600


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhood:
    """A region of any form.

    Attributes:
        box: its cells.
        changed: int32 (n,), those that changed, as cells of the region's own ground.
        is_first: whether the robot stands in it, with all that is just ahead.
    """

    box: Box
    changed: NDArray[np.int32]
    is_first: bool

    def patch(self, walk: NDArray[np.int32]) -> Patch:
        """Return room for it, and for the parts of a walk, framed cells, that lie in it."""
        inside = self.box.labels[walk] == self.box.label
        jumps = int(np.count_nonzero(np.diff(inside))) // 2 + 1
        visits = int(np.count_nonzero(inside)) + 4 * jumps + ROOM
        return Patch(self.box.rows, self.box.cols, visits, jumps)


def neighbourhoods(
    framed: FramedGround, ahead: NDArray[np.int32], changed: NDArray[np.int32]
) -> Iterator[Neighbourhood]:
    """Yield the neighbourhood of the robot, and then of what changed elsewhere.

    Args:
        framed: the ground.
        ahead: int32 (m,), what lies just ahead of the robot, framed cells.
        changed: int32 (n,), framed cells, in the order of the walk.
    """
    yield (first := _around(framed, ahead, changed, is_first=True))
    left = changed[first.box.labels[changed] == 0]
    while left.size:
        yield (place := _around(framed, left[:0], left, is_first=False))
        left = left[place.box.labels[left] == 0]


def spot(framed: FramedGround, walk: NDArray[np.int32], number: int) -> Neighbourhood:
    """Return a neighbourhood somewhere along a walk, framed cells int32 (n,).

    Those of successive numbers lie evenly along it, wherever one begins to count.
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
    box = Box(labels, 1, row, col, int(rows.max()) - row + 1, int(cols.max()) - col + 1)
    inside = changed[labels[changed] == 1]
    rows, cols = np.divmod(inside, framed.width)
    local = (rows - row + FRAME) * (box.cols + 2 * FRAME) + cols - col + FRAME
    return Neighbourhood(box, local.astype(np.int32), is_first)
