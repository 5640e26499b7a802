"""Rooms under a planned line: the swept share of each, and how often the line enters it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.drawing.pictures import in_pieces
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rooms import FoundRooms, find_rooms
from fasaco_edge.judge.floor import JudgedFloor
from fasaco_edge.offline.ground import Line

# Points at most this far apart along the line show in which room it is [m].
PIECE_M = 0.05


@dataclass(frozen=True, slots=True)
class PlannedRoom:
    """A room with figures of a line in it, as in ``plan --rooms --json``.

    Attributes:
        room: its number on this map: rooms are numbered in the order of their first pixels.
        area_m2: its free floor [m2].
        reachable_m2: the part of that floor that the tool can reach [m2].
        swept_share: swept share of the reachable floor.
        entered: number of times that the line enters it, or starts in it.
    """

    room: int
    area_m2: float
    reachable_m2: float
    swept_share: float
    entered: int


@dataclass(frozen=True, slots=True, eq=False)
class RoomsUnderLine:
    """The rooms of a map, with figures of a line in each."""

    found: FoundRooms
    rooms: tuple[PlannedRoom, ...]

    @classmethod
    def of(cls, grid: OccupancyGrid, line_xy: Line, judged: JudgedFloor) -> RoomsUnderLine:
        """Return the rooms under a line, points (x, y) [m], judged on the same map.

        Rooms without reachable floor, as between two walls, are left out.
        """
        found = find_rooms(grid)
        pixel_m2 = found.geometry.resolution**2
        rows, cols = np.nonzero(found.labels)
        x, y = found.geometry.to_map(cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
        xy = np.stack((x, y), axis=1)
        swept = judged.geometry.values_at(judged.swept, xy)
        reachable = swept | judged.geometry.values_at(judged.unswept, xy)
        found = _only(found, found.labels[rows, cols][reachable])
        at = found.labels[rows, cols]
        sizes, reached, done = (
            np.bincount(at, weights, found.count + 1) * pixel_m2
            for weights in (None, reachable, swept)
        )
        entered = np.bincount(_entries(found, line_xy), minlength=found.count + 1)
        rooms = tuple(
            PlannedRoom(
                room,
                round(float(sizes[room]), 2),
                round(float(reached[room]), 2),
                round(float(done[room] / reached[room]), 4),
                int(entered[room]),
            )
            for room in range(1, found.count + 1)
        )
        return cls(found, rooms)


def _only(found: FoundRooms, rooms: NDArray[np.int32]) -> FoundRooms:
    """Return some of the rooms, int32 (n,), numbered from 1 in the same order."""
    numbers = np.zeros(found.count + 1, np.int32)
    kept = np.unique(rooms)
    numbers[kept] = np.arange(1, len(kept) + 1)
    return replace(found, labels=numbers[found.labels], count=len(kept))


def _entries(found: FoundRooms, line_xy: Line) -> NDArray[np.int32]:
    """Return the rooms that a line enters, in sequence, int32 (n,)."""
    passed = found.geometry.values_at(found.labels, in_pieces(line_xy, PIECE_M))
    # In doors and beside furniture, a point is in no room.
    passed = passed[passed > 0]
    entered: NDArray[np.int32] = passed[np.diff(passed, prepend=0) != 0]
    return entered
