"""What a coverage planner is asked, and how a walk answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import NothingToCover, StartBlocked, StartOutsideMap
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.kernels.walks import reachable_from


@dataclass(frozen=True, slots=True, eq=False)
class CoverageProblem:
    """Cover every cell of ``to_cover`` by a walk over the lattice that begins at ``start``.

    Attributes:
        lattice: where the robot can be, and which steps it can make.
        start: the cell (row, col) the walk begins in.
        to_cover: bool (rows, cols), read-only: coverable cells that are reachable from
            the start and still to be covered.
        unreachable: bool (rows, cols), read-only: coverable cells that are asked for but
            cannot be reached; reported, never attempted.
        return_home: whether the walk ends where it began.
    """

    lattice: CoverageLattice
    start: Cell
    to_cover: NDArray[np.bool_]
    unreachable: NDArray[np.bool_]
    return_home: bool = False

    @classmethod
    def of(
        cls,
        lattice: CoverageLattice,
        start: Cell,
        *,
        covered: NDArray[np.bool_] | None = None,
        return_home: bool = False,
    ) -> CoverageProblem:
        """Pose the problem of covering what is reachable and not yet ``covered``.

        Args:
            lattice: the planning grid.
            start: cell (row, col).
            covered: bool (rows, cols), cells that need no visit; None for none.
            return_home: end the walk at the start.

        Raises:
            StartOutsideMap: the lattice does not span the start.
            StartBlocked: the robot does not fit there, or the place is unknown.
            NothingToCover: no cell is left to cover.
        """
        _check_start(lattice, start)
        wanted = lattice.coverable if covered is None else lattice.coverable & ~covered
        reachable = reachable_from(lattice.steps, *lattice.local(start)).astype(bool)
        to_cover, unreachable = wanted & reachable, wanted & ~reachable
        if not to_cover.any():
            raise NothingToCover("every reachable cell is covered")
        to_cover.flags.writeable = unreachable.flags.writeable = False
        return cls(lattice, start, to_cover, unreachable, return_home)

    @property
    def cells(self) -> int:
        """Number of cells to cover."""
        return int(np.count_nonzero(self.to_cover))


def _check_start(lattice: CoverageLattice, start: Cell) -> None:
    window = lattice.window
    if not lattice.contains(start):
        raise StartOutsideMap(
            f"start cell {start} lies outside rows {window.row0}..{window.row1 - 1}, "
            f"columns {window.col0}..{window.col1 - 1}"
        )
    state = lattice.states[lattice.local(start)]
    if state != COVERABLE:
        why = "is unknown" if state == UNKNOWN else "is blocked: the robot does not fit there"
        raise StartBlocked(f"start cell {start} {why}")
