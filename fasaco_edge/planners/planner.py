"""The one interface of all planners.

When a search ends: by the clock, its work, its quality, or because something newer came.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from fasaco_edge.planners.observation import ColonySnapshot, Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.work import SearchProgress, SearchWork

# Asked again and again while a search runs, with how far it is; True ends the
# search with the best walk it has. There always is one.
StoppingCriterion = Callable[[SearchProgress], bool]


class CoveragePlanner(Protocol):
    """Plans a walk that covers a problem's cells."""

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return a complete walk.

        Args:
            problem: what to cover, from where.
            stop: when to end early; the work done until then travels with the path.
            observe: is offered a snapshot after each cohort.
        """
        ...


def never(progress: SearchProgress) -> bool:
    """Let a search run to its end."""
    return False


def ignore(snapshot: ColonySnapshot) -> None:
    """Observe nothing."""


@dataclass(slots=True)
class TimeBudget:
    """Stop after some seconds of wall time, counted from the making of this object."""

    seconds: float
    started: float = field(default_factory=time.monotonic)

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether the budget is used up."""
        return time.monotonic() - self.started >= self.seconds


@dataclass(frozen=True, slots=True)
class WorkLimit:
    """Stop after as much work as an earlier search did: this repeats its path."""

    work: SearchWork

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether every count of the work is reached."""
        return progress.work.reaches(self.work)


@dataclass(frozen=True, slots=True)
class GapReached:
    """Stop when the walk is proven to be at most ``target`` longer than the shortest: 0.01, 1 %.

    Without a bound this never stops a search.
    """

    target: float

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether the walk is near enough to the bound."""
        gap = progress.gap
        return gap is not None and gap <= self.target


@dataclass(frozen=True, slots=True)
class Interrupt:
    """Stop when another thread asks for it."""

    asked: threading.Event = field(default_factory=threading.Event)

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether somebody asked."""
        return self.asked.is_set()


@dataclass(slots=True)
class Noted:
    """Stops when another criterion does, and notes when: ``StopAt`` repeats it exactly.

    The work of the path alone would not: a repair that was stopped and came to little is
    followed by a search, of which this tells, too.

    Attributes:
        criterion: the other one.
        stops: which of the questions were answered by yes, from 1.
    """

    criterion: StoppingCriterion
    stops: list[int] = field(default_factory=list)
    _asked: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether the other says so."""
        self._asked += 1
        says_so = self.criterion(progress)
        if says_so:
            self.stops.append(self._asked)
        return says_so


@dataclass(slots=True)
class StopAt:
    """Stop where a search that was ``Noted`` stopped: this repeats its path."""

    stops: Sequence[int]
    _asked: int = 0

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether this is one of those questions."""
        self._asked += 1
        return self._asked in self.stops


class AnyOf:
    """Stop when one of several criteria says so; with none, never."""

    __slots__ = ("criteria",)

    def __init__(self, *criteria: StoppingCriterion) -> None:
        self.criteria = criteria

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether any says so."""
        return any(criterion(progress) for criterion in self.criteria)
