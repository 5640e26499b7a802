"""How far a mission is: its state, its coverage, its place on the path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice

# The robot is looked for this many cells ahead on its path; further on, the
# path may come back to the same cell for another reason.
LOOK_AHEAD = 16
FAR_CELLS = 4


class State(StrEnum):
    """What the mission is doing."""

    WAITING_FOR_MAP = "waiting for map"
    WAITING_FOR_POSE = "waiting for pose"
    PLANNING = "planning"
    COVERING = "covering"
    BLOCKED = "blocked"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Coverage:
    """Counts of cells; ``coverable`` counts what the robot can reach.

    Attributes:
        coverable: cells that are coverable and reachable.
        covered: those of them that the tool has passed over.
        recovered: those it has passed over at least twice.
        unreachable: cells where the robot would fit but cannot come to.
        cell_m2: area of a cell [m2].
    """

    coverable: int
    covered: int
    recovered: int
    unreachable: int
    cell_m2: float

    @classmethod
    def of(
        cls,
        lattice: CoverageLattice,
        reachable: NDArray[np.bool_] | None,
        visits: NDArray[np.uint16],
    ) -> Self:
        """Count over ``lattice``; all arrays are (rows, cols)."""
        coverable = lattice.coverable
        if reachable is None:
            reachable = np.zeros_like(coverable)
        return cls(
            coverable=int(np.count_nonzero(reachable)),
            covered=int(np.count_nonzero(reachable & (visits > 0))),
            recovered=int(np.count_nonzero(reachable & (visits > 1))),
            unreachable=int(np.count_nonzero(coverable & ~reachable)),
            cell_m2=lattice.cell_m**2,
        )

    @property
    def remaining(self) -> int:
        """Reachable cells still to be covered."""
        return self.coverable - self.covered

    @property
    def fraction(self) -> float:
        """Covered share of the reachable cells, 0 where there are none."""
        return self.covered / self.coverable if self.coverable else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPath:
    """The published path and how far the robot has come on it.

    Attributes:
        cells: int32 (n, 2).
        index: the cell of the path the robot was last seen in.
    """

    cells: NDArray[np.int32]
    index: int = 0

    @classmethod
    def none(cls) -> Self:
        """Return the path of a robot that has nothing to do."""
        return cls(np.empty((0, 2), np.int32))

    @property
    def ahead(self) -> NDArray[np.int32]:
        """The cells from the robot's on, int32 (m, 2)."""
        return self.cells[self.index :]

    @property
    def finished(self) -> bool:
        """Whether the robot is at the end."""
        return self.index >= len(self.cells) - 1

    def driven_to(self, cell: Cell) -> DrivenPath:
        """Return the path with the robot in ``cell``, if that is a little way ahead."""
        near = self.cells[self.index : self.index + LOOK_AHEAD]
        hits = np.flatnonzero((near == cell).all(axis=1))
        return replace(self, index=self.index + int(hits[0])) if len(hits) else self

    def is_far(self, cell: Cell) -> bool:
        """Tell whether ``cell`` is too far from the robot's place on the path."""
        if not len(self.cells):
            return False
        row, col = self.cells[self.index]
        return bool(abs(int(row) - cell[0]) + abs(int(col) - cell[1]) > FAR_CELLS)
