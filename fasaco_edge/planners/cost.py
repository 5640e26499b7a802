"""What a walk costs, in seconds for steps and quarter-turns, and what work a search for it was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration

if TYPE_CHECKING:
    from typing import Self

MICROSECONDS = 1_000_000
# A step below a millisecond would be rounded away in part; and the cost of a walk of 10^8
# steps of an hour each still fits into 64 bits of microseconds.
SHORTEST_STEP_S, LONGEST_S = 1e-3, 3600.0


class Turns(NamedTuple):
    """How often a walk changes its direction: to a side, and straight back."""

    quarter: int
    half: int


@dataclass(frozen=True, slots=True)
class CoverageCost:
    """Seconds a robot needs for a step and for a quarter-turn; a half turn is two of these.

    Searches compare whole microseconds: sums of them are exact, in whatever order they
    are added, so the same search always finds the same walk. With the default a walk
    costs its steps, and turns are free.

    Attributes:
        step_s: a step to a neighbouring cell [s].
        quarter_turn_s: a turn by 90 degrees on the spot [s].
    """

    step_s: float = 1.0
    quarter_turn_s: float = 0.0

    def __post_init__(self) -> None:
        _require("step_s", self.step_s, SHORTEST_STEP_S, LONGEST_S, "s")
        _require("quarter_turn_s", self.quarter_turn_s, 0.0, LONGEST_S, "s")

    @classmethod
    def for_robot(cls, cell_m: float, speed_m_s: float, quarter_turn_s: float) -> Self:
        """Return the cost for a robot on cells of ``cell_m`` [m] that drives ``speed_m_s`` [m/s].

        Raises:
            BadConfiguration: a value is not finite or impossible, or a step would take less
                than a millisecond or more than an hour.
        """
        _require("cell_m", cell_m, 1e-6, 1e3, "m")
        _require("speed_m_s", speed_m_s, 1e-6, 1e3, "m/s")
        step_s = cell_m / speed_m_s
        _require("cell_m / speed_m_s", step_s, SHORTEST_STEP_S, LONGEST_S, "s")
        return cls(step_s, quarter_turn_s)

    @property
    def step_us(self) -> int:
        """A step in whole microseconds."""
        return round(self.step_s * MICROSECONDS)

    @property
    def quarter_turn_us(self) -> int:
        """A quarter-turn in whole microseconds."""
        return round(self.quarter_turn_s * MICROSECONDS)

    def quality(self, cells: int, cost_us: int) -> float:
        """Return delta phi of equation (8): a step for each of so many cells over the cost [us]."""
        # Whole numbers divided once: for steps alone it is cells / steps to the last bit.
        return cells * self.step_us / max(cost_us, self.step_us)

    def of_walk(self, cells: NDArray[np.int32]) -> float:
        """Return what a walk costs [s].

        The robot is taken to stand in the direction of the first step.

        Args:
            cells: int32 (n, 2), cells (row, col), each a step from the one before.
        """
        return self.of_walk_us(cells) / MICROSECONDS

    def of_walk_us(self, cells: NDArray[np.int32]) -> int:
        """Return what a walk costs in whole microseconds, see ``of_walk``."""
        turns = count_turns(cells)
        steps = max(len(cells) - 1, 0)
        quarters = turns.quarter + 2 * turns.half
        return steps * self.step_us + quarters * self.quarter_turn_us


def count_turns(cells: NDArray[np.int32]) -> Turns:
    """Count the turns of a walk, int32 (n, 2), cells (row, col) each a step from the last."""
    moves = np.diff(cells, axis=0)
    along = (moves[1:] * moves[:-1]).sum(axis=1)
    return Turns(int(np.count_nonzero(along == 0)), int(np.count_nonzero(along < 0)))


def _require(name: str, value: float, least: float, most: float, unit: str) -> None:
    # A negated comparison, so that NaN is caught too.
    if not least <= value <= most:
        raise BadConfiguration(f"{name} must be in [{least:g}, {most:g}] {unit}, got {value!r}")


@dataclass(frozen=True, slots=True)
class SearchWork:
    """Work of a search in counts; with problem, planner and seed they repeat its path.

    The wire contract calls perturbations ``kicks``.

    Attributes:
        ants: ants that walked, and the sweeps that a search begins with.
        perturbations: changes by which a local search left a local optimum, and windows that
            were solved anew.
        proposals: moves that a local search tried.
    """

    ants: int = 0
    perturbations: int = 0
    proposals: int = 0

    def __add__(self, other: SearchWork) -> SearchWork:
        return SearchWork(
            self.ants + other.ants,
            self.perturbations + other.perturbations,
            self.proposals + other.proposals,
        )

    def reaches(self, limit: SearchWork) -> bool:
        """Return whether every count is at least that of ``limit``."""
        return (
            self.ants >= limit.ants
            and self.perturbations >= limit.perturbations
            and self.proposals >= limit.proposals
        )


def gap_to(lower_bound_s: float, cost_s: float) -> float | None:
    """Return ``cost_s / lower_bound_s - 1``; None where the bound is 0, not known.

    One division of whole microseconds: 115 s over a bound of 100 s are 0.15 to the last bit.
    """
    least, cost = round(lower_bound_s * MICROSECONDS), round(cost_s * MICROSECONDS)
    return (cost - least) / least if least > 0 else None


STEPS_ALONE = CoverageCost()
NO_WORK = SearchWork()
