"""Rooms on the lattice: the room of each cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.rotation import rotated_points
from fasaco_edge.mission.coverage.floor_tiles import centres
from fasaco_edge.mission.rooms.room_raster import BLOCK, NOWHERE, RoomRaster
from fasaco_edge.mission.rooms.room_watch import RoomWatch


class RoomCells:
    """Finds the rooms of cells by their centres.

    Args:
        watch: the rooms, in the map frame.
        lattice_deg: angle of the cells' rows to the map's x axis [deg].
    """

    def __init__(self, watch: RoomWatch, lattice_deg: float) -> None:
        self._watch, self._lattice_deg = watch, lattice_deg
        # Cached: a raster and a window, and the rooms of the window's cells.
        self._raster, self._window = RoomRaster.empty(1.0), NOWHERE
        self._rooms = np.zeros((0, 0), np.uint16)

    def on(self, lattice: CoverageLattice) -> NDArray[np.uint16] | None:
        """Return the room of each cell of a lattice, uint16 (rows, cols), 0 for none.

        None while no room is known.
        """
        sheet = self._watch.book.sheet
        if sheet is None or not sheet.rooms:
            return None
        if sheet.raster is not self._raster or lattice.window != self._window:
            self._raster, self._window = sheet.raster, lattice.window
            self._rooms = self._read(lattice.window, lattice.cell_m)
        return self._rooms

    def _read(self, window: Window, cell_m: float) -> NDArray[np.uint16]:
        rooms = np.zeros((window.rows, window.cols), np.uint16)
        for part in window.strips(BLOCK):
            places = centres(part, cell_m)
            places = rotated_points(places, self._lattice_deg) if self._lattice_deg else places
            found = self._raster.at(places).reshape(part.rows, part.cols)
            rooms[part.slices_in(window)] = found
        return rooms
