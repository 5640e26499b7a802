"""Ground: the lattice over the newest map, with and without keep-out zones.

If the mission sweeps floor, the lattice is that of stands (``grid.floor_map``); if it counts cells,
as the published planners do, the lattice is that of cell centres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.fine_raster import RobotDiscs, raster_to_map
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Point, Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.orders.zones import kept_out, without

Maps = tuple[OccupancyGrid, OccupancyGrid]


class MissionGround:
    """Lattices and floor, updated with each map.

    Attributes:
        plain: the lattice of cell centres, without keep-out zones.
        free: the lattice without keep-out zones.
        lattice: the lattice with the cells of keep-out zones removed.
        change: change from the previous ``lattice``; None before there is one.
        floor: the floor under ``lattice``; None if cells are counted.
        free_floor: the floor under ``free``.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.free: CoverageLattice | None = None
        self.lattice: CoverageLattice | None = None
        self.change: LatticeChange | None = None
        self.floor: FloorMap | None = None
        self.free_floor: FloorMap | None = None
        self._config = config
        self._keep_out: tuple[Polygon, ...] = ()
        self.plain: CoverageLattice | None = None

    def begin_lattice(self, grid: OccupancyGrid) -> LatticeChange:
        """Take the first map; return its lattice of cell centres.

        Raises:
            MapTooLarge, MapTooFar: see ``LatticeChange.first`` and ``FloorMap``.
        """
        change = LatticeChange.first(grid, self._config.footprint, self._config.max_lattice_cells)
        free_floor = self._floor_of(grid, change.after)
        self.plain, self.free_floor = change.after, free_floor
        self._set_free(change if free_floor is None else None, grid)
        return change

    def follow_map(self, maps: Maps, within: Window | None) -> LatticeChange:
        """Update to the next map; return the change of the lattice of cell centres.

        Args:
            maps: the previous map and the new one.
            within: window of the pixels that may differ, see ``LatticeChange.between``.

        Raises:
            MapTooLarge, MapTooFar: see ``begin_lattice``.
        """
        assert self.plain is not None
        footprint, most = self._config.footprint, self._config.max_lattice_cells
        plain = LatticeChange.between(maps, self.plain, footprint, most, within)
        if self.free_floor is None:
            self.plain = plain.after
            if plain.after is not self.free:
                self._set_free(plain, maps[1])
            return plain
        change = self.free_floor.change(maps, plain.after, within)
        self.plain, self.free = plain.after, change.after
        if self.floor is not self.free_floor and self.floor is not None:
            change = self.floor.change(maps, plain.after, within)
        if change.after is not self.lattice:
            self.change, self.lattice = change, change.after
        return plain

    def keep_out(self, polygons: tuple[Polygon, ...], grid: OccupancyGrid | None) -> None:
        """Replace the keep-out polygons (x, y) [m]."""
        is_other, self._keep_out = polygons != self._keep_out, polygons
        if grid is not None and (is_other or self.free_floor is None):
            self._set_free(None, grid)

    def is_decided(self, window: Window) -> NDArray[np.bool_] | None:
        """Return the cells for which the map shows whether the robot fits at the centre.

        Stands of other cells lie at the border of the known map, and will soon move.

        Returns:
            bool (rows, cols) of the window; None if cells are counted, or the window is another.
        """
        plain = self.plain
        if self.floor is None or plain is None or plain.window != window:
            return None
        decided: NDArray[np.bool_] = plain.states != UNKNOWN
        return decided

    def place_of(self, cell: Cell) -> Point | None:
        """Return the robot's position for a cell, x, y [m]; None if the robot does not fit."""
        floor = self.floor
        if floor is None:
            cell_m = self._config.footprint.cell_m
            return (cell[1] + 0.5) * cell_m, (cell[0] + 0.5) * cell_m
        return floor.stand_xy(cell)

    def places_of(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the robot's positions x, y [m], float64 (n, 2), for cells, int32 (n, 2).

        NaN where the robot does not fit.
        """
        if self.floor is None:
            assert self.lattice is not None
            return self.lattice.centres(cells)
        return raster_to_map(self.floor.geometry, self.floor.stands.stands_of(cells))

    def _set_free(self, change: LatticeChange | None, grid: OccupancyGrid) -> None:
        """Take over the changed lattice of cell centres, or the lattice of a new floor."""
        before, free = self.lattice, self.free_floor
        if free is None:
            assert self.plain is not None
            self.free, self.lattice = self.plain, self._without_kept_out(self.plain)
            if change is not None:
                self.change = LatticeChange(before, self.lattice, change.cells)
            return
        self.floor = free
        if self._keep_out:
            assert self.plain is not None
            self.floor = self._floor_of(grid, self.plain, self._keep_out)
            assert self.floor is not None
        self.free, self.lattice = free.stands.lattice, self.floor.stands.lattice

    def _floor_of(
        self, grid: OccupancyGrid, plain: CoverageLattice, keep_out: tuple[Polygon, ...] = ()
    ) -> FloorMap | None:
        sweeping, footprint = self._config.sweeping, self._config.footprint
        if sweeping is None:
            return None
        discs = RobotDiscs(
            footprint.robot_radius_m, sweeping.tool_m, footprint.free_at_most, sweeping.clearance_m
        )
        return FloorMap(grid, plain, footprint, discs, sweeping.most_pixels, keep_out)

    def _without_kept_out(self, free: CoverageLattice) -> CoverageLattice:
        if not self._keep_out:
            return free
        radius_m = self._config.footprint.robot_radius_m
        return without(free, kept_out(self._keep_out, free.window, free.cell_m, radius_m))
