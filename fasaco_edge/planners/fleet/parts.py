"""Parts of a ground, one for each robot: connected, with its start in it, and of similar load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.parts import MOST_ROBOTS, balance_parts
from fasaco_edge.kernels.fleet.pieces import cut_tree
from fasaco_edge.kernels.lattice.reach import shortest_walk
from fasaco_edge.planners.search.walk_region import stream_of

# Proposals per cell, from cells nearest to each start, and from pieces; a limit on them.
FROM_NEAREST, FROM_PIECES, MOST_PROPOSALS = 800, 200, 4_000_000
# Number of trees of which the best is cut into pieces.
TREES = 100
# Limits of the kernel on the cells.
MOST_CELLS = 2**22

Sets = NDArray[np.int64]


def can_part(robots: int, cells: int) -> bool:
    """Tell whether so many robots and cells can be taken."""
    return 2 <= robots <= MOST_ROBOTS and cells < MOST_CELLS


class Parting:
    """A ground that is parted among robots.

    Args:
        lattice: the cells where robots fit.
        reached: bool (rows, cols), the ground: connected cells.
        starts: flat cells, as many as ``can_part`` allows.
        distances: int32 (k, rows * cols), from each start to each cell [steps].
    """

    def __init__(
        self,
        lattice: CoverageLattice,
        reached: NDArray[np.bool_],
        starts: Sequence[int],
        distances: NDArray[np.int32],
    ) -> None:
        cols = reached.shape[1]
        self._lattice, self._cells = lattice, np.flatnonzero(reached)
        self._steps, self._offsets = lattice.steps.ravel(), np.array([1, cols, -1, -cols], np.int64)
        self._starts, self._distances = np.array(starts, np.int64), distances

    def from_nearest(self, seed: tuple[int, ...]) -> NDArray[np.int32]:
        """Return the robot of each cell, -1 off the ground: at first the one nearest to it.

        Args:
            seed: of the random numbers.

        Returns:
            int32 (rows * cols,).
        """
        sets = np.zeros(self._steps.size, np.int64)
        sets[self._cells] = np.int64(1) << self._distances[:, self._cells].argmin(axis=0)
        return self._balanced(sets, FROM_NEAREST, stream_of(*seed))

    def from_pieces(self, seed: tuple[int, ...]) -> NDArray[np.int32]:
        """Return the robot of each cell, -1 off the ground: at first by pieces of a tree.

        Fewer robots pass each passage than where they begin with the cells nearest to them, above
        all where they start together.

        Args:
            seed: of the random numbers.

        Returns:
            int32 (rows * cols,).
        """
        stream, robots = stream_of(*seed), len(self._starts)
        # The start that is nearest to the one farthest from it.
        root = int(self._starts[self._distances[:, self._starts].max(axis=1).argmin()])
        pieces = np.zeros(self._steps.size, np.int64)
        cut_tree(self._steps, self._offsets, root, self._cells.size, robots, TREES, stream, pieces)
        return self._balanced(self._dealt(pieces), FROM_PIECES, stream)

    def _dealt(self, pieces: Sets) -> Sets:
        """Return the robots of each cell if each gets one of the pieces, and the way to it."""
        robots, cols = len(self._starts), self._lattice.steps.shape[1]
        cells = [np.flatnonzero(pieces >> piece & 1) for piece in range(robots)]
        far = np.array(
            [self._distances[:, some].min(axis=1, initial=self._steps.size) for some in cells]
        )
        far[[not some.size for some in cells]] = 0
        sets = np.zeros_like(pieces)
        for robot, piece in enumerate(_assigned(far.T.astype(np.int64) ** 2).tolist()):
            some, start = cells[piece], int(self._starts[robot])
            sets[some] |= 1 << robot
            if some.size:
                to = int(some[self._distances[robot][some].argmin()])
                way = shortest_walk(self._lattice.steps, divmod(start, cols), divmod(to, cols))
                sets[way @ (cols, 1)] |= 1 << robot
        return sets

    def _balanced(self, sets: Sets, per_cell: int, stream: NDArray[np.uint64]) -> NDArray[np.int32]:
        """Return the robot of each cell, of sets that are made equal in load."""
        for robot, start in enumerate(self._starts):
            sets[start] |= 1 << robot
        proposals = min(per_cell * self._cells.size, MOST_PROPOSALS)
        balance_parts(
            self._steps, self._offsets, sets, self._cells, self._starts, proposals, stream
        )
        owners = np.full(sets.size, -1, np.int32)
        for robot in reversed(range(len(self._starts))):
            owners[sets >> robot & 1 > 0] = robot
        return owners


def _assigned(costs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a column for each row of square costs: no swap of two costs less."""
    column = np.arange(len(costs))
    while True:
        swapped = costs[:, column]
        own = swapped.diagonal()
        gains = own[:, None] + own - swapped - swapped.T
        one, other = divmod(int(gains.argmax()), len(costs))
        if gains[one, other] <= 0:
            return column
        column[[one, other]] = column[[other, one]]
