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
# Tries from the nearest cells within that limit, of which the most even one counts.
TRIES = 3
# Number of trees of which the best is cut into pieces.
TREES = 100
# Robots start together if they are nearer than so much of a share of the cells to one of them.
TOGETHER = 0.05
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

    Attributes:
        are_together: whether all robots start near one place, for the size of their parts.
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
        # The start that is nearest to the one farthest from it.
        apart = distances[:, self._starts]
        middle = int(apart.max(axis=1).argmin())
        self._root = int(self._starts[middle])
        self.are_together = int(apart[middle].sum()) <= TOGETHER * self._cells.size

    def from_nearest(self, seed: tuple[int, ...]) -> NDArray[np.int32]:
        """Return the robot of each cell, -1 off the ground: at first the one nearest to it.

        Args:
            seed: of the random numbers.

        Returns:
            int32 (rows * cols,).
        """
        nearest = np.zeros(self._steps.size, np.int64)
        nearest[self._cells] = np.int64(1) << self._distances[:, self._cells].argmin(axis=0)
        tries = max(1, min(TRIES, MOST_PROPOSALS // (FROM_NEAREST * self._cells.size)))
        found = [
            self._balanced(nearest.copy(), FROM_NEAREST, stream_of(*seed, number))
            for number in range(tries)
        ]
        return self._owners(min(found, key=lambda one: one[0])[1])

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
        pieces = np.zeros(self._steps.size, np.int64)
        cut_tree(
            self._steps, self._offsets, self._root, self._cells.size, robots, TREES, stream, pieces
        )
        return self._owners(self._balanced(self._dealt(pieces), FROM_PIECES, stream)[1])

    def _dealt(self, pieces: Sets) -> Sets:
        """Return the robots of each cell if each gets one of the pieces, and the way to it."""
        robots, cols = len(self._starts), self._lattice.steps.shape[1]
        cells = [np.flatnonzero(pieces >> piece & 1) for piece in range(robots)]
        far = np.array(
            [self._distances[:, some].min(axis=1, initial=self._steps.size) for some in cells]
        )
        far[[not some.size for some in cells]] = 0
        sets = np.zeros_like(pieces)
        for robot, piece in enumerate(assigned(far.T.astype(np.int64) ** 2).tolist()):
            some, start = cells[piece], int(self._starts[robot])
            sets[some] |= 1 << robot
            if some.size:
                to = int(some[self._distances[robot][some].argmin()])
                way = shortest_walk(self._lattice.steps, divmod(start, cols), divmod(to, cols))
                sets[way @ (cols, 1)] |= 1 << robot
        return sets

    def _balanced(
        self, sets: Sets, per_cell: int, stream: NDArray[np.uint64]
    ) -> tuple[tuple[int, int], Sets]:
        """Return sets that are made equal in load, after the greatest load and the sum."""
        for robot, start in enumerate(self._starts):
            sets[start] |= 1 << robot
        proposals = min(per_cell * self._cells.size, MOST_PROPOSALS)
        loads = balance_parts(
            self._steps, self._offsets, sets, self._cells, self._starts, proposals, stream
        )
        return (int(loads.max()), int(loads.sum())), sets

    def _owners(self, sets: Sets) -> NDArray[np.int32]:
        """Return the first robot of each cell, -1 for none."""
        owners = np.full(sets.size, -1, np.int32)
        for robot in reversed(range(len(self._starts))):
            owners[sets >> robot & 1 > 0] = robot
        return owners


def assigned(costs: NDArray[np.int64]) -> NDArray[np.int64]:
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
