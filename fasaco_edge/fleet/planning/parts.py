"""Parts of a ground, one for each robot, of similar load: which rooms are whose."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.blocks import blocks_of
from fasaco_edge.kernels.fleet.chance import MOST_ROBOTS
from fasaco_edge.kernels.fleet.shares import share_blocks
from fasaco_edge.planners.search.walk_region import stream_of

# Blocks for each robot, about: few enough to search among rooms, small enough to be made even. The
# side of one is an even number of cells, or 1 on a small ground: a closed walk along a border of
# even blocks needs no spare step.
BLOCKS = 25
# Proposals, whatever the size of the ground.
PROPOSALS = 20_000
# An even share of the cells over how far loads are from it where the search is hottest.
WIDE = 8
# An even share over the price of a unit of load. It is dear: small differences of load are made
# even cell by cell later, passages that several robots take are not avoided any more. From one
# place robots come to work at places far apart, and less can be made even.
PRICE_TOGETHER, PRICE_APART = 8, 2
# Of 256 branches those that may go to any robot. From one place some robots have to go beyond all
# others; elsewhere what lies far away is seldom worth its way.
FAR_TOGETHER, FAR_APART = 48, 4
# Robots start together if they are nearer to one of them, on average, than so much of a share of
# the cells.
TOGETHER = 0.05
# Limit of the kernels on the cells.
MOST_CELLS = 2**22


def can_part(robots: int, cells: int) -> bool:
    """Tell whether the kernels take so many robots and cells: to be parted, and annealed."""
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
        self._cells, robots = np.flatnonzero(reached), len(starts)
        share = self._cells.size // robots
        side = max(1, 2 * round(sqrt(share / BLOCKS) / 2))
        offsets = np.array([1, reached.shape[1], -1, -reached.shape[1]], np.int64)
        self._blocks = blocks_of(lattice.steps.ravel(), offsets, self._cells, side)
        self._starts = self._blocks.of[list(starts)].astype(np.int64)
        # At the end a block is handed over only where loads differ by less than half of one.
        self._cold = max(4, side**4 // 8)
        self._hot = max((share // WIDE) ** 2, 2 * self._cold)
        # From the start that is nearest to the one farthest from it.
        apart = distances[:, list(starts)]
        nearest = int(apart[apart.max(axis=1).argmin()].sum())
        are_together = nearest <= TOGETHER * self._cells.size
        self._far = FAR_TOGETHER if are_together else FAR_APART
        self._price = share // (PRICE_TOGETHER if are_together else PRICE_APART)

    def owners(self, seed: tuple[int, ...]) -> NDArray[np.int32]:
        """Return the robot of each cell, -1 off the ground.

        A part need not be connected: a robot passes through others' on its way.

        Args:
            seed: of the random numbers.

        Returns:
            int32 (rows * cols,).
        """
        owner = np.empty(self._blocks.own.size, np.int64)
        share_blocks(
            self._blocks,
            self._starts,
            PROPOSALS,
            self._hot,
            self._cold,
            self._price,
            self._far,
            stream_of(*seed),
            owner,
        )
        owners = np.full(self._blocks.of.size, -1, np.int32)
        owners[self._cells] = owner[self._blocks.of[self._cells]]
        return owners
