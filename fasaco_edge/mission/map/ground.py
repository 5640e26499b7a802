"""The ground: the lattice over the newest map, with the keep-out zones and without.

A robot that sweeps floor plans on a lattice of stands, see ``grid.floor_map``; one that counts
cells, as the planners were published, on the centres of cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Point, Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.orders.zones import kept_out, without

Maps = tuple[OccupancyGrid, OccupancyGrid]


class Ground:
    """Follows the newest map.

    Attributes:
        free: the lattice over it.
        lattice: the same without the cells the robot must keep out of.
        change: how ``lattice`` came from the one before; None before there is one.
        floor: the floor of ``lattice``; None for one of centres.
        free_floor: that of ``free``.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.free: CoverageLattice | None = None
        self.lattice: CoverageLattice | None = None
        self.change: LatticeChange | None = None
        self.floor: FloorMap | None = None
        self.free_floor: FloorMap | None = None
        self._config = config
        self._keep_out: tuple[Polygon, ...] = ()
        # Over centres.
        self._plain: CoverageLattice | None = None

    def begin(self, grid: OccupancyGrid) -> LatticeChange:
        """Take the first map; return what it shows, of centres.

        Raises:
            MapTooLarge, MapTooFar: see ``LatticeChange.first`` and ``FloorMap``.
        """
        change = LatticeChange.first(grid, self._config.footprint, self._config.max_lattice_cells)
        free_floor = self._floor_of(grid, change.after)
        self._plain, self.free_floor = change.after, free_floor
        self._set_free(change if free_floor is None else None, grid)
        return change

    def follow(self, maps: Maps, within: Window | None) -> LatticeChange:
        """Follow from one map to the next; return what has changed, of centres.

        Args:
            maps: the map before and the new one.
            within: which pixels may differ, see ``LatticeChange.between``.

        Raises:
            MapTooLarge, MapTooFar: see there.
        """
        assert self._plain is not None
        footprint, most = self._config.footprint, self._config.max_lattice_cells
        plain = LatticeChange.between(maps, self._plain, footprint, most, within)
        if self.free_floor is None:
            self._plain = plain.after
            if plain.after is not self.free:
                self._set_free(plain, maps[1])
            return plain
        change = self.free_floor.change(maps, plain.after, within)
        self._plain, self.free = plain.after, change.after
        if self.floor is not self.free_floor and self.floor is not None:
            change = self.floor.change(maps, plain.after, within)
        if change.after is not self.lattice:
            self.change, self.lattice = change, change.after
        return plain

    def keep_out(self, polygons: tuple[Polygon, ...], grid: OccupancyGrid | None) -> None:
        """Keep out of these polygons (x, y) [m] from now on, and of no others."""
        is_other, self._keep_out = polygons != self._keep_out, polygons
        if grid is not None and (is_other or self.free_floor is None):
            self._set_free(None, grid)

    def is_decided(self, window: Window) -> NDArray[np.bool_] | None:
        """Return for which cells of a window the map shows whether the robot fits at the middle.

        Where it does not show that yet, the robot's stand is as far as the map is known, and will
        be elsewhere soon.

        Returns:
            bool (rows, cols); None where cells are counted, or another window is known.
        """
        plain = self._plain
        if self.floor is None or plain is None or plain.window != window:
            return None
        decided: NDArray[np.bool_] = plain.states != UNKNOWN
        return decided

    def place_of(self, cell: Cell) -> Point | None:
        """Return where the robot should be in a cell, x, y [m]; None for nowhere."""
        floor = self.floor
        if floor is None:
            cell_m = self._config.footprint.cell_m
            return (cell[1] + 0.5) * cell_m, (cell[0] + 0.5) * cell_m
        return floor.stand_xy(cell)

    def _set_free(self, change: LatticeChange | None, grid: OccupancyGrid) -> None:
        """Take the lattice from the change of a plain one, or from a floor seen for the first time.

        A lattice without the same cells as before has changed in no others.
        """
        before, free = self.lattice, self.free_floor
        if free is None:
            assert self._plain is not None
            self.free, self.lattice = self._plain, self._without_kept_out(self._plain)
            if change is not None:
                self.change = LatticeChange(before, self.lattice, change.cells)
            return
        self.floor = free
        if self._keep_out:
            assert self._plain is not None
            self.floor = free.keeping_out(self._keep_out, grid, self._plain)
        self.free, self.lattice = free.stands.lattice, self.floor.stands.lattice

    def _floor_of(self, grid: OccupancyGrid, plain: CoverageLattice) -> FloorMap | None:
        sweeping, footprint = self._config.sweeping, self._config.footprint
        if sweeping is None:
            return None
        discs = RobotDiscs(footprint.robot_radius_m, sweeping.tool_m, footprint.free_at_most)
        return FloorMap(grid, plain, footprint, discs, sweeping.most_pixels)

    def _without_kept_out(self, free: CoverageLattice) -> CoverageLattice:
        if not self._keep_out:
            return free
        radius_m = self._config.footprint.robot_radius_m
        return without(free, kept_out(self._keep_out, free.window, free.cell_m, radius_m))
