"""A coverage path and the figures it is judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.walks import shortest_walk


@dataclass(frozen=True, slots=True, eq=False)
class CoveragePath:
    """A walk over the lattice: each step leads to one of the four neighbours.

    Attributes:
        cells: int32 (n, 2), read-only: cells (row, col) in order, the start first.
        planner: name of the planner.
        seed: seed it was run with.
        ants: how many ants walked for it; with seed and problem this repeats the path.
    """

    cells: NDArray[np.int32]
    planner: str
    seed: int
    ants: int = 0

    def __post_init__(self) -> None:
        self.cells.flags.writeable = False

    @property
    def steps(self) -> int:
        """Number of steps."""
        return max(len(self.cells) - 1, 0)


@dataclass(frozen=True, slots=True)
class WalkFigures:
    """How good a walk is.

    Attributes:
        cells: distinct cells on the walk.
        steps: steps, each to a neighbouring cell.
        revisits: ``steps + 1 - cells``, visits beyond each cell's first.
        recovered_cells: distinct cells visited at least twice (what the paper's text defines).
        n_r_paper: revisits of the walk closed by the shortest way home, the nearest to
            what Table I counts (entries less distinct cells, start to start); for
            comparison with that table only.
        turns_90: quarter-turns between two steps.
        turns_180: steps straight back.
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
    moves = np.diff(cells, axis=0)
    along = (moves[1:] * moves[:-1]).sum(axis=1)
    # Plain integers, or the kernel is compiled a second time for numpy's.
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
        turns_90=int(np.count_nonzero(along == 0)),
        turns_180=int(np.count_nonzero(along < 0)),
    )
