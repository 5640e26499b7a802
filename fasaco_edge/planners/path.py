"""A coverage path and its figures of merit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.lattice.reach import shortest_walk
from fasaco_edge.planners.cost import MICROSECONDS, NO_WORK, SearchWork, count_turns, gap_to
from fasaco_edge.planners.living_trail import TrailSnapshot

# Number of rows that ``common_beginning`` compares first.
FIRST_PIECE = 256


class Saved(NamedTuple):
    """Savings of a search against its first walk [s].

    Attributes:
        ants: by ants, including local search on their walks.
        local_search: by local search on the first walk, or on the rest of the previous walk.
        by_velocity: ``ants`` by cohort: the velocity of each, and its savings.
    """

    ants: float = 0.0
    local_search: float = 0.0
    by_velocity: tuple[tuple[int, float], ...] = ()

    @classmethod
    def of(cls, saved_us: int, velocities: NDArray[np.int64], ants_us: NDArray[np.int64]) -> Saved:
        """Return the savings of a search in which ants have rebuilt discs.

        Args:
            saved_us: time that the whole search saved [us].
            velocities: int64 (cohorts,).
            ants_us: savings of each cohort [us], int64 (cohorts,).
        """
        each = zip(velocities.tolist(), (ants_us / MICROSECONDS).tolist(), strict=True)
        by_velocity = tuple((velocity, saved) for velocity, saved in each if saved > 0.0)
        ants = float(ants_us.sum()) / MICROSECONDS
        return cls(ants, saved_us / MICROSECONDS - ants, by_velocity)


NOTHING_SAVED = Saved()


@dataclass(frozen=True, slots=True, eq=False)
class CoveragePath:
    """A walk over the lattice: each step leads to one of the four neighbours.

    Attributes:
        cells: int32 (n, 2), read-only: cells (row, col) in order, the start first.
        planner: name of the planner.
        seed: seed of the planner.
        work: work of the search; with planner, seed and problem it reproduces the path.
        cost_s: cost by the problem's prices [s].
        lower_bound_steps: lower bound on the steps of any walk that solves the problem; 0 if
            unknown.
        lower_bound_cost_s: lower bound on the cost [s]; 0 if unknown.
        saved: savings of ants and of local search against the first walk.
        trail: pheromone where ants have walked; None if no ant has walked.
        first_walk_s: measured time to the first complete walk [s]; no rerun reproduces it.
    """

    cells: NDArray[np.int32]
    planner: str
    seed: int
    work: SearchWork = NO_WORK
    cost_s: float = 0.0
    lower_bound_steps: int = 0
    lower_bound_cost_s: float = 0.0
    first_walk_s: float = 0.0
    saved: Saved = NOTHING_SAVED
    trail: TrailSnapshot | None = None

    def __post_init__(self) -> None:
        self.cells.flags.writeable = False

    @property
    def steps(self) -> int:
        """Number of steps."""
        return max(len(self.cells) - 1, 0)

    @property
    def gap(self) -> float | None:
        """Optimality gap (``cost / bound - 1``); None without a bound."""
        return gap_to(self.lower_bound_cost_s, self.cost_s)


@dataclass(frozen=True, slots=True)
class WalkFigures:
    """Figures of merit of a walk.

    Attributes:
        cells: distinct cells on the walk.
        steps: steps, each to a neighbouring cell.
        revisits: ``steps + 1 - cells``, visits beyond each cell's first.
        recovered_cells: distinct cells visited at least twice (the definition in the paper's text).
        n_r_paper: revisits of the walk with the shortest path home, for comparison with Table I.
        turns_90: quarter-turns between two steps.
        turns_180: reversals.
    """

    cells: int
    steps: int
    revisits: int
    recovered_cells: int
    n_r_paper: int
    turns_90: int
    turns_180: int


def walk_figures(lattice: CoverageLattice, cells: NDArray[np.int32]) -> WalkFigures:
    """Return the figures of a walk, int32 (n, 2) with n >= 1, over ``lattice``."""
    visits = np.unique(cells, axis=0, return_counts=True)[1]
    steps = len(cells) - 1
    turns = count_turns(cells)
    # Plain integers: numpy's would compile a second variant of the kernel.
    (first_row, first_col), (last_row, last_col) = cells[0].tolist(), cells[-1].tolist()
    last, first = lattice.local((last_row, last_col)), lattice.local((first_row, first_col))
    way_home = len(shortest_walk(lattice.steps, last, first)) - 1
    revisits = steps + 1 - len(visits)
    return WalkFigures(
        cells=len(visits),
        steps=steps,
        revisits=revisits,
        recovered_cells=int(np.count_nonzero(visits > 1)),
        n_r_paper=revisits + way_home,
        turns_90=turns.quarter,
        turns_180=turns.half,
    )


def common_beginning(first: NDArray[np.generic], second: NDArray[np.generic]) -> int:
    """Return the length of the common prefix of two arrays (n, 2) and (m, 2), in rows."""
    count = min(len(first), len(second))
    # Piece by piece: most walks differ early, or not at all.
    begin, piece = 0, FIRST_PIECE
    while begin < count:
        end = min(begin + piece, count)
        differ = first[begin:end] != second[begin:end]
        if differ.any():
            return begin + int(np.argmax(differ)) // 2
        begin, piece = end, 4 * piece
    return count
