"""The interface of all planners, and what an observer of a search is shown.

Free of the compiler, for those who only handle what a search showed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.planners.stopping import StoppingCriterion

if TYPE_CHECKING:
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True, eq=False)
class ColonySnapshot:
    """The colony after a cohort, or where local search restarts.

    Attributes:
        window: which cells of the lattice ``trail`` spans.
        cell_m: edge of a cell [m].
        trail: float32 (rows, cols): mean pheromone on the moves into a cell; 0 where
            the cell is not coverable.
        cohort: index of the cohort that walked last, from 0.
        velocity: its velocity [cells/step].
        ants: how many ants have walked so far.
        best_steps: steps of the best walk so far.
    """

    window: Window
    cell_m: float
    trail: NDArray[np.float32]
    cohort: int
    velocity: int
    ants: int
    best_steps: int


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
