"""Rooms of a map: what separates them, what does not, and maps of any kind."""

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rooms import find_rooms
from fasaco_edge.kernels.rooms.clearance import clearances

FREE, WALL, UNKNOWN = 0, 100, -1


def grid_of(cells, resolution=0.05, origin=None):
    geometry = GridGeometry(*cells.shape, resolution, origin or Pose2D(0.0, 0.0))
    return OccupancyGrid(geometry, cells)


def two_rooms(door_m=0.9, resolution=0.05, wall_m=0.1):
    """Two rooms of 4 x 3 m side by side; the door in the middle of the wall between them."""

    def px(metres):
        return round(metres / resolution)

    cells = np.full((px(3.4), px(8.4 + wall_m)), WALL, np.int8)
    cells[px(0.2) : px(3.2), px(0.2) : px(4.2)] = FREE
    cells[px(0.2) : px(3.2), px(4.2 + wall_m) : px(8.2 + wall_m)] = FREE
    cells[px(1.7 - door_m / 2) : px(1.7 + door_m / 2), px(4.2) : px(4.2 + wall_m)] = FREE
    return cells


def put(cells, x, y, width, depth, value=WALL):
    changed = cells.copy()
    rows, cols = (
        slice(round(a / 0.05), round(b / 0.05)) for a, b in ((y, y + depth), (x, x + width))
    )
    changed[rows, cols] = value
    return changed


def numbers(found, *points):
    """Return the room at each point (x, y) [m]."""
    at = [found.geometry.to_pixels(x, y) for x, y in points]
    return [int(found.labels[int(row), int(col)]) for col, row in at]


LEFT, RIGHT = (1.0, 1.0), (7.0, 1.0)


@pytest.mark.parametrize("most", [7, 40])
def test_clearances_are_those_of_a_slow_twin(most):
    rng = np.random.default_rng(3)
    for share in (0.0, 0.02, 0.3, 1.0):
        solid = rng.random((23, 31)) < share
        found = clearances(solid, most)
        rows, cols = solid.shape
        walls = [*np.argwhere(solid).tolist()]
        for row in range(rows):
            for col in range(cols):
                rim = min(row + 1, rows - row, col + 1, cols - col) ** 2
                ways = [(row - r) ** 2 + (col - c) ** 2 for r, c in walls]
                expected = 0 if solid[row, col] else min(*ways, rim, most**2, most**2)
                assert found[row, col] == expected


@pytest.mark.parametrize("door_m", [0.6, 0.9, 1.2])
@pytest.mark.parametrize("wall_m", [0.05, 0.1, 0.3])
def test_a_door_separates_two_rooms(door_m, wall_m):
    found = find_rooms(grid_of(two_rooms(door_m, wall_m=wall_m)))
    assert found.count == 2
    assert numbers(found, LEFT, RIGHT) == [1, 2]
    # Walls have no room, and each free pixel has a room.
    assert (found.labels > 0).sum() == (two_rooms(door_m, wall_m=wall_m) == FREE).sum()


@pytest.mark.parametrize("passage_m", [1.2, 3.0, 8.0])
@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_a_passage_separates_two_rooms(passage_m, resolution):
    found = find_rooms(grid_of(two_rooms(1.0, resolution, passage_m), resolution))
    # A long passage is a room of its own.
    assert found.count == (3 if passage_m > 4.0 else 2)
    assert len({*numbers(found, LEFT, (6.0 + passage_m, 1.0))}) == 2


def test_crossing_passages_are_one_room():
    cells = np.full((320, 320), WALL, np.int8)
    cells[10:310, 150:170] = cells[150:170, 10:310] = FREE
    assert find_rooms(grid_of(cells)).count == 1


@pytest.mark.parametrize(("opening_m", "rooms"), [(1.4, 2), (2.0, 1)])
def test_an_opening_separates_if_its_wall_is_longer(opening_m, rooms):
    """The wall between the rooms is 3 m long, the opening included."""
    found = find_rooms(grid_of(two_rooms(opening_m)))
    assert found.count == rooms
    assert len(set(numbers(found, LEFT, RIGHT))) == rooms


@pytest.mark.parametrize("turned", [False, True])
def test_a_wide_opening_in_a_longer_wall_separates(turned):
    cells = np.full((180, 200), WALL, np.int8)
    cells[4:176, 4:99] = cells[4:176, 101:196] = FREE
    cells[60:125, 99:101] = FREE
    assert find_rooms(grid_of(cells.T.copy() if turned else cells)).count == 2


@pytest.mark.parametrize("wide_m", [1.6, 2.4])
def test_the_mouth_of_a_corridor_separates_it_from_a_hall(wide_m):
    wide = round(wide_m / 0.05)
    cells = np.full((200, 360), WALL, np.int8)
    cells[4:196, 4:160] = FREE
    cells[100 - wide // 2 : 100 + wide // 2, 160:356] = FREE
    found = find_rooms(grid_of(cells))
    assert found.count == 2
    assert numbers(found, (4.0, 5.0), (12.0, 5.0)) == [1, 2]


def test_a_short_arm_is_part_of_its_room():
    """As of a room in the shape of an L."""
    cells = np.full((200, 360), WALL, np.int8)
    cells[4:196, 4:160] = FREE
    cells[4:60, 160:240] = FREE
    assert find_rooms(grid_of(cells)).count == 1


def test_furniture_does_not_separate():
    cells = two_rooms()
    for x, y, width, depth in (
        # Table, block, a bed and a wardrobe with a narrow passage between them.
        (1.5, 1.0, 0.05, 0.05), (2.4, 1.0, 0.05, 0.05), (1.5, 1.6, 0.05, 0.05),
        (5.5, 1.0, 1.0, 0.8), (0.2, 1.3, 2.0, 1.6), (2.9, 2.6, 1.2, 0.6),
    ):  # fmt: skip
        cells = put(cells, x, y, width, depth)
    assert find_rooms(grid_of(cells)).count == 2


def test_floor_behind_furniture_is_no_room():
    """As a scanner maps it: no wall is seen behind bed and wardrobe, nor anything outside."""
    cells = two_rooms()
    for x, y, width, depth in ((0.0, 0.6, 2.2, 1.4), (1.0, 2.8, 1.2, 0.6)):
        cells = put(cells, x, y, width, depth)
    is_free = cells == FREE
    seen = is_free.copy()
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        seen |= np.roll(is_free, by, axis)
    cells[~seen] = UNKNOWN
    assert find_rooms(grid_of(cells)).count == 2


def test_a_niche_is_part_of_its_room():
    cells = two_rooms()
    # A wall of 0.1 m that leaves a corner of 1 m2 behind a gap.
    cells = put(cells, 0.2, 1.2, 0.4, 0.1)
    cells = put(cells, 1.2, 0.2, 0.1, 1.1)
    assert find_rooms(grid_of(cells)).count == 2


def test_a_room_half_seen_is_one():
    cells = two_rooms()
    rows, cols = np.indices(cells.shape)
    # Seen through the door from the middle of the left room.
    x, y = (cols + 0.5) * 0.05 - 2.2, (rows + 0.5) * 0.05 - 1.7
    is_seen = (cols < 86) | (np.abs(y) < 0.45 / 2.0 * x)
    cells[~is_seen] = UNKNOWN
    found = find_rooms(grid_of(cells))
    assert found.count == 2
    assert numbers(found, LEFT, (6.0, 1.7)) == [1, 2]


def seen_through_the_door(x, y, far_m):
    """Map of the left room and of what a scanner at (x, y) [m] sees of the right one."""
    cells = two_rooms()
    rows, cols = np.indices(cells.shape)
    right, up = (cols + 0.5) * 0.05 - x, (rows + 0.5) * 0.05 - y
    # The jambs of the door: at (4.25, 1.25) and (4.25, 2.15).
    low, high = ((jamb - y) / (4.25 - x) for jamb in (1.25, 2.15))
    is_seen = (cols < 86) | ((up > low * right) & (up < high * right) & (right < far_m))
    cells[~is_seen] = UNKNOWN
    return cells


def test_a_room_seen_askew_is_not_joined():
    # The floor seen narrows from the door on; it has 1.7 m2.
    found = find_rooms(grid_of(seen_through_the_door(3.6, 0.7, 4.0)))
    assert found.count == 2
    assert len({*numbers(found, LEFT, (5.0, 2.5))}) == 2


def test_little_floor_behind_a_door_is_no_room_yet():
    # A strip of 0.4 m2 along the wall, seen from beside the door.
    found = find_rooms(grid_of(seen_through_the_door(4.0, 0.4, 4.0)))
    assert numbers(found, LEFT, (4.45, 2.6)) == [1, 0]


def test_a_cut_by_hand_divides_a_room():
    cells = two_rooms()
    found = find_rooms(grid_of(cells), [((1.0, 0.2), (1.0, 3.2))])
    assert found.count == 3
    assert len({*numbers(found, (0.5, 1.0), (2.0, 1.0), RIGHT)}) == 3


def test_a_cut_that_leaves_a_way_round_divides_nothing():
    assert find_rooms(grid_of(two_rooms()), [((1.0, 0.2), (1.0, 2.0))]).count == 2


def test_the_map_may_be_turned_and_placed_anywhere():
    cells = two_rooms()
    placed = Pose2D(-31.0, 17.0, 0.7)
    found = find_rooms(grid_of(cells, origin=placed))
    plain = find_rooms(grid_of(cells))
    assert np.array_equal(found.labels, plain.labels)
    x, y = GridGeometry(*cells.shape, 0.05, placed).to_map(7.0 / 0.05, 1.0 / 0.05)
    assert numbers(found, (x, y)) == [2]


def test_unknown_around_the_known_part_changes_nothing():
    cells = two_rooms()
    padded = np.full((cells.shape[0] + 60, cells.shape[1] + 90), UNKNOWN, np.int8)
    padded[20 : 20 + cells.shape[0], 50 : 50 + cells.shape[1]] = cells
    one, other = find_rooms(grid_of(cells)), find_rooms(grid_of(padded))
    assert np.array_equal(one.labels, other.labels)
    assert other.geometry.corner_of(one.geometry) == (-20, -50)


@pytest.mark.parametrize(
    "cells",
    [
        np.full((5, 7), UNKNOWN, np.int8),
        np.full((5, 7), WALL, np.int8),
        np.zeros((1, 1), np.int8),
        np.zeros((1, 400), np.int8),
        np.full((40, 40), 50, np.int8),
    ],
    ids=["unknown", "wall", "one pixel", "a row", "neither free nor wall"],
)
def test_a_map_without_rooms_has_none(cells):
    found = find_rooms(grid_of(cells))
    assert found.count == 0
    assert not found.labels.any()


def test_an_open_floor_is_one_room():
    assert find_rooms(grid_of(np.zeros((50, 60), np.int8))).count == 1


def test_many_chambers_are_joined_until_they_are_large_enough():
    """Chambers of 1 m2 in rows, each with a door to the next: none is a room of its own."""
    side, count = 22, 14
    cells = np.full((3 * side + 2, count * side + 2), WALL, np.int8)
    for row in range(3):
        for col in range(count):
            cells[row * side + 2 : (row + 1) * side, col * side + 2 : (col + 1) * side] = FREE
            if col:
                middle = row * side + side // 2
                cells[middle - 7 : middle + 7, col * side : col * side + 2] = FREE
    found = find_rooms(grid_of(cells))
    floor_m2 = np.bincount(found.labels[found.labels > 0])[1:] * 0.05**2
    assert (floor_m2 >= 1.5).all()
    assert 3 * 2 <= found.count <= 3 * count // 2
    # The rows are not joined to each other.
    rows = [
        set(numbers(found, *((1.1 * col + 0.6, y) for col in range(count)))) for y in (0.6, 1.7)
    ]
    assert not rows[0] & rows[1]
