"""Counts of coverage: cells covered and left, and the free area out of reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice, pixels_of, placement_on
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.lattice.pixels import count_free_beside


@dataclass(frozen=True, slots=True)
class Coverage:
    """Counts of cells.

    Attributes:
        coverable: cells that are reachable, or have been since the order began.
        covered: number of these cells that the tool has passed over.
        recovered: number of these cells that it has passed over at least twice.
        unreachable: coverable cells that were never reachable.
        cell_m2: area of a cell [m2].
        free_out_of_reach_m2: free area outside the reachable cells [m2].
    """

    coverable: int
    covered: int
    recovered: int
    unreachable: int
    cell_m2: float
    free_out_of_reach_m2: float = 0.0

    @classmethod
    def of(
        cls,
        lattice: CoverageLattice,
        reachable: NDArray[np.bool_],
        visits: NDArray[np.uint16],
        free_out_of_reach_m2: float = 0.0,
    ) -> Self:
        """Count over ``lattice``; all arrays are (rows, cols)."""
        coverable = lattice.coverable
        return cls(
            coverable=int(np.count_nonzero(reachable)),
            covered=int(np.count_nonzero(reachable & (visits > 0))),
            recovered=int(np.count_nonzero(reachable & (visits > 1))),
            unreachable=int(np.count_nonzero(coverable & ~reachable)),
            cell_m2=lattice.cell_m**2,
            free_out_of_reach_m2=free_out_of_reach_m2,
        )

    @property
    def remaining(self) -> int:
        """Number of cells left to cover, reachable now or before."""
        return self.coverable - self.covered

    @property
    def covered_m2(self) -> float:
        """Area of the covered cells [m2]."""
        return self.covered * self.cell_m2

    @property
    def to_cover_m2(self) -> float:
        """Area of the cells left to cover [m2]."""
        return self.remaining * self.cell_m2

    @property
    def fraction(self) -> float:
        """Covered share of the reachable cells, 0 if there are none."""
        return self.covered / self.coverable if self.coverable else 0.0


class FreeArea:
    """Free area out of reach; cached until map or reachable cells change."""

    def __init__(self, free_at_most: int) -> None:
        self._free_at_most = free_at_most
        # The map's revision, as a reference would keep the map in memory.
        self._counted: tuple[int, NDArray[np.bool_] | None] = (-1, None)
        self._area_m2 = 0.0

    def out_of_reach_m2(
        self,
        grid: OccupancyGrid,
        revision: int,
        lattice: CoverageLattice,
        reachable: NDArray[np.bool_] | None,
    ) -> float:
        """Return the area [m2] of free pixels whose centre lies in no reachable cell.

        Args:
            grid: the map.
            revision: revision of the map.
            lattice: the lattice over it.
            reachable: bool (rows, cols) on the lattice; None while the robot's cell is unknown.
        """
        counted, known = self._counted
        if revision != counted or reachable is not known:
            nowhere = np.zeros(lattice.states.shape, bool)
            raster, _ = grid.geometry.on_raster()
            pixels = count_free_beside(
                pixels_of(grid),
                self._free_at_most,
                placement_on(raster, lattice.cell_m),
                nowhere if reachable is None else reachable,
                lattice.window.row0,
                lattice.window.col0,
            )
            self._area_m2 = pixels * grid.geometry.resolution**2
            self._counted = revision, reachable
        return self._area_m2
