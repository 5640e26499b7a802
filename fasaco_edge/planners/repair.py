"""Repair: the walk that was still to be driven, mended, and improved where it changed.

What holds stays as it is, cell by cell: a change is taken only if it gains
something. A robot sees its path hold still wherever the map did, and what one
search found serves the next.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.costs import walk_cost
from fasaco_edge.kernels.walk_array import Prices
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.cost import MICROSECONDS
from fasaco_edge.planners.effort import repair_for
from fasaco_edge.planners.framed import FramedGround
from fasaco_edge.planners.graph import cells_of
from fasaco_edge.planners.mending import framed_cells, mended
from fasaco_edge.planners.patch import Patch
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.regions import is_one_region, regions_of
from fasaco_edge.planners.work import SearchProgress

# Kicks that one repair makes, and how many before it is asked whether to stop.
KICKS = 30
KICKS_AT_ONCE = 5


def can_repair(problem: CoverageProblem) -> bool:
    """Tell whether there is a walk to repair, on a ground small enough to be looked at whole."""
    rows, cols = problem.to_cover.shape
    return (
        problem.before is not None
        and len(problem.before) > 0
        and is_one_region(rows, cols, problem.cells)
    )


def repaired(
    problem: CoverageProblem, name: str, seed: int, stop: StoppingCriterion
) -> CoveragePath:
    """Return a complete walk that keeps what holds of ``problem.before``.

    Args:
        problem: with a walk ``before``, see ``can_repair``.
        name, seed: of the planner.
        stop: when to end early.
    """
    repair = _Repair(problem, seed)
    for _ in repair.run():
        if stop(repair.progress()):
            break
    return repair.path(name, seed)


class _Repair:
    """A repair under way, a generator of pauses like ``search.Search``."""

    def __init__(self, problem: CoverageProblem, seed: int) -> None:
        assert problem.before is not None
        began = time.perf_counter()
        cost = problem.cost
        self._problem = problem
        self._framed = FramedGround.of(problem)
        self._prices = Prices(cost.step_us, cost.quarter_turn_us, problem.end is None)
        self._walk = mended(problem, self._framed, problem.before)
        self._touched = _touched(framed_cells(problem, self._framed, problem.before), self._walk)
        self._first_walk_s = time.perf_counter() - began
        self._bound = lower_bound_steps(problem)
        word = np.random.SeedSequence((seed, len(self._walk))).generate_state(1, np.uint64)
        self._random = np.maximum(word, np.uint64(1))
        self._box = next(regions_of(self._framed, problem.cells, 0))
        self._patch = Patch(self._framed.rows, self._framed.cols, 2 * self._walk.size, 1)
        self._patch.load(self._framed.ground, self._walk, self._box, self._prices)

    def run(self) -> Iterator[None]:
        """Improve the walk around what changed, then by kicks; pause after each piece."""
        rules = repair_for(self._problem.cost)
        if self._touched.size:
            self._patch.touch_up(self._touched, rules, self._random)
            yield
        for _ in range(0, KICKS, KICKS_AT_ONCE):
            if not self._prices.quarter_turn_us and self.progress().steps == self._bound:
                return
            self._patch.kick(rules, KICKS_AT_ONCE, self._random)
            yield

    def progress(self) -> SearchProgress:
        """Return how far it is."""
        walk = self._best()
        cost_us = walk_cost(walk, self._prices.step_us, self._prices.quarter_turn_us)
        return SearchProgress(self._patch.work, cost_us / MICROSECONDS, walk.size - 1, self._bound)

    def path(self, name: str, seed: int) -> CoveragePath:
        """Return the walk as it is now."""
        progress = self.progress()
        return CoveragePath(
            cells_of(self._problem, self._framed.unframed(self._best())),
            planner=name,
            seed=seed,
            work=progress.work,
            cost_s=progress.cost_s,
            lower_bound_steps=self._bound,
            first_walk_s=self._first_walk_s,
        )

    def _best(self) -> NDArray[np.int32]:
        return self._patch.put_back(self._framed.ground, self._walk, self._box)


def _touched(before: NDArray[np.int32], walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the cells at steps that one walk takes more often than the other, int32 (n,)."""
    old, new = _steps(before), _steps(walk)
    steps, where = np.unique(np.concatenate((old, new)), axis=0, return_inverse=True)
    where = where.ravel()
    times = np.bincount(where[len(old) :], minlength=len(steps))
    times -= np.bincount(where[: len(old)], minlength=len(steps))
    # The part that was driven since is gone from the old walk's beginning, no change.
    return np.intersect1d(steps[times != 0], walk).astype(np.int32)


def _steps(walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a walk's steps, whichever way they are taken, int32 (n, 2)."""
    return np.sort(np.column_stack((walk[:-1], walk[1:])), axis=1)
