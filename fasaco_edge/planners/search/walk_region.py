"""Region of a walk in its own memory, where local search improves and perturbs it.

A region is a part of the ground with the parts of the walk in it. Its walk stays in the processor's
cache, and its reversals are short.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.fold import ANTS
from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.parity import JUMPS, Tally
from fasaco_edge.kernels.local_search.perturbation import (
    DRAWN,
    PERTURBATIONS,
    PROPOSALS,
    LocalSearch,
    PerturbationRules,
    SearchMemory,
    perturb,
    recall,
    remember,
)
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.regions import (
    AFTER,
    Jumps,
    RegionBox,
    cut_ground,
    cut_walk,
    put_back,
)
from fasaco_edge.kernels.local_search.walk_array import (
    COST,
    FRAME,
    LENGTH,
    Ground,
    Prices,
    Walk,
    recount,
)
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.problem import FramedGround
from fasaco_edge.planners.search.search_trail import SearchTrail, colony_for

EVERYWHERE = np.empty(0, np.int32)

# Limit on the loops of a walk that one search lists.
LOOPS = 4096


class WalkRegion:
    """A region of a walk in its own memory: up to ``rows`` x ``cols`` cells and the walk there.

    Args:
        rows, cols: size of the largest region.
        visits: visits of its longest walk.
        jumps: limit on the times that the walk leaves it and comes back.
        trail: the pheromone that its ants read and change.
    """

    def __init__(self, rows: int, cols: int, visits: int, jumps: int, trail: SearchTrail) -> None:
        size = (rows + 2 * FRAME) * (cols + 2 * FRAME)
        both, capacity = size + jumps, 2 * visits + 4 * jumps + 64
        ground = Ground(
            np.zeros(both, np.uint8), np.zeros(both, np.int32), np.zeros(4, np.int64), size
        )
        walk = Walk(
            cells=np.empty(capacity, np.int32),
            place=np.zeros(both, np.int32),
            visits=np.zeros(both, np.int32),
            spare=np.zeros(both, np.int32),
            spare_at=np.zeros(both, np.int32),
            counts=np.zeros(3, np.int64),
        )
        tally = _tally(size, jumps, capacity)
        self._memory = SearchMemory(
            saved=np.empty(capacity, np.int32),
            best=np.empty(capacity, np.int32),
            best_counts=np.zeros(3, np.int64),
            touched=np.empty(size, np.int32),
            area=np.empty(size, np.int32),
            marked=np.zeros(size, np.int32),
            work=np.zeros(2, np.int64),
        )
        colony = colony_for(both, trail.rules)
        self._search = LocalSearch(ground, walk, Prices(1, 0, False), tally, self._memory, colony)
        self._trail = trail
        self._jumps = Jumps(tally.jump_ends, np.empty((jumps, 2), np.int32), np.zeros(2, np.int64))
        self._loaded_us = self._loaded_length = 0
        # The whole ground and walk, and the box of the loaded region.
        self._whole: tuple[Ground, NDArray[np.int32], RegionBox] | None = None

    def load(self, framed: FramedGround, cells: NDArray[np.int32], box: RegionBox) -> bool:
        """Cut a region out; return False if the walk does not enter it, or exceeds the memory.

        Args:
            framed: the whole ground.
            cells: int32 (n,), the whole walk.
            box: the region, not larger than this memory.
        """
        ground, prices = framed.ground, framed.prices
        _, walk, _, tally, _, colony = self._search
        width = box.cols + 2 * FRAME
        region = self._search.ground._replace(bound=(box.rows + 2 * FRAME) * width)
        region.offsets[:] = (1, width, -1, -width)
        self._search = self._search._replace(ground=region)
        if not cut_ground(ground, box, region):
            return False
        half = walk.cells[: walk.cells.size // 2]
        length, jumps = cut_walk(ground, box, cells, half, self._jumps)
        if not length:
            return False
        tally.counts[JUMPS] = jumps
        free_end = prices.free_end and int(self._jumps.limits[AFTER]) == cells.size
        prices = prices._replace(free_end=free_end)
        self._search = self._search._replace(prices=prices)
        rays(region, tally.rays)
        recount(region, walk, length, prices)
        remember(walk, self._memory)
        self._loaded_us, self._loaded_length = int(walk.counts[COST]), length
        self._whole = ground, cells, box
        self._trail.copy(box, colony.trail)
        steps_us = prices.step_us * int(np.count_nonzero(region.needed == 1))
        ants = colony.rules._replace(amount=steps_us / max(self._loaded_us, 1))
        self._search = self._search._replace(colony=colony._replace(rules=ants))
        return True

    @property
    def is_loaded(self) -> bool:
        """Whether a region is loaded and not put back yet."""
        return self._whole is not None

    def hold(self, visits: int) -> None:
        """From now on change the first ``visits`` visits only for a gain."""
        prices = self._search.prices._replace(held=visits)
        self._search = self._search._replace(prices=prices)

    @property
    def gain_us(self) -> int:
        """Cost of the best walk here minus that of the loaded walk [us], so 0 or less."""
        return int(self._memory.best_counts[COST]) - self._loaded_us

    @property
    def longer_by(self) -> int:
        """Steps of the best walk here minus those of the loaded walk."""
        return self.best_length - self._loaded_length

    @property
    def best_length(self) -> int:
        """Visits of the best walk here, including jumps."""
        return int(self._memory.best_counts[LENGTH])

    @property
    def work(self) -> SearchWork:
        """Work in this region and in the regions loaded before."""
        work, ants = self._memory.work, self._search.colony.counts[ANTS]
        return SearchWork(int(ants), int(work[PERTURBATIONS]), int(work[PROPOSALS]))

    @property
    def saved_by_ants_us(self) -> NDArray[np.int64]:
        """Cost saved here by the discs that each cohort rebuilt [us], int64 (cohorts,)."""
        return self._search.colony.saved_us

    def improve(self, temperature_us: int, proposals: int, random: NDArray[np.uint64]) -> None:
        """Make proposals all over the region at one temperature."""
        ground, walk, prices, _, memory, _ = self._search
        improve(ground, walk, prices, EVERYWHERE, temperature_us, proposals, random)
        memory.work[PROPOSALS] += proposals
        if walk.counts[COST] <= memory.best_counts[COST]:
            remember(walk, memory)

    def touch_up(
        self, cells: NDArray[np.int32], rules: PerturbationRules, random: NDArray[np.uint64]
    ) -> None:
        """Improve the walk around cells of the region, int32 (n,); ``rules`` are strict."""
        self._memory.touched[: cells.size] = cells
        perturb(self._search, rules, 1, cells.size, random)

    def perturb(self, rules: PerturbationRules, times: int, random: NDArray[np.uint64]) -> None:
        """Perturb the walk ``times`` times."""
        perturb(self._search, rules, times, DRAWN, random)

    def go_back(self) -> None:
        """Continue from the best walk here."""
        ground, walk, prices, _, memory, _ = self._search
        recall(ground, walk, prices, memory)

    def put_back(self) -> NDArray[np.int32]:
        """Return the whole walk, int32 (m,), including the best walk here."""
        assert self._whole is not None
        ground, cells, box = self._whole
        self._whole = None
        self._trail.paste(box, self._search.colony.trail)
        best = self._memory.best[: self.best_length]
        out = np.empty(cells.size + best.size, np.int32)
        return out[: put_back(ground, box, cells, best, self._jumps, out)]


def _tally(size: int, jumps: int, capacity: int) -> Tally:
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
        stack=np.empty(capacity, np.int32),
        counts=np.zeros(1, np.int64),
        jump_ends=np.zeros((jumps, 2), np.int32),
        next_jump=np.zeros((jumps, 2), np.int32),
        jumped=np.zeros(jumps, np.uint8),
        links=np.full(size, -1, np.int32),
    )


def stream_of(*seed: int) -> NDArray[np.uint64]:
    """Return the state of a random stream for local search, uint64 (1,), not 0."""
    word = np.random.SeedSequence(seed).generate_state(1, np.uint64)
    return np.maximum(word, np.uint64(1))
