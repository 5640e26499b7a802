"""A region under local search: a part of the ground with the parts of the walk that lie there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.parity import JUMPS, Tally
from fasaco_edge.kernels.local_search.perturbation import (
    KICKS,
    PROPOSALS,
    KickRules,
    Memory,
    kick,
    recall,
    remember,
    touch_up,
)
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.regions import AFTER, Box, cut_ground, cut_walk, put_back
from fasaco_edge.kernels.local_search.walk_array import (
    COST,
    FRAME,
    LENGTH,
    Ground,
    Prices,
    Walk,
    recount,
)
from fasaco_edge.planners.stopping import SearchWork

EVERYWHERE = np.empty(0, np.int32)

# Loops that one search lists at most.
LOOPS = 4096


class Patch:
    """Room for a region of up to ``rows`` x ``cols`` cells and a walk in it.

    Args:
        rows, cols: size of the largest region.
        visits: visits of the longest walk in it.
        jumps: how often the walk may leave it and come back.
    """

    def __init__(self, rows: int, cols: int, visits: int, jumps: int) -> None:
        size = (rows + 2 * FRAME) * (cols + 2 * FRAME)
        both, room = size + jumps, 2 * visits + 4 * jumps + 64
        self._ground = Ground(
            np.zeros(both, np.uint8), np.zeros(both, np.int32), np.zeros(4, np.int64), size
        )
        self._walk = Walk(
            cells=np.empty(room, np.int32),
            place=np.zeros(both, np.int32),
            visits=np.zeros(both, np.int32),
            spare=np.zeros(both, np.int32),
            spare_at=np.zeros(both, np.int32),
            counts=np.zeros(3, np.int64),
        )
        self._tally = _tally(size, jumps, room)
        self._memory = Memory(
            saved=np.empty(room, np.int32),
            best=np.empty(room, np.int32),
            best_counts=np.zeros(3, np.int64),
            touched=np.empty(size, np.int32),
            area=np.empty(size, np.int32),
            marked=np.zeros(size, np.int32),
            work=np.zeros(2, np.int64),
        )
        self._sections = np.empty((jumps, 2), np.int32)
        self._limits = np.zeros(2, np.int64)
        self._prices = Prices(1, 0, False)
        self._loaded_us = self._loaded_length = 0

    def load(self, ground: Ground, cells: NDArray[np.int32], box: Box, prices: Prices) -> bool:
        """Cut a region out; return False where the walk does not come there.

        Args:
            ground: the whole ground.
            cells: int32 (n,), the whole walk.
            box: the region, no larger than the patch.
            prices: of the whole walk.
        """
        width = box.cols + 2 * FRAME
        bound = (box.rows + 2 * FRAME) * width
        self._ground.offsets[:] = (1, width, -1, -width)
        self._ground = self._ground._replace(bound=bound)
        if not cut_ground(ground, box, self._ground):
            return False
        length, jumps = cut_walk(
            ground,
            box,
            cells,
            bound,
            self._walk.cells[: self._walk.cells.size // 2],
            self._tally.jump_ends,
            self._sections,
            self._limits,
        )
        if not length:
            return False
        self._tally.counts[JUMPS] = jumps
        self._prices = prices._replace(
            free_end=prices.free_end and int(self._limits[AFTER]) == cells.size
        )
        rays(self._ground, self._tally.rays)
        recount(self._ground, self._walk, length, self._prices)
        remember(self._walk, self._memory)
        self._loaded_us, self._loaded_length = int(self._walk.counts[COST]), length
        return True

    def hold(self, visits: int) -> None:
        """Let the first so many visits change only where something is gained, from now on."""
        self._prices = self._prices._replace(held=visits)

    @property
    def gain_us(self) -> int:
        """By how much the best walk here costs more than the one loaded [us], so 0 or less."""
        return int(self._memory.best_counts[COST]) - self._loaded_us

    @property
    def longer_by(self) -> int:
        """By how many steps it is longer."""
        return self.best_length - self._loaded_length

    @property
    def best_length(self) -> int:
        """Visits of the best walk here, jumps among them."""
        return int(self._memory.best_counts[LENGTH])

    @property
    def work(self) -> SearchWork:
        """What was done here, in this region and those before it."""
        kicks, proposals = int(self._memory.work[KICKS]), int(self._memory.work[PROPOSALS])
        return SearchWork(kicks=kicks, proposals=proposals)

    def improve(self, heat_us: int, proposals: int, random: NDArray[np.uint64]) -> None:
        """Make proposals all over the region at one temperature."""
        improve(self._ground, self._walk, self._prices, EVERYWHERE, heat_us, proposals, random)
        self._memory.work[PROPOSALS] += proposals
        if self._walk.counts[COST] <= self._memory.best_counts[COST]:
            remember(self._walk, self._memory)

    def touch_up(
        self, cells: NDArray[np.int32], rules: KickRules, random: NDArray[np.uint64]
    ) -> None:
        """Improve the walk around cells of the region, int32 (n,), if that gains something."""
        self._memory.touched[: cells.size] = cells
        touch_up(self._ground, self._walk, self._prices, self._memory, rules, cells.size, random)

    def kick(self, rules: KickRules, kicks: int, random: NDArray[np.uint64]) -> None:
        """Kick the walk so many times."""
        kick(
            self._ground,
            self._walk,
            self._prices,
            self._tally,
            self._memory,
            rules,
            kicks,
            random,
        )

    def go_back(self) -> None:
        """Go on from the best walk here."""
        recall(self._ground, self._walk, self._prices, self._memory)

    def put_back(self, ground: Ground, cells: NDArray[np.int32], box: Box) -> NDArray[np.int32]:
        """Return the whole walk, int32 (m,), with the best walk here in it."""
        length = self.best_length
        out = np.empty(cells.size + length, np.int32)
        size = put_back(
            ground,
            box,
            cells,
            self._ground.bound,
            self._memory.best[:length],
            self._sections,
            self._limits,
            out,
        )
        return out[:size]


def _tally(size: int, jumps: int, room: int) -> Tally:
    return Tally(
        times=np.zeros((size, 2), np.int16),
        order_of_old=np.zeros((size, 4), np.int8),
        rays=np.zeros(size, np.int64),
        reached=np.zeros(size, np.int64),
        distance=np.zeros(size, np.int32),
        growth=np.zeros(size, np.int32),
        parent=np.zeros(size, np.int32),
        crossed=np.zeros(size, np.int64),
        order=np.empty(size, np.int32),
        near=np.empty(4 * size, np.int32),
        far=np.empty(4 * size, np.int32),
        loops=np.zeros((LOOPS, 2), np.int64),
        marked=np.zeros(size, np.int64),
        clock=np.zeros(2, np.int64),
        stack=np.empty(room, np.int32),
        counts=np.zeros(1, np.int64),
        jump_ends=np.zeros((jumps, 2), np.int32),
        next_jump=np.zeros((jumps, 2), np.int32),
        jumped=np.zeros(jumps, np.uint8),
        links=np.full(size, -1, np.int32),
    )
