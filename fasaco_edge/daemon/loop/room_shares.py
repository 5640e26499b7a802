"""Swept share of the floor of each room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.rooms.room_raster import RoomRaster

if TYPE_CHECKING:
    from fasaco_edge.grid.geometry import GridGeometry
    from fasaco_edge.mission.core.mission import Mission

# Limit on the squares of floor that are counted: it bounds the time that counting takes.
MOST_SQUARES = 250_000


class RoomShares:
    """Counts the squares of floor by room; the rooms of all squares are cached."""

    def __init__(self) -> None:
        self._read_of: tuple[RoomRaster, GridGeometry] | None = None
        self._rooms = np.zeros((0, 0), np.uint16)

    def of(self, mission: Mission) -> dict[int, float]:
        """Return the swept share of the floor in reach in each room, by the room's number.

        The share is of the whole room, whatever the order asks for there. Rooms without such floor
        are left out; so are all rooms if only cells are counted, and in a fleet, as the floor that
        others sweep is unknown.
        """
        sheet, floor = mission.rooms.sheet, mission.line.floor_in_reach(MOST_SQUARES)
        if sheet is None or floor is None or mission.company.has_members:
            return {}
        squares, within, swept = floor
        rooms = self._on(sheet.raster, mission.rotation.geometry(squares))
        count = np.bincount(rooms[within]).tolist()
        done = np.bincount(rooms[swept], minlength=len(count)).tolist()
        return {room: done[room] / count[room] for room in range(1, len(count)) if count[room]}

    def _on(self, raster: RoomRaster, squares: GridGeometry) -> NDArray[np.uint16]:
        """Return the room of each square, uint16 (rows, cols), 0 for none."""
        known = self._read_of
        if known is None or known[0] is not raster or known[1] != squares:
            rows, cols = np.mgrid[0.5 : squares.rows, 0.5 : squares.cols]
            x, y = squares.to_map(cols.ravel(), rows.ravel())
            self._read_of = raster, squares
            self._rooms = raster.at(np.column_stack((x, y))).reshape(squares.rows, squares.cols)
        return self._rooms
