"""Cost of a walk, in seconds for steps and quarter-turns; and counts of a search's work.

A search may add a price to each step across preferred lanes, and to each step into another room.
Walks then cost more than their seconds; ``without_prices`` is the cost in seconds alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration

if TYPE_CHECKING:
    from typing import Self

MICROSECONDS = 1_000_000
# Limits on times. Whole microseconds are too coarse for shorter steps; the cost of 10^8 steps of
# LONGEST_S fits into 64 bits.
SHORTEST_STEP_S, LONGEST_S = 1e-3, 3600.0

# Lanes along the rows of the lattice, along its columns, or in any direction.
Lanes = Literal["", "rows", "columns"]
ANY_LANES: Lanes = ""
ROWS: Lanes = "rows"
COLUMNS: Lanes = "columns"
# Price of a step across the lanes, as a share of the time of a step and a quarter-turn.
PRICE_ACROSS = 0.6


class Turns(NamedTuple):
    """Counts of a walk's changes of direction: quarter-turns, and reversals."""

    quarter: int
    half: int


@dataclass(frozen=True, slots=True)
class CoverageCost:
    """Seconds a robot needs for a step and for a quarter-turn; a half turn is two of the latter.

    Searches compare whole microseconds, whose sums are exact in any order, so the same search
    always finds the same walk. By default only steps cost.

    Attributes:
        step_s: a step to a neighbouring cell [s].
        quarter_turn_s: a turn by 90 degrees on the spot [s].
        room_s: added to a step into another room [s].
        row_s: added to a step along a row [s]; lanes along columns are then preferred.
        col_s: added to a step along a column [s]; lanes along rows are then preferred.
    """

    step_s: float = 1.0
    quarter_turn_s: float = 0.0
    row_s: float = 0.0
    col_s: float = 0.0
    room_s: float = 0.0

    def __post_init__(self) -> None:
        _require("step_s", self.step_s, SHORTEST_STEP_S, LONGEST_S, "s")
        _require("quarter_turn_s", self.quarter_turn_s, 0.0, LONGEST_S, "s")
        _require("row_s", self.row_s, 0.0, 2 * LONGEST_S, "s")
        _require("col_s", self.col_s, 0.0, 2 * LONGEST_S, "s")
        _require("room_s", self.room_s, 0.0, 100 * LONGEST_S, "s")

    @classmethod
    def for_robot(cls, cell_m: float, speed_m_s: float, quarter_turn_s: float) -> Self:
        """Return the cost for cells of ``cell_m`` [m] and a speed of ``speed_m_s`` [m/s].

        Raises:
            BadConfiguration: a value is not finite or impossible, or a step would take less
                than a millisecond or more than an hour.
        """
        _require("cell_m", cell_m, 1e-6, 1e3, "m")
        _require("speed_m_s", speed_m_s, 1e-6, 1e3, "m/s")
        step_s = cell_m / speed_m_s
        _require("cell_m / speed_m_s", step_s, SHORTEST_STEP_S, LONGEST_S, "s")
        return cls(step_s, quarter_turn_s)

    def paced(self, step_s: float) -> Self:
        """Return this cost with steps of ``step_s`` [s], or of the nearest allowed duration."""
        return replace(self, step_s=min(max(step_s, SHORTEST_STEP_S), LONGEST_S))

    def along(self, lanes: Lanes) -> Self:
        """Return this cost with a preference for lanes in a direction."""
        across_s = PRICE_ACROSS * (self.step_s + self.quarter_turn_s)
        row_s, col_s = across_s * (lanes == COLUMNS), across_s * (lanes == ROWS)
        return replace(self, row_s=row_s, col_s=col_s)

    @property
    def without_prices(self) -> Self:
        """This cost without a preference for lanes, or for rooms."""
        return replace(self.along(ANY_LANES), room_s=0.0)

    @property
    def has_lanes(self) -> bool:
        """Whether lanes in one direction are preferred."""
        return self.row_s != self.col_s

    @property
    def is_priced(self) -> bool:
        """Whether some steps cost more than their seconds."""
        return self.has_lanes or self.room_s > 0.0

    @property
    def room_us(self) -> int:
        """Price added to a step into another room, in whole microseconds."""
        return round(self.room_s * MICROSECONDS)

    @property
    def step_us(self) -> int:
        """Cost of a step in whole microseconds."""
        return round(self.step_s * MICROSECONDS)

    @property
    def quarter_turn_us(self) -> int:
        """Cost of a quarter-turn in whole microseconds."""
        return round(self.quarter_turn_s * MICROSECONDS)

    @property
    def row_us(self) -> int:
        """Price added to a step along a row, in whole microseconds."""
        return round(self.row_s * MICROSECONDS)

    @property
    def col_us(self) -> int:
        """Price added to a step along a column, in whole microseconds."""
        return round(self.col_s * MICROSECONDS)

    def quality(self, cells: int, cost_us: int) -> float:
        """Return delta phi of equation (8), Carr and Wang 2022; 1 for a walk of one step per cell.

        Args:
            cells: number of cells that the walk covers.
            cost_us: cost of the walk [us].
        """
        # Whole numbers are divided, so for steps alone the result equals cells / steps bit for bit.
        return cells * self.step_us / max(cost_us, self.step_us)

    def of_walk(self, cells: NDArray[np.int32]) -> float:
        """Return the cost of a walk [s].

        The robot is assumed to face the direction of the first step.

        Args:
            cells: int32 (n, 2), cells (row, col), each a step from the previous one.
        """
        return self.of_walk_us(cells) / MICROSECONDS

    def of_walk_us(self, cells: NDArray[np.int32]) -> int:
        """Return the cost of a walk in whole microseconds, see ``of_walk``."""
        turns = count_turns(cells)
        steps = max(len(cells) - 1, 0)
        quarters = turns.quarter + 2 * turns.half
        added_us = 0
        if self.has_lanes:
            in_rows = steps_in_rows(cells)
            added_us = in_rows * self.row_us + (steps - in_rows) * self.col_us
        return steps * self.step_us + quarters * self.quarter_turn_us + added_us


def count_turns(cells: NDArray[np.int32]) -> Turns:
    """Count the turns of a walk, int32 (n, 2), cells (row, col) joined by steps."""
    # Column by column: numpy takes several times as long over rows of two.
    up, right = np.diff(cells[:, 0]), np.diff(cells[:, 1])
    along = up[1:] * up[:-1] + right[1:] * right[:-1]
    return Turns(int(np.count_nonzero(along == 0)), int(np.count_nonzero(along < 0)))


def steps_in_rows(cells: NDArray[np.int32]) -> int:
    """Count the steps along rows of a walk, int32 (n, 2), cells (row, col) joined by steps."""
    return int(np.count_nonzero(np.diff(cells[:, 1])))


def _require(name: str, value: float, least: float, most: float, unit: str) -> None:
    # A negated comparison, so that NaN is caught too.
    if not least <= value <= most:
        text = f"must be in [{least:g}, {most:g}] {unit}, got {value!r}"
        raise BadConfiguration(text, key=name)


@dataclass(frozen=True, slots=True)
class SearchWork:
    """Work of a search as counts; with problem, planner and seed they reproduce its path.

    The wire contract calls perturbations ``kicks``.

    Attributes:
        ants: number of ants that walked, including the first walks of a search.
        perturbations: changes by which a local search left a local optimum, and windows that
            were solved again.
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
    """Return the optimality gap ``cost_s / lower_bound_s - 1``; None for a bound of 0 (unknown).

    Whole microseconds are divided, so 115 s over a bound of 100 s give 0.15 bit for bit.
    """
    least, cost = round(lower_bound_s * MICROSECONDS), round(cost_s * MICROSECONDS)
    return (cost - least) / least if least > 0 else None


STEPS_ALONE = CoverageCost()
NO_WORK = SearchWork()
