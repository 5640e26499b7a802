"""The one interface of all planners."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from fasaco_edge.planners.observation import ColonySnapshot, Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.work import SearchProgress

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
