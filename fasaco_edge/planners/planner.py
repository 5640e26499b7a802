"""The interface of all planners: what a search reports, and what ends it: time, work, quality.

Work is counted, so that the same work can be done again. Free of the compiler, for those who
only handle what a search showed.
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
    """State of a running search, as a stopping criterion sees it.

    Attributes:
        work: what it has done so far.
        cost_s: cost of the best walk so far [s].
        steps: its steps.
        lower_bound_cost_s: no walk costs less [s]; 0 where no bound is known.
    """

    work: SearchWork
    cost_s: float
    steps: int
    lower_bound_cost_s: float = 0.0

    @property
    def gap(self) -> float | None:
        """How far above the bound the cost of the best walk is; None without a bound."""
        return gap_to(self.lower_bound_cost_s, self.cost_s)


# Called again and again while a search runs; True ends it with the best walk it has. There
# always is one.
StoppingCriterion = Callable[[SearchProgress], bool]


def never(progress: SearchProgress) -> bool:
    """Let a search run to its end."""
    return False


@dataclass(slots=True)
class TimeBudget:
    """Stop after some seconds of wall time, counted from the creation of this object."""

    seconds: float
    started: float = field(default_factory=time.monotonic)

    def __call__(self, progress: SearchProgress) -> bool:
        return time.monotonic() - self.started >= self.seconds


@dataclass(frozen=True, slots=True)
class WorkLimit:
    """Stop after as much work as an earlier search did: this repeats its path."""

    work: SearchWork

    def __call__(self, progress: SearchProgress) -> bool:
        return progress.work.reaches(self.work)


@dataclass(frozen=True, slots=True)
class GapReached:
    """Stop when the walk is proven to cost at most ``target`` more than the best: 0.01, 1 %.

    Without a bound this never stops a search.
    """

    target: float

    def __call__(self, progress: SearchProgress) -> bool:
        gap = progress.gap
        return gap is not None and gap <= self.target


@dataclass(frozen=True, slots=True)
class Interrupt:
    """Stop when another thread sets ``asked``."""

    asked: threading.Event = field(default_factory=threading.Event)

    def __call__(self, progress: SearchProgress) -> bool:
        return self.asked.is_set()


@dataclass(slots=True)
class StopRecorder:
    """Stop when another criterion does, and record at which calls: ``StopAt`` repeats it exactly.

    The work of the path alone would not: a repair that was stopped and gained little is
    followed by a search, of which this keeps the stops, too.

    Attributes:
        criterion: the other one.
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
    """Stop at the calls that a ``StopRecorder`` recorded: this repeats its path."""

    stops: Sequence[int]
    _calls: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        self._calls += 1
        return self._calls in self.stops


class AnyOf:
    """Stop when one of several criteria is met; with none, never."""

    __slots__ = ("criteria",)

    def __init__(self, *criteria: StoppingCriterion) -> None:
        self.criteria = criteria

    def __call__(self, progress: SearchProgress) -> bool:
        return any(criterion(progress) for criterion in self.criteria)


@dataclass(frozen=True, slots=True, eq=False)
class ColonySnapshot:
    """The colony after a cohort, or where local search restarts.

    Attributes:
        window: which cells of the lattice ``trail`` spans.
        cell_m: edge of a cell [m].
        trail: float32 (rows, cols): pheromone on the moves into a cell, the mean of them after a
            cohort, the strongest of a living trail; 0 where the cell is not coverable.
        cohort: index of the cohort that walked last, from 0.
        velocity: its velocity [cells/move].
        ants: how many ants have walked so far.
        best_steps: steps of the best walk so far.
        tau: float32 (rows, cols, 4): pheromone on the step out of each cell in each direction, 0
            for no step; None where only ``trail`` is known.
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
    """Plans a walk that covers a problem's cells."""

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return a complete walk.

        Args:
            problem: what to cover, from where.
            stop: when to end early; the work done until then travels with the path.
            observe: is called with a snapshot after each cohort.
        """
        ...
