"""Spare time: while the robot drives, what lies further on of its path is made better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.progress import DrivenPath
from fasaco_edge.mission.orders.agenda import Agenda
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.repair import HELD_CELLS

# A path is worth another only if that saves so many steps, and such a share of what is left.
LEAST_STEPS, LEAST_SHARE = 2, 0.002
# The share of time is halved so often at most.
MOST_VAIN = 4
# Where there is nothing to attempt it is asked again so late [s]: to find that out takes a look
# at the whole lattice, and the answer rarely changes from one pose to the next.
SKIPPED_S = 1.0
# After a plan that broke [s].
BROKEN_S = 30.0


class SpareTime:
    """Keeps attempts to a share of a processor core; a share of 0 is none at all.

    Of a path that attempt after attempt makes no better, ever fewer are made.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._resting_until = 0.0
        # The path of the last attempt, and how many came to nothing since it is there.
        self._revision = self._vain = 0

    def is_there(self, now: float) -> bool:
        """Tell whether another attempt may begin at ``now`` [s]."""
        return self._share > 0.0 and now >= self._resting_until

    def spend(self, seconds: float, now: float, revision: int) -> None:
        """Note that an attempt at path ``revision`` took so many seconds, and ended at ``now``."""
        self._vain = min(self._vain + 1, MOST_VAIN) if revision == self._revision else 0
        self._revision = revision
        share = self._share / 2**self._vain
        self._resting_until = now + seconds * (1.0 / share - 1.0)

    def rest(self, now: float) -> None:
        """Note that a plan broke at ``now`` [s]."""
        self._resting_until = max(self._resting_until, now + BROKEN_S)

    def skip(self, now: float) -> None:
        """Note that there was nothing to attempt at ``now`` [s]."""
        self._resting_until = now + SKIPPED_S


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt to make a path better from one of its cells on.

    Attributes:
        revision: of the path.
        index: where on it the robot is.
        joint: index of that cell.
        problem: that the rest of the path solves, the end of the one that is left.
    """

    revision: int
    index: int
    joint: int
    problem: CoverageProblem

    @classmethod
    def at(cls, path: DrivenPath, revision: int, agenda: Agenda, number: int) -> Attempt | None:
        """Return attempt ``number``, on a path; None where too little of it is left."""
        # What the robot is about to drive holds still; less than twice that is not worth a thought.
        joint = path.index + HELD_CELLS
        if joint + HELD_CELLS > len(path.cells):
            return None
        row, col = path.cells[path.index].tolist()
        try:
            problem = agenda.problem((row, col), path.ahead, attempt=number).after(HELD_CELLS)
        except FasacoError:
            return None  # the map has changed: a repair is due
        return cls(revision, path.index, joint, problem)

    def joined(self, path: DrivenPath, better: NDArray[np.int32]) -> NDArray[np.int32] | None:
        """Return what is ahead of a better path, int32 (n, 2); None if it is not worth it."""
        if path.index > self.joint:
            return None
        ahead = better[path.index - self.index :]
        return ahead if _is_worth_it(self.problem.cost, path.ahead, ahead) else None


def _is_worth_it(cost: CoverageCost, before: NDArray[np.int32], after: NDArray[np.int32]) -> bool:
    costs_s = cost.of_walk(before)
    least_s = max(LEAST_STEPS * cost.step_s, LEAST_SHARE * costs_s)
    return costs_s - cost.of_walk(after) >= least_s
