"""Room edits: rooms split and merged by people, and moved with the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Point
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.mission.coverage.floor_tiles import Mask
from fasaco_edge.mission.rooms.room_book import (
    LEAST_M2,
    MOST_CUTS,
    USUAL,
    Room,
    RoomBook,
    RoomSheet,
)
from fasaco_edge.mission.rooms.room_matching import spread
from fasaco_edge.mission.rooms.room_outline import refresh
from fasaco_edge.mission.rooms.room_raster import Cut, RoomRaster, cut_window, is_cut

if TYPE_CHECKING:
    from fasaco_edge.mission.coverage.loop_closure import Motion


def split(book: RoomBook, called: str | int, cut: Cut) -> None:
    """Split a room along a segment; the largest part keeps number, name and settings.

    Raises:
        OrderError: there is no such room, the segment does not divide it, or there are too many
            rooms or cuts.
    """
    room, sheet = book.room(called), _sheet(book)
    if len(sheet.cuts) >= MOST_CUTS:
        raise OrderError(f"there are {MOST_CUTS} already", hint="merge rooms first", key="room.cut")
    window, mask = sheet.raster.squares(room.id)
    near = is_cut(window, sheet.raster.square_m, cut)
    inside = _part_at(mask, mask & near)
    areas = find_areas((inside & ~near).astype(np.uint8))
    least = LEAST_M2 / sheet.raster.square_m**2
    parts = [number for number, squares in enumerate(areas.cells.tolist(), 1) if squares >= least]
    if len(parts) < 2:
        raise OrderError(
            f"does not divide {room.title!r} into parts of {LEAST_M2:g} m2 or more",
            key="room.cut",
            hint="draw it from wall to wall, across the whole room",
        )
    if book.numbers_left < len(parts) - 1:
        raise OrderError("there are too many rooms", hint="merge some first", key="room.cut")
    parts.sort(key=lambda number: (-areas.cells[number - 1], number))
    ids = np.zeros(mask.shape, np.uint16)
    numbers = [room.id, *(book.new_id() for _ in parts[1:])]
    for number in numbers[1:]:
        book.put(Room(number, is_by_hand=True, settings=room.settings))
    for part, number in zip(parts, numbers, strict=True):
        ids[areas.labels == part] = number
    spread(ids, inside)
    place = window.slices_in(sheet.raster.window)
    after = sheet.raster.ids.copy()
    after[place][inside] = ids[inside]
    sheet.lay(replace(sheet.raster, ids=after))
    sheet.cut([*sheet.cuts, cut])
    book.put_by_hand(replace(room, is_by_hand=True))
    refresh(book, numbers)


def merge(book: RoomBook, called: Sequence[str | int], name: str = "") -> None:
    """Merge joined rooms into the room with the smallest number.

    The merged room gets ``name``; by default the name of the named room with the smallest number.

    Raises:
        OrderError: there is no such room, the rooms are not joined, or the name is taken.
    """
    sheet = _sheet(book) if book.sheet else None
    rooms = [room for _, room in sorted({each.id: each for each in map(book.room, called)}.items())]
    if len(rooms) < 2 or sheet is None:
        raise OrderError(
            "a merge takes two rooms or more", hint="name another room", key="room.others"
        )
    numbers = [room.id for room in rooms]
    if name:
        book.check_name("room.name", name, *numbers)
    if apart := _apart(rooms):
        raise OrderError(
            f"{apart.title!r} is not joined to the others",
            key="room.others",
            hint="merge rooms that have a passage to each other; add the room between them",
        )
    stays = rooms[0]
    settings = next((each.settings for each in rooms if each.settings != USUAL), USUAL)
    name = name or next((each.name for each in rooms if each.name), "")
    after = sheet.raster.ids.copy()
    after[np.isin(after, np.array(numbers, np.uint16))] = stays.id
    sheet.lay(replace(sheet.raster, ids=after))
    sheet.cut([cut for cut in sheet.cuts if not _is_inside(sheet.raster, cut, stays.id)])
    book.drop(numbers[1:])
    book.put_by_hand(replace(stays, name=name, settings=settings, is_by_hand=True))
    refresh(book, [stays.id])


def move(book: RoomBook, motion: Motion) -> None:
    """Move the rooms of the sheet in use with the map after a loop closure."""
    sheet = book.sheet
    if sheet is None or motion.is_still:
        return
    sheet.move(motion)
    sheet.cut([(_moved(start, motion), _moved(end, motion)) for start, end in sheet.cuts])
    refresh(book, sheet.rooms)


def _moved(point: Point, motion: Motion) -> Point:
    x, y = motion.forward(np.array([point[0]]), np.array([point[1]]))
    return float(x[0]), float(y[0])


def _sheet(book: RoomBook) -> RoomSheet:
    assert book.sheet is not None  # a room was found
    return book.sheet


def _part_at(mask: Mask, marked: Mask) -> Mask:
    """Return the connected part with the most marked squares; all if none is marked."""
    areas = find_areas(mask.astype(np.uint8))
    counts = np.bincount(areas.labels[marked], minlength=1)
    part: Mask = mask if not counts.sum() else areas.labels == int(counts.argmax())
    return part


def _apart(rooms: Sequence[Room]) -> Room | None:
    """Return a room that is not joined to the first, even through others; None for none."""
    left = {room.id: room for room in rooms[1:]}
    reached = [rooms[0]]
    while reached:
        for number in reached.pop().neighbours:
            if number in left:
                reached.append(left.pop(number))
    return next(iter(left.values()), None)


def _is_inside(raster: RoomRaster, cut: Cut, room: int) -> bool:
    around = cut_window(cut, raster.square_m).intersection(raster.window)
    if around is None:
        return False
    under = raster.on(around)[is_cut(around, raster.square_m, cut)]
    return set(np.unique(under).tolist()) - {0} == {room}
