"""Room in turn: the room that is finished before other floor is planned (``by_room: always``)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.kernels.lattice.reach import ways_from
from fasaco_edge.mission.rooms.room_cells import RoomCells

NONE = -1


class RoomInTurn:
    """Chooses a room: the robot's own, or else the nearest room with floor left.

    The room stays chosen until none of its floor is left, or until the robot turns out to be in a
    new room: rooms are known only some time after they were seen. Floor in no room is room 0.

    Args:
        cells: the room of each cell.
        applies: whether rooms are finished one by one now.
    """

    def __init__(self, cells: RoomCells, applies: Callable[[], bool]) -> None:
        self._cells, self._applies = cells, applies
        self._room = NONE
        # Rooms with cells that were tried in vain: they come after all others.
        self._given_up: set[int] = set()
        # The rooms of cells at the last choice, and the highest number so far.
        self._seen: NDArray[np.uint16] | None = None
        self._newest = 0

    @property
    def is_chosen(self) -> bool:
        """Whether a room is planned alone."""
        return self._room != NONE

    def begin_pass(self) -> None:
        """Forget the room, and which rooms were tried in vain: the robot may be anywhere now."""
        self._room, self._newest = NONE, 0
        self._given_up.clear()

    def give_up(self) -> bool:
        """Leave the rest of the room until all others are done; return False without a room."""
        given_up, self._room = self._room, NONE
        self._given_up.add(given_up)
        return given_up != NONE

    def first(self, cells: NDArray[np.bool_], lattice: CoverageLattice) -> NDArray[np.bool_]:
        """Return which of some cells, bool (rows, cols) of a lattice, are planned now."""
        rooms = None if self._room == NONE else self._on(lattice)
        return cells if rooms is None else cells & (rooms == self._room)

    def is_due(self, lattice: CoverageLattice) -> bool:
        """Return whether rooms have changed since the last choice."""
        return self._on(lattice) is not self._seen

    def choose(self, cells: NDArray[np.bool_], area: ReachableArea, cell: Cell) -> bool:
        """Choose the room that the next plan covers, see ``first``; return whether it has changed.

        Args:
            cells: the reachable cells to cover, bool (rows, cols) of the area.
            area: the reachable area.
            cell: the robot's cell.
        """
        before, rooms = self._room, self._on(area.lattice)
        left = set[int]() if rooms is None else {*np.unique(rooms[cells]).tolist()}
        left -= self._given_up
        if rooms is None or not left:
            self._room = NONE
        else:
            here = int(area.lattice.window.values_at(rooms, np.array([cell], np.int32), 0)[0])
            is_over = self._room < 1 or self._room not in left
            if here in left and (is_over or here > self._newest):
                self._room = here
            elif is_over:
                row, col = area.lattice.local(cell)
                ways = ways_from(area.lattice.steps, row * rooms.shape[1] + col)
                steps = ways.reshape(rooms.shape)
                away = {room: steps[_nearest(cells & (rooms == room), (row, col))] for room in left}
                self._room = min(sorted(left), key=away.__getitem__)
            self._newest = max(self._newest, int(rooms.max()))
        self._seen = rooms
        return self._room not in (before, NONE)

    def _on(self, lattice: CoverageLattice) -> NDArray[np.uint16] | None:
        return self._cells.on(lattice) if self._applies() else None


def _nearest(cells: NDArray[np.bool_], to: Cell) -> Cell:
    """Return the marked cell nearest to a cell by rows plus columns; both are array indices."""
    found = np.argwhere(cells)
    row, col = found[np.abs(found - to).sum(axis=1).argmin()].tolist()
    return row, col
