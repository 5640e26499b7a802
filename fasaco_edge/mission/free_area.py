"""What a map knows to be free and the robot's cells leave out: beside walls, behind doors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice, pixels_of, placement_on
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.free_pixels import count_free_beside


class FreeArea:
    """Counts free pixels, anew where the map or what can be reached has changed."""

    def __init__(self, free_at_most: int) -> None:
        self._free_at_most = free_at_most
        # Of which map and reach the count is, not the map itself: that would outlive its time.
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
            revision: which map it is.
            lattice: the lattice over it.
            reachable: bool (rows, cols) on the lattice; None where the robot has no place yet.
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
