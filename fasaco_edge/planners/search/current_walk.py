"""Current walk of a search, and its best walk so far.

A search changes parts of the walk: a region of the ground that is loaded and put back
(``walk_region``), or windows (``windows``). This module accepts results. Walks are framed cells.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.planners.bound import LowerBound
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.search.regions import EDGE, is_one_region, regions_of
from fasaco_edge.planners.search.search_trail import SearchTrail
from fasaco_edge.planners.search.walk_region import WalkRegion
from fasaco_edge.planners.search.windows import WindowSearch

# Memory of local search: visits per cell.
VISITS_PER_CELL = 4

# Limit on the walk's crossings of a region's border.
JUMPS = 8 * EDGE


class CurrentWalk:
    """The current walk of a search, its regions and windows, and the best walk so far.

    Attributes:
        cost_us: cost of the current walk [us].
        best, best_us: the best walk so far, int32 (n,), and its cost [us].
        is_whole: whether one region covers the ground.
        region: the loaded region, or the last one.
        windows: the search in windows; None before ``open_windows``.
        held: number of leading visits that change only for a gain.
        since_gain: perturbations since the last gain.
    """

    def __init__(self, problem: CoverageProblem, framed: FramedGround, trail: SearchTrail) -> None:
        self._problem, self._framed, self._trail = problem, framed, trail
        self.is_whole = is_one_region(framed.rows, framed.cols, problem.cells)
        self._walk, self.cost_us = np.empty(0, np.int32), 0
        self.best, self.best_us = self._walk, 0
        self.held = self.since_gain = 0
        self.region = WalkRegion(0, 0, 0, 0, trail)
        self.windows: WindowSearch | None = None
        # Windows of the walk are being solved, and not put back yet.
        self._in_windows = False
        self._passes = 0

    def begin(self, walk: NDArray[np.int32], cost_us: int) -> None:
        """Start with a walk of this cost [us], the best so far."""
        self._walk, self.cost_us = walk, cost_us
        self.best, self.best_us = walk, cost_us

    def _accept(self, walk: NDArray[np.int32], cost_us: int) -> None:
        """Continue from a walk if it costs no more."""
        if cost_us < self.cost_us:
            self.since_gain = 0
        if cost_us <= self.cost_us:
            self._walk, self.cost_us = walk, cost_us
        if cost_us < self.best_us:
            self.best, self.best_us = walk, cost_us

    @property
    def is_empty(self) -> bool:
        """Whether there is no walk yet."""
        return not self._walk.size

    @property
    def work(self) -> SearchWork:
        """Work in regions and windows; a window counts as a perturbation."""
        solved = 0 if self.windows is None else self.windows.solved
        return self.region.work + SearchWork(perturbations=solved)

    @property
    def least_us(self) -> int:
        """Cost of the best walk, in windows or not [us]."""
        if self.windows is None or not self._in_windows:
            return self.best_us
        return min(self.best_us, self.windows.best_us)

    def progress(self) -> tuple[int, int]:
        """Return cost [us] and steps of the best walk.

        The gain of a loaded region counts, too, except if turns cost and the region has a border:
        the turns at the border are known once it is put back.
        """
        best_us, steps = self.best_us, self.best.size - 1
        exact = self.is_whole or not self._framed.prices.quarter_turn_us
        if self.region.is_loaded and exact:
            here_us = self.cost_us + self.region.gain_us
            if here_us < best_us:
                best_us, steps = here_us, self._walk.size - 1 + self.region.longer_by
        if self.windows is not None and self._in_windows and self.windows.best_us < best_us:
            best_us, steps = self.windows.best_us, self.windows.best_steps
        return best_us, steps

    def put_back(self) -> None:
        """Put back the region and the windows that are being worked on."""
        self._unload()
        self.put_back_windows()

    def allocate_region(self) -> None:
        """Allocate memory for the regions, once the first walk is known."""
        framed, cells = self._framed, self._problem.cells
        if self.is_whole:
            # The second value is for few cells far apart: most of the walk lies between them.
            visits = max(VISITS_PER_CELL * cells, 2 * self._walk.size)
            self.region = WalkRegion(framed.rows, framed.cols, visits, 1, self._trail)
        else:
            self.region = WalkRegion(EDGE, EDGE, VISITS_PER_CELL * EDGE * EDGE, JUMPS, self._trail)

    def regions(self) -> Iterator[WalkRegion]:
        """Load each region of the next pass in turn; put it back afterwards."""
        for box in regions_of(self._framed, self._problem.cells, self._passes):
            if self.region.load(self._framed, self._walk, box):
                self.region.hold(self.held)
                yield self.region
                self._unload()
        self._passes += 1

    def _unload(self) -> None:
        if self.region.is_loaded:
            walk = self.region.put_back()
            self._accept(walk, self._problem.cost_us(walk, self._framed))

    def open_windows(self, bound: LowerBound) -> WindowSearch:
        """Return the search in windows, guided by the prices of ``bound``; opened now."""
        self.windows = WindowSearch(self._problem, self._framed, bound)
        return self.windows

    def load_windows(self) -> bool:
        """Let windows start from the walk, or resume; return whether they can."""
        self._in_windows = self.windows is not None and self.windows.load(self._walk)
        return self._in_windows

    def put_back_windows(self) -> None:
        """Continue from the best walk of the windows, if it is better."""
        if self.windows is None or not self._in_windows:
            return
        self._in_windows = False
        cost_us = self.windows.best_us
        if cost_us < self.cost_us:
            self._accept(self.windows.walk(), cost_us)
