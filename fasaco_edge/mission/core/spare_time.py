"""Spare time: limits attempts at a better path while the current one holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.progress import PathProgress
from fasaco_edge.mission.orders.sequencer import Sequencer
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.walk_before import HELD_CELLS

# Longest time of an attempt: by repairs, and by a search of the whole rest [s].
REPAIR_S, SEARCH_S = 0.05, 0.3
# A path is replaced only if that saves this many steps and this share of the rest.
LEAST_STEPS, LEAST_SHARE = 2, 0.002
# The same share for a new walk, whose line has to be made and polished again: first the time
# without a needed plan [s], then the shares after and before that time. Before that time the next
# change of the map may undo the saving: with a share of 0.01 four robots took 3 % more time in
# unknown buildings, which is within the scatter.
SETTLED_S, SETTLED_SHARE, CHANGING_SHARE = 20.0, 0.01, 0.06
# The share of time is halved at most this many times.
MOST_VAIN = 4
# Pause after an attempt that found nothing to improve [s]: it takes a search of the whole lattice,
# and the answer rarely changes between poses.
SKIPPED_S = 1.0


def most_s(problem: CoverageProblem) -> float:
    """Return how long an attempt at a better path may take [s]."""
    return SEARCH_S if problem.is_full else REPAIR_S


class SpareTime:
    """Limits attempts at better paths to a share of a processor core; 0 for none.

    The share is halved with each vain attempt at the same walk.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._resting_until = 0.0
        # The walk of the last attempt, the number of vain attempts at it, and the duration [s] and
        # end [s] of the last one.
        self._walk = self._vain = 0
        self._last = 0.0, 0.0

    def is_available(self, now: float, walk: int) -> bool:
        """Return whether another attempt, at walk ``walk``, may start at ``now`` [s]."""
        if not self._share or now < self._resting_until:
            return False
        seconds, ended_at = self._last
        share = self._share / (1 << self._vain if walk == self._walk else 1)
        return now >= ended_at + seconds * (1.0 / share - 1.0)

    def spend(self, seconds: float, now: float, walk: int) -> None:
        """Note that an attempt at walk ``walk`` took ``seconds`` and ended at ``now`` [s]."""
        self._vain = min(self._vain + 1, MOST_VAIN) if walk == self._walk else 0
        self._walk, self._last = walk, (seconds, now)

    def rest(self, seconds: float, now: float) -> None:
        """Make no attempt for ``seconds`` from ``now`` [s]: a plan failed."""
        self._resting_until = max(self._resting_until, now + seconds)

    def skip(self, now: float) -> None:
        """Note that there was nothing to improve at ``now`` [s]."""
        self._resting_until = now + SKIPPED_S


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt to improve the path from one of its cells on.

    Attributes:
        numbering: numbering of the path's cells that ``index`` and ``joint`` refer to.
        index: the robot's index on the path.
        joint: index of the cell where the improved rest begins.
        problem: the problem that the rest of the path solves.
    """

    numbering: int
    index: int
    joint: int
    problem: CoverageProblem

    @classmethod
    def at(
        cls,
        path: PathProgress,
        numbering: int,
        orders: Sequencer,
        number: int,
        *,
        is_full: bool = False,
    ) -> Attempt | None:
        """Return attempt ``number`` to improve a path; None if too little of it is left.

        ``is_full``: whether to search the whole rest, see ``CoverageProblem``.
        """
        # The next cells ahead of the robot stay fixed; a shorter rest is not worth a search.
        joint = path.index + HELD_CELLS
        if joint + HELD_CELLS > len(path.cells):
            return None
        row, col = path.cells[path.index].tolist()
        try:
            problem = orders.problem((row, col), path.ahead, attempt=number).after(HELD_CELLS)
        except FasacoError:
            return None  # the map has changed: a repair is due
        problem = replace(problem, is_full=is_full)
        return cls(numbering, path.index, joint, problem)

    def joined(
        self, path: PathProgress, better: NDArray[np.int32], settled_s: float
    ) -> NDArray[np.int32] | None:
        """Return the improved cells ahead, int32 (n, 2); None if they save too little.

        Args:
            path: the current path.
            better: the improved path, int32 (n, 2).
            settled_s: time since a plan was last needed [s].
        """
        if path.index > self.joint:
            return None
        ahead = better[path.index - self.index :]
        share = LEAST_SHARE
        if self.problem.is_full:
            share = SETTLED_SHARE if settled_s >= SETTLED_S else CHANGING_SHARE
        return ahead if _is_worth_it(self.problem, path.ahead, ahead, share) else None


def _is_worth_it(
    problem: CoverageProblem, before: NDArray[np.int32], after: NDArray[np.int32], share: float
) -> bool:
    cost_us = problem.price_us(before)
    least_us = max(LEAST_STEPS * problem.cost.step_us, share * cost_us)
    return cost_us - problem.price_us(after) >= least_us
