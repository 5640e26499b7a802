"""Names of rooms through a mission in a generated home: maps that grow, flicker, and are moved."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import PCG64, Generator

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from fasaco_edge.grid.rooms import find_rooms
from fasaco_edge.mission.coverage.floor_tiles import centres
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.rooms.room_watch import update
from tests.benchmarks.rooms.homes import home, seen
from tests.support.poses import composed

SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)
LOOKS = 8
# Share of the building that is seen when rooms are named.
NAMED_FROM = 0.6
# Least share of a named room that lies in one true room.
PURE = 0.7


def noisy(cells, rng):
    """A map with pixels of walls missing, and others beside floor."""
    cells = cells.copy()
    chance = rng.random(cells.shape)
    cells[(cells == OCCUPIED) & (chance < 0.05)] = UNKNOWN
    cells[(cells == FREE) & (chance < 0.002)] = OCCUPIED
    return cells


def true_rooms(book, grid, floor):
    """For each room how many of its squares lie in each true room."""
    raster = book.sheet.raster
    cols, rows = grid.geometry.to_pixels(*centres(raster.window, raster.square_m).T)
    rows, cols = np.floor(rows).astype(int), np.floor(cols).astype(int)
    inside = (rows >= 0) & (cols >= 0) & (rows < grid.geometry.rows) & (cols < grid.geometry.cols)
    truth = np.zeros(len(rows), np.int32)
    truth[inside] = floor.rooms[rows[inside], cols[inside]]
    ids = raster.ids.ravel()
    return {
        room.id: np.bincount(truth[ids == room.id], minlength=floor.rooms.max() + 1)[1:]
        for room in book.rooms
    }


@pytest.mark.parametrize(("kind", "seed"), [("home", 0), ("home", 2), ("office", 3)])
def test_no_named_room_becomes_another(kind, seed):
    floor, rng, book = home(kind, seed), Generator(PCG64(seed)), RoomBook()
    names, moved = {}, np.zeros(3)
    for share in SHARES:
        known = seen(floor, share, seed)
        for look in range(LOOKS):
            if look % 4 == 3:  # a loop closure: some centimetres, a third of a degree
                moved = 0.5 * moved + rng.normal(0.0, (0.08, 0.08, 0.006))
            origin = composed(Pose2D(*moved), known.geometry.origin)
            geometry = replace(known.geometry, origin=origin)
            grid = OccupancyGrid(geometry, noisy(known.cells, rng))
            update(book, find_rooms(grid), "map")
            if book.sheet is None:
                continue
            counts = true_rooms(book, grid, floor)
            for number, true in names.items():
                there = counts[number]
                assert book.room(number).name == f"room of {true}-{number}"
                assert there[true] >= 0.5 * there.max(), (share, look, number)
            if share == NAMED_FROM and look == LOOKS - 1:
                for number, there in counts.items():
                    if there.max(initial=0) > PURE * there.sum():
                        names[number] = int(there.argmax())
                        book.name(number, f"room of {names[number]}-{number}")
    assert len(names) >= 4
    assert book.next_id - 1 <= math.ceil(1.5 * floor.rooms.max())
