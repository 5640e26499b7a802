"""Interface of all planners: progress of a search, and stopping criteria: time, work, quality.

Work is counted, so that a search can be repeated exactly. No numba is imported here: code that
only reads search results stays light.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.planners.cost import SearchWork, gap_to

if TYPE_CHECKING:
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class SearchProgress:
    """State of a running search, as seen by a stopping criterion.

    Attributes:
        work: work so far.
        cost_s: cost of the best walk so far [s].
        steps: steps of that walk.
        lower_bound_cost_s: lower bound on the cost [s]; 0 if unknown.
    """

    work: SearchWork
    cost_s: float
    steps: int
    lower_bound_cost_s: float = 0.0

    @property
    def gap(self) -> float | None:
        """Optimality gap of the best walk; None without a bound."""
        return gap_to(self.lower_bound_cost_s, self.cost_s)


# Called repeatedly while a search runs; True ends it with the best walk so far, which always
# exists. A plan completes its first line all the same, unless a criterion has an attribute
# ``cuts_first_line`` that is true.
StoppingCriterion = Callable[[SearchProgress], bool]


def never(progress: SearchProgress) -> bool:
    """Let a search run to its end."""
    return False


@dataclass(slots=True)
class TimeBudget:
    """Stops after some seconds of wall time, counted from the creation of this object."""

    seconds: float
    started: float = field(default_factory=time.monotonic)

    def __call__(self, progress: SearchProgress) -> bool:
        return time.monotonic() - self.started >= self.seconds


@dataclass(frozen=True, slots=True)
class WorkLimit:
    """Stops after the work of an earlier search, so that its path is reproduced."""

    work: SearchWork

    def __call__(self, progress: SearchProgress) -> bool:
        return progress.work.reaches(self.work)


@dataclass(frozen=True, slots=True)
class Interrupt:
    """Stops when another thread sets ``asked``."""

    asked: threading.Event = field(default_factory=threading.Event)

    def __call__(self, progress: SearchProgress) -> bool:
        return self.asked.is_set()

    @property
    def cuts_first_line(self) -> bool:
        """Whether it stops a plan even before its first line is complete."""
        return self.asked.is_set()


@dataclass(slots=True)
class StopRecorder:
    """Passes on what another criterion decides, and records the calls that stop, for ``StopAt``.

    Counts of work do not reproduce such a path: a repair and the search after it may both stop.

    Attributes:
        criterion: the criterion asked.
        stops: numbers of the calls that returned True, from 1.
    """

    criterion: StoppingCriterion
    stops: list[int] = field(default_factory=list)
    _calls: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        self._calls += 1
        stop = self.criterion(progress)
        if stop:
            self.stops.append(self._calls)
        return stop


@dataclass(slots=True)
class StopAt:
    """Stops at the calls that a ``StopRecorder`` recorded, so that the path is reproduced."""

    stops: Sequence[int]
    _calls: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        self._calls += 1
        return self._calls in self.stops


class AnyOf:
    """Stops when one of several criteria is met; with none, never."""

    __slots__ = ("criteria",)

    def __init__(self, *criteria: StoppingCriterion) -> None:
        self.criteria = criteria

    def __call__(self, progress: SearchProgress) -> bool:
        return any(criterion(progress) for criterion in self.criteria)


@dataclass(frozen=True, slots=True, eq=False)
class ColonySnapshot:
    """Pheromone of a colony after a cohort, of colony-search at its end, or of a living trail.

    Attributes:
        window: window of the lattice that ``trail`` spans.
        cell_m: edge of a cell [m].
        trail: float32 (rows, cols): pheromone on the moves into a cell: the mean, or the largest
            of a living trail; 0 if the cell is not coverable.
        cohort: index of the last cohort, from 0.
        velocity: its velocity [cells/move].
        ants: number of ants so far.
        best_steps: steps of the best walk so far.
        tau: float32 (rows, cols, 4): pheromone on the step out of each cell in each direction, 0
            for no step; None if only ``trail`` is known.
    """

    window: Window
    cell_m: float
    trail: NDArray[np.float32]
    cohort: int
    velocity: int
    ants: int
    best_steps: int
    tau: NDArray[np.float32] | None = None


Observer = Callable[[ColonySnapshot], None]


def ignore(snapshot: ColonySnapshot) -> None:
    """Observe nothing."""


class CoveragePlanner(Protocol):
    """Plans a walk that covers the cells of a problem."""

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return a complete walk.

        Args:
            problem: what to cover, from where.
            stop: stopping criterion; the path holds the work done until then.
            observe: called with a snapshot after each cohort.
        """
        ...
