"""What a map knows to be free and the robot's cells leave out: beside walls, behind doors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried, regions_to_compare
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice, pixels_of, placement_on
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.changes import Box
from fasaco_edge.kernels.footprint import Pixels
from fasaco_edge.kernels.free_pixels import tally_free

NOTHING = np.empty((0, 0), np.int8)
NOTHING.flags.writeable = False  # as maps are: numba compiles for that apart
NOWHERE = Window(0, 0, 0, 0)


class FreeArea:
    """Counts the free pixels of each lattice cell, of a new map only those that changed."""

    def __init__(self, free_at_most: int) -> None:
        self._free_at_most = free_at_most
        self._grid: OccupancyGrid | None = None
        self._window = NOWHERE
        self._counts = np.zeros((0, 0), np.int32)
        self._answered: tuple[NDArray[np.bool_] | None, float] | None = None

    def out_of_reach_m2(
        self, grid: OccupancyGrid, lattice: CoverageLattice, reachable: NDArray[np.bool_] | None
    ) -> float:
        """Return the area [m2] of free pixels whose centre lies in no reachable cell.

        Args:
            grid: the map.
            lattice: the lattice over it.
            reachable: bool (rows, cols) on the lattice; None where the robot has no place yet.
        """
        if self._grid is not grid:
            self._count(grid, lattice)
        elif self._answered is not None and self._answered[0] is reachable:
            return self._answered[1]
        pixels = int(self._counts.sum())
        if reachable is not None:
            pixels -= int(self._counts.sum(where=reachable))
        area = pixels * grid.geometry.resolution**2
        self._answered = reachable, area
        return area

    def _count(self, grid: OccupancyGrid, lattice: CoverageLattice) -> None:
        raster, shown = grid.geometry.on_raster()
        placement = placement_on(raster, lattice.cell_m)
        regions: tuple[Window, ...] | None = None
        if self._grid is not None:
            old, counts = pixels_of(self._grid), carried(self._counts, self._window, lattice.window)
            regions = regions_to_compare(self._grid, grid, lattice.window, placement)
        if regions is None:
            old, counts = Pixels(NOTHING, 0, 0), np.zeros(lattice.states.shape, np.int32)
            regions = (shown,)
        for region in regions:
            tally_free(
                old,
                pixels_of(grid),
                Box(region.row0, region.col0, region.row1, region.col1),
                self._free_at_most,
                placement,
                counts,
                lattice.window.row0,
                lattice.window.col0,
            )
        self._grid, self._window, self._counts = grid, lattice.window, counts
