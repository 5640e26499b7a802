"""Rooms keep number, name and settings, whatever the map does: hand-drawn regions in a table."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.polygons import area_m2, polygon_flaw
from fasaco_edge.grid.rooms import FoundRooms
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.rooms import room_book
from fasaco_edge.mission.rooms.room_book import RoomBook, RoomSettings
from fasaco_edge.mission.rooms.room_edits import merge, move, split
from fasaco_edge.mission.rooms.room_matching import HOLD_CHANGE, HOLD_NEW
from fasaco_edge.mission.rooms.room_watch import update

# A letter is a square of 1 m, drawn as 10 x 10 pixels of 0.1 m; equal letters are one region.
PIXELS, SIDE_M = 10, 0.1


def regions(*rows, at=(0.0, 0.0), yaw=0.0):
    """Regions of a drawing, the last line the southernmost; other than letters: no floor."""
    letters = sorted({letter for row in rows for letter in row if letter.isalpha()})
    number = {letter: index for index, letter in enumerate(letters, 1)}
    cells = [[number.get(letter, 0) for letter in row] for row in rows[::-1]]
    labels = np.array(cells, np.int32).repeat(PIXELS, axis=0).repeat(PIXELS, axis=1)
    geometry = GridGeometry(*labels.shape, SIDE_M, Pose2D(*at, yaw))
    return FoundRooms(geometry, labels, len(letters))


def shown(book, found, times=1, frame="map"):
    for _ in range(times):
        update(book, found, frame)
    return book


def known(found, frame="map"):
    """A book that has seen a map for long enough."""
    return shown(RoomBook(), found, HOLD_CHANGE, frame)


def at(book, x, y):
    """The number of the room at a place [m]; 0 for none."""
    raster = book.sheet.raster
    row, col = math.floor(y / raster.square_m), math.floor(x / raster.square_m)
    window = raster.window
    inside = window.row0 <= row < window.row1 and window.col0 <= col < window.col1
    return int(raster.ids[row - window.row0, col - window.col0]) if inside else 0


FLAT = regions("aaa#ccc", "aaa#ccc", "aaaaccc", "##bb###", "bbbbbbb", "bbbbbbb")
WITHOUT_WALL = regions("aaa#aaa", "aaa#aaa", "aaaaaaa", "##bb###", "bbbbbbb", "bbbbbbb")
PARTED = regions("aaa#ccc", "aaa#ccc", "ddddccc", "##bb###", "bbbbbbb", "bbbbbbb")
KITCHEN, HALL, BATH = (1.5, 5.5), (3.5, 0.5), (5.5, 5.5)


def test_rooms_are_found_with_outline_area_and_neighbours():
    book = shown(RoomBook(), FLAT, HOLD_NEW)
    assert [room.id for room in book.rooms] == [1, 2, 3]
    kitchen = book.room(at(book, *KITCHEN))
    bath = book.room(at(book, *BATH))
    hall = book.room(at(book, *HALL))
    assert kitchen.area_m2 == pytest.approx(10.0)
    assert kitchen.neighbours == tuple(sorted((hall.id, bath.id)))
    assert hall.neighbours == (kitchen.id,)
    for room in book.rooms:
        assert not polygon_flaw(room.outline)
        assert area_m2(room.outline) == pytest.approx(room.area_m2, rel=0.05)
    assert len(kitchen.outline) == 6


def test_no_number_appears_before_a_region_has_lasted():
    book = shown(RoomBook(), FLAT, HOLD_NEW - 1)
    assert book.rooms == ()
    assert book.sheet.is_settling


@pytest.mark.parametrize("name", ["", "kitchen"])
@pytest.mark.parametrize(
    "flicker",
    [
        pytest.param(WITHOUT_WALL, id="a wall comes and goes"),
        pytest.param(PARTED, id="a part comes and goes"),
        pytest.param(regions("aaa####", "aaa####", "aaaa###", "##bb###", "bbbbbbb"), id="a room"),
        pytest.param(regions("......."), id="all"),
    ],
)
def test_a_flickering_map_makes_no_numbers(flicker, name):
    book = known(FLAT)
    if name:
        book.name(at(book, *KITCHEN), name)
    before, next_id = book.rooms, book.next_id
    for round_of in range(40):
        shown(book, flicker if round_of % 2 else FLAT)
    shown(book, FLAT, HOLD_CHANGE)
    assert book.next_id == next_id
    assert [(room.id, room.name) for room in book.rooms] == [
        (room.id, room.name) for room in before
    ]
    assert [room.area_m2 for room in book.rooms] == [room.area_m2 for room in before]


@pytest.mark.parametrize("times", [1, 2, HOLD_CHANGE // 2])
def test_new_floor_that_one_map_adds_to_a_room_is_not_the_room(times):
    """For a moment the map shows no door to the hall that comes into view."""
    book = known(regions("aa", "aa"))
    book.name(1, "bath")
    shown(book, regions("aaaaaaaa", "aaaaaaaa"), times)
    shown(book, regions("aabbbbbb", "aabbbbbb"), HOLD_CHANGE)
    assert book.room("bath").id == at(book, 0.5, 0.5) == 1
    assert at(book, 6.5, 0.5) == 2
    assert book.room("bath").area_m2 == pytest.approx(4.0)


MOTIONS = [
    pytest.param(0.15, 0.0, 0.0, id="a decimetre"),
    pytest.param(-0.4, 0.3, math.radians(2.0), id="half a metre"),
]


@pytest.mark.parametrize(("x", "y", "yaw"), MOTIONS)
def test_a_loop_closure_moves_rooms_with_the_map(x, y, yaw):
    book = known(FLAT)
    for place, name in ((KITCHEN, "kitchen"), (BATH, "bath")):
        book.name(at(book, *place), name)
    rooms = {room.name: room.id for room in book.rooms}
    moved = replace(FLAT, geometry=replace(FLAT.geometry, origin=Pose2D(x, y, yaw)))
    shown(book, moved, 2 * HOLD_CHANGE)
    assert {room.name: room.id for room in book.rooms} == rooms
    there = moved.geometry.to_map(KITCHEN[0] / SIDE_M, KITCHEN[1] / SIDE_M)
    assert at(book, *there) == rooms["kitchen"]
    # What lay beside the map's new place is no floor any more.
    assert book.room("kitchen").area_m2 == pytest.approx(10.0, rel=0.1)


def test_a_large_loop_closure_is_followed_by_the_robots_pose():
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    number = book.room("kitchen").id
    split(book, at(book, *HALL), ((4.5, -0.5), (4.5, 2.5)))
    motion = Motion(Pose2D(0.0, 0.0), Pose2D(4.0, -3.0, 0.1))
    moved = replace(FLAT, geometry=replace(FLAT.geometry, origin=motion.end))
    move(book, motion)
    shown(book, moved, 2 * HOLD_CHANGE)
    assert at(book, *moved.geometry.to_map(15.0, 55.0)) == number
    assert [room.id for room in book.rooms] == [1, 2, 3, 4]
    ((x, y), _) = book.sheet.cuts[0]
    assert (x, y) == pytest.approx(moved.geometry.to_map(45.0, -5.0))


def test_a_room_that_joins_its_neighbour_gets_its_number_back():
    book = known(FLAT)
    ids = {place: at(book, *place) for place in (KITCHEN, BATH)}
    shown(book, WITHOUT_WALL, HOLD_CHANGE - 1)
    assert {place: at(book, *place) for place in ids} == ids
    shown(book, WITHOUT_WALL)
    assert len(book.rooms) == 2
    shown(book, FLAT, 3 * HOLD_CHANGE)
    assert {at(book, *place) for place in ids} == set(ids.values())
    assert book.next_id == 4


def test_the_largest_part_of_a_divided_room_keeps_its_number():
    book = known(WITHOUT_WALL)
    number = at(book, *KITCHEN)
    shown(book, FLAT, HOLD_CHANGE)
    assert len(book.rooms) == 3
    assert number in (at(book, *KITCHEN), at(book, *BATH))


def test_two_named_rooms_in_one_region_stay_divided():
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    book.name(at(book, *BATH), "bath")
    # The map has grown, too: the new floor goes to the nearer one.
    shown(book, regions("aaa#aaaa", "aaa#aaaa", "aaaaaaaa"), 5 * HOLD_CHANGE)
    shown(book, regions("aaa#aaaa", "aaa#aaaa", "aaaaaaaa", at=(0.0, 3.0)), 5 * HOLD_CHANGE)
    assert at(book, *KITCHEN) == book.room("kitchen").id
    assert at(book, *BATH) == at(book, 7.5, 5.5) == book.room("bath").id


def test_a_named_room_is_neither_parted_nor_joined_by_a_map():
    book = known(WITHOUT_WALL)
    book.name(at(book, *KITCHEN), "living room")
    shown(book, FLAT, 3 * HOLD_CHANGE)
    assert at(book, *KITCHEN) == at(book, *BATH) == book.room("living room").id
    assert len(book.rooms) == 2


def test_a_room_named_half_seen_gives_up_its_part_of_another():
    """Two rooms were seen through their doors as one; most of the second one came later."""
    joined = regions(*["aaaaaaa..."] * 3)
    told_apart = regions("aaa#bbbbbb", "aaa#bbbbbb", "aaaabbbbbb")
    for is_by_hand in False, True:
        book = shown(known(joined), joined, 3 * HOLD_CHANGE)
        if is_by_hand:
            split(book, 1, ((2.5, -0.5), (2.5, 3.5)))
            merge(book, [1, 2])
        book.name(1, "kitchen")
        shown(book, joined, 3 * HOLD_CHANGE)
        for _ in range(2 * HOLD_CHANGE):
            shown(book, told_apart)
            assert is_by_hand or book.room("kitchen").area_m2 < 22.0, "new floor of the other room"
        assert at(book, 0.5, 1.5) == book.room("kitchen").id == 1
        assert (at(book, 4.5, 1.5) == 1) == (at(book, 8.5, 1.5) == 1) == is_by_hand


def test_rooms_beyond_a_smaller_map_are_remembered():
    book = known(FLAT)
    before = [room.id for room in book.rooms]
    shown(book, regions("bbb", "bbb"), 3 * HOLD_CHANGE)
    assert [room.id for room in book.rooms] == before
    assert at(book, *BATH)
    shown(book, FLAT, 2 * HOLD_CHANGE)
    assert [room.id for room in book.rooms] == before


def test_a_cut_splits_a_room_at_once_and_holds():
    book = known(FLAT)
    number = at(book, *HALL)
    book.name(number, "hall")
    book.set(number, RoomSettings(passes=2))
    split(book, "hall", ((4.5, -0.5), (4.5, 2.5)))
    west, east = at(book, 0.5, 0.5), at(book, 6.5, 0.5)
    assert west == number
    assert east not in (0, number)
    assert book.room(east).settings.passes == 2
    assert book.room(east).name == ""
    assert east in book.room(number).neighbours
    with_cut = FLAT.labels.copy()
    with_cut[:30, 44:46] = 0
    for found in (FLAT, replace(FLAT, labels=with_cut)):
        shown(book, found, 3 * HOLD_CHANGE)
        assert (at(book, 0.5, 0.5), at(book, 6.5, 0.5)) == (west, east)
        assert east in book.room(number).neighbours
    merge(book, [east, "hall"])
    assert at(book, 6.5, 0.5) == number
    assert book.sheet.cuts == []
    shown(book, FLAT, 3 * HOLD_CHANGE)
    assert [room.name for room in book.rooms].count("hall") == 1


def test_merged_rooms_are_one_whatever_the_map_shows():
    book = known(FLAT)
    kitchen, bath = at(book, *KITCHEN), at(book, *BATH)
    book.name(bath, "bath")
    merge(book, [bath, kitchen])
    number = min(kitchen, bath)
    assert (book.room(number).name, len(book.rooms)) == ("bath", 2)
    shown(book, FLAT, 3 * HOLD_CHANGE)
    assert at(book, *KITCHEN) == at(book, *BATH) == number
    split(book, number, ((3.5, 2.5), (3.5, 6.5)))
    assert at(book, *KITCHEN) != at(book, *BATH)
    assert book.next_id == 5


def test_no_map_gives_a_part_of_merged_rooms_to_another():
    book = known(FLAT)
    merge(book, [at(book, *KITCHEN), at(book, *BATH)])
    number = at(book, *BATH)
    # No door is seen between the bath, a part of it now, and a new room beside.
    assert number == 1
    shown(book, regions("########cccc", "########cccc", "########cccc", at=(0.0, 3.0)), HOLD_NEW)
    assert at(book, 10.5, 4.5) == 4
    beside = regions("aaa#cccccccc", "aaa#cccccccc", "aaaacccccccc", at=(0.0, 3.0))
    shown(book, beside, 3 * HOLD_CHANGE)
    assert at(book, *BATH) == at(book, *KITCHEN) == number


def test_a_name_is_taken_away_and_free_again():
    book = known(FLAT)
    kitchen, bath = at(book, *KITCHEN), at(book, *BATH)
    book.name(kitchen, "kitchen")
    book.name("kitchen", "")
    assert book.room(kitchen).title == f"room {kitchen}"
    book.name(bath, "")
    book.name(bath, "kitchen")
    assert book.room("kitchen").id == bath


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda book: book.name(7, "x"), "no room 7; there are 'kitchen', room"),
        (lambda book: book.name("attic", "x"), "no room 'attic'; there are"),
        (lambda book: book.name(2, "kitchen"), "is 'kitchen' already"),
        (lambda book: book.name(2, "room 9"), "read as the number of a room"),
        (lambda book: book.name(2, "1"), "read as the number of a room"),
        (lambda book: book.name(2, "room 123456"), "read as the number of a room"),
        (lambda book: book.name(2, " x"), "printable characters"),
        (lambda book: split(book, 1, ((9.0, 9.0), (9.5, 9.0))), "does not divide"),
        (lambda book: split(book, 1, ((0.0, 4.5), (1.0, 4.5))), "does not divide"),
        (lambda book: merge(book, ["kitchen"]), "two rooms or more"),
        (lambda book: merge(book, [at(book, *HALL), at(book, *BATH)]), "is not joined"),
        (lambda book: merge(book, [1, 2, 3], "room 4"), "read as the number of a room"),
    ],
)
def test_an_impossible_change_is_refused_by_name(change, why):
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    before = book.rooms
    with pytest.raises(OrderError, match=why) as refused:
        change(book)
    assert refused.value.hint or "printable" in why
    assert book.rooms == before


def test_each_building_has_a_sheet_of_its_own():
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    other = regions("aabb", "aabb", "ccbb", "ccbb", at=(0.5, 0.5))
    book.leave_building()
    shown(book, other, HOLD_CHANGE)
    assert book.find("kitchen") is None
    assert min(room.id for room in book.rooms) == 4
    book.leave_building()
    shown(book, FLAT)
    assert [room.id for room in book.rooms] == [1, 2, 3]
    assert book.room("kitchen").id == at(book, *KITCHEN)
    shown(book, FLAT, HOLD_CHANGE, frame="upstairs")
    assert min(room.id for room in book.rooms) == 7


def test_a_building_seen_again_from_a_corner_gets_its_names_back():
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    number = book.room("kitchen").id
    book.leave_building()
    shown(book, regions("aabb", "aabb", "ccbb", "ccbb", at=(0.5, 0.5)), HOLD_CHANGE)
    book.name(min(room.id for room in book.rooms), "garage")
    book.leave_building()
    shown(book, regions("bb", "bb"), HOLD_CHANGE)
    assert book.find("kitchen") is None
    assert len(book.sheets) == 3
    version = book.version
    shown(book, FLAT)
    assert book.version > version
    assert book.room("kitchen").id == number == at(book, *KITCHEN)
    assert [each.is_named for each in book.sheets] == [True, True]
    # A building whose rooms have names is not left again.
    shown(book, regions("aabb", "aabb", "ccbb", "ccbb", at=(0.5, 0.5)), HOLD_CHANGE)
    assert book.find("garage") is None


def test_a_split_beyond_the_limit_of_rooms_changes_nothing(monkeypatch):
    book = known(regions("aaaaaaaaa", "aa..a..aa"))
    monkeypatch.setattr(room_book, "MOST_ROOMS", 2)
    before, next_id = book.rooms, book.next_id
    # Three parts: below the cut lie two more.
    with pytest.raises(OrderError, match="too many rooms"):
        split(book, 1, ((-0.5, 1.0), (9.5, 1.0)))
    assert (book.rooms, book.next_id) == (before, next_id)


def test_a_large_building_gets_wider_squares_and_keeps_its_rooms():
    book = known(FLAT)
    book.name(at(book, *KITCHEN), "kitchen")
    far = np.zeros((1500, 1500), np.int32)
    far[: FLAT.labels.shape[0], : FLAT.labels.shape[1]] = FLAT.labels
    far[1400:, 1400:] = 4
    shown(book, replace(FLAT, geometry=GridGeometry(1500, 1500, SIDE_M, Pose2D(0, 0)), labels=far))
    assert book.sheet.raster.square_m == 2 * SIDE_M
    assert at(book, *KITCHEN) == book.room("kitchen").id
    assert book.room("kitchen").area_m2 == pytest.approx(10.0, rel=0.1)
    coarse = FoundRooms(GridGeometry(15, 15, 10 * SIDE_M, Pose2D(0, 0)), far[5::100, 5::100], 4)
    shown(book, coarse)
    assert book.sheet.raster.square_m == pytest.approx(1.0)
    assert at(book, *KITCHEN) == book.room("kitchen").id


def test_a_room_whose_squares_are_lost_has_no_outline():
    """As in wider squares; a ring has to know what lies within it, which no square of it does."""
    book = known(regions("aaaaa", "abbba", "abbba", "aaaaa"))
    closet = at(book, 2.5, 2.0)
    book.name(closet, "closet")
    ids = book.sheet.raster.ids
    book.sheet.lay(replace(book.sheet.raster, ids=np.where(ids == closet, 0, ids)))
    shown(book, regions("aaaaaaa", "a...aaa", "a...aaa", "aaaaaaa"), HOLD_CHANGE)
    assert (book.room("closet").outline, book.room("closet").area_m2) == ((), 0.0)
