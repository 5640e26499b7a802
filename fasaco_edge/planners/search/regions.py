"""Regions for local search: squares over a large ground, neighbourhoods of what changed.

A region is part of the ground, with the parts of the walk that lie there. Its walk stays in
the processor's cache, and its reversals are short. Each pass shifts the squares, so that what
was on a rim is inside. A repair works on neighbourhoods of what changed, each small enough to
be perturbed as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.parity import JUMPS, Tally
from fasaco_edge.kernels.local_search.perturbation import (
    PERTURBATIONS,
    PROPOSALS,
    Memory,
    PerturbationRules,
    Search,
    perturb,
    recall,
    remember,
    touch_up,
)
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.regions import (
    AFTER,
    Box,
    Jumps,
    cut_ground,
    cut_walk,
    neighbourhood,
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

EVERYWHERE = np.empty(0, np.int32)

# Loops that one search lists at most.
LOOPS = 4096


class WalkRegion:
    """A region of a walk in memory of its own: up to ``rows`` x ``cols`` cells and the walk there.

    Args:
        rows, cols: size of the largest region.
        visits: visits of the longest walk in it.
        jumps: how often the walk may leave it and come back.
    """

    def __init__(self, rows: int, cols: int, visits: int, jumps: int) -> None:
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
        self._memory = Memory(
            saved=np.empty(capacity, np.int32),
            best=np.empty(capacity, np.int32),
            best_counts=np.zeros(3, np.int64),
            touched=np.empty(size, np.int32),
            area=np.empty(size, np.int32),
            marked=np.zeros(size, np.int32),
            work=np.zeros(2, np.int64),
        )
        self._search = Search(ground, walk, Prices(1, 0, False), tally, self._memory)
        self._jumps = Jumps(tally.jump_ends, np.empty((jumps, 2), np.int32), np.zeros(2, np.int64))
        self._loaded_us = self._loaded_length = 0
        # The whole ground and walk, and the region of them that is loaded.
        self._whole: tuple[Ground, NDArray[np.int32], Box] | None = None

    def load(self, framed: FramedGround, cells: NDArray[np.int32], box: Box) -> bool:
        """Cut a region out; return False where the walk does not come there.

        Args:
            framed: the whole ground.
            cells: int32 (n,), the whole walk.
            box: the region, no larger than this memory.
        """
        ground, prices = framed.ground, framed.prices
        _, walk, _, tally, _ = self._search
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
        return True

    @property
    def is_loaded(self) -> bool:
        """Whether a region was cut out and is not put back yet."""
        return self._whole is not None

    def hold(self, visits: int) -> None:
        """Let the first so many visits change only where something is gained, from now on."""
        prices = self._search.prices._replace(held=visits)
        self._search = self._search._replace(prices=prices)

    @property
    def gain_us(self) -> int:
        """Cost of the best walk here less that of the walk loaded [us], so 0 or less."""
        return int(self._memory.best_counts[COST]) - self._loaded_us

    @property
    def longer_by(self) -> int:
        """Steps of the best walk here less those of the walk loaded."""
        return self.best_length - self._loaded_length

    @property
    def best_length(self) -> int:
        """Visits of the best walk here, jumps among them."""
        return int(self._memory.best_counts[LENGTH])

    @property
    def work(self) -> SearchWork:
        """What was done here, in this region and those before it."""
        work = self._memory.work
        return SearchWork(perturbations=int(work[PERTURBATIONS]), proposals=int(work[PROPOSALS]))

    def improve(self, temperature_us: int, proposals: int, random: NDArray[np.uint64]) -> None:
        """Make proposals all over the region at one temperature."""
        ground, walk, prices, _, memory = self._search
        improve(ground, walk, prices, EVERYWHERE, temperature_us, proposals, random)
        memory.work[PROPOSALS] += proposals
        if walk.counts[COST] <= memory.best_counts[COST]:
            remember(walk, memory)

    def touch_up(
        self, cells: NDArray[np.int32], rules: PerturbationRules, random: NDArray[np.uint64]
    ) -> None:
        """Improve the walk around cells of the region, int32 (n,), if that gains something."""
        self._memory.touched[: cells.size] = cells
        touch_up(self._search, rules, cells.size, random)

    def perturb(self, rules: PerturbationRules, times: int, random: NDArray[np.uint64]) -> None:
        """Perturb the walk so many times."""
        perturb(self._search, rules, times, random)

    def go_back(self) -> None:
        """Go on from the best walk here."""
        recall(self._search)

    def put_back(self) -> NDArray[np.int32]:
        """Return the whole walk, int32 (m,), with the best walk here in it."""
        assert self._whole is not None
        ground, cells, box = self._whole
        self._whole = None
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


# A ground of up to so many cells to cover, on a lattice not too large for them, is one
# region: the cost of working on it as a whole does not matter yet.
ONE_REGION = 8_000
LATTICE_OF_ONE = 5 * ONE_REGION

# Edge of a square region, in cells.
EDGE = 80

# Shift of the squares of each pass, in halves of an edge: row, column.
SHIFTS = ((0, 0), (1, 1), (1, 0), (0, 1))


def is_one_region(rows: int, cols: int, cells: int) -> bool:
    """Return whether a lattice with so many cells to cover is searched as a whole."""
    return cells <= ONE_REGION and rows * cols <= LATTICE_OF_ONE


def regions_of(framed: FramedGround, cells: int, number: int) -> Iterator[Box]:
    """Yield the regions of pass ``number`` over a ground with so many cells to cover."""
    if is_one_region(framed.rows, framed.cols, cells):
        labels = np.zeros(framed.ground.bound, np.int32)
        yield Box(labels, 0, FRAME, FRAME, framed.rows, framed.cols)
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
            yield Box(
                labels,
                row * across + col,
                first_row,
                first_col,
                last_row - first_row,
                last_col - first_col,
            )


def _span(number: int, shift: int, size: int) -> tuple[int, int]:
    """Return where region ``number`` begins and ends along one axis, inside the frame."""
    first = max(number * EDGE - shift, FRAME)
    return first, min((number + 1) * EDGE - shift, FRAME + size)


def stream_of(*seed: int) -> NDArray[np.uint64]:
    """Return the state of a random stream for local search, uint64 (1,), not 0."""
    word = np.random.SeedSequence(seed).generate_state(1, np.uint64)
    return np.maximum(word, np.uint64(1))


# Steps from what changed to the rim: in trials 10 and 20 gained nothing more, 3 lost.
RADIUS = 6
# Changed cells that one neighbourhood begins with at most, and its cells.
MOST_CHANGED, MOST_CELLS = 1_000, 3_000
# The same where nothing has changed, and a walk is to be made better somewhere.
SPOT_RADIUS = 20
GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)
# Visits that a walk may become longer by for a while.
SPARE_VISITS = 600


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

    def walk_region(self, walk: NDArray[np.int32]) -> WalkRegion:
        """Return memory for it, and for the parts of a walk, framed cells, that lie in it."""
        inside = self.box.labels[walk] == self.box.label
        jumps = int(np.count_nonzero(np.diff(inside))) // 2 + 1
        visits = int(np.count_nonzero(inside)) + 4 * jumps + SPARE_VISITS
        return WalkRegion(self.box.rows, self.box.cols, visits, jumps)


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

    Those of successive numbers are spread evenly along it, from any first number.
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
