"""Room update: the regions of a new map, to the sheet of the building that it shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.grid.geometry import Point, Window
from fasaco_edge.grid.polygons import area_m2, is_near
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.mission.map.room_book import MOST_NUMBER, Room, RoomBook, RoomSheet
from fasaco_edge.mission.map.room_matching import (
    LEAST_M2,
    SETTLED,
    Matching,
    common_counts,
    slots_of,
)
from fasaco_edge.mission.map.room_outline import joined, largest_part, outline
from fasaco_edge.mission.map.room_raster import (
    MOST_SQUARES,
    Ids,
    RoomRaster,
    sampled,
    window_over,
)

if TYPE_CHECKING:
    from fasaco_edge.grid.rooms import FoundRooms

# Share of the floor in rooms that match from which a map shows the building of a sheet; region and
# room match if they have this share of all their floor in common.
ALIKE = MATCH = 0.5
# Outlines follow once so much has changed [m2]: pixels along walls flicker.
STALE_M2 = 0.1
# Squares are as wide as the map's pixels, and not narrower than this [m].
LEAST_SQUARE_M = 0.05


def update(book: RoomBook, found: FoundRooms, frame: str) -> None:
    """Take in the regions of the newest map, which is in ``frame``.

    A map without regions changes nothing.
    """
    if not found.count:
        return
    sheet = _sheet_for(book, found, frame)
    _widen(sheet, round(found.geometry.resolution / sheet.raster.square_m))
    while True:
        window = window_over(found.geometry, sheet.raster.square_m)
        whole = Window.around(sheet.raster.window, window) or window
        if whole.rows * whole.cols <= MOST_SQUARES:
            break
        _widen(sheet, 2)
    book.turn_to(sheet)
    sheet.settle(SETTLED)
    before = sheet.raster.on(whole)
    sheet.lay(replace(sheet.raster, window=whole, ids=before.copy()))
    labels = sampled(found, window, sheet.raster.square_m)
    Matching(book, sheet, window, labels).apply(before)
    refresh(book, _stale(sheet, before))


def _widen(sheet: RoomSheet, factor: int) -> None:
    """Make the squares of a sheet wider by a factor, if that is more than 1."""
    if factor > 1:
        sheet.lay(sheet.raster.coarser(factor), sheet.gone.coarser(factor))
        sheet.note({}, RoomRaster.empty(sheet.raster.square_m))


def _sheet_for(book: RoomBook, found: FoundRooms, frame: str) -> RoomSheet:
    """Return the sheet of the building that a map shows, perhaps a new one."""
    in_use = book.sheet if book.frame == frame else None
    if in_use is not None and in_use.is_named:
        return in_use
    # A first look may have seen a corner: as long as no room in use has a name or settings,
    # other rooms may turn out to be those of the building.
    others = [each for each in book.sheets if each.frame == frame and each is not in_use]
    alike = [(_alike(each, found), each) for each in others if each.is_named or in_use is None]
    share, best = max(alike, key=lambda each: each[0], default=(0.0, None))
    if best is not None and share >= ALIKE:
        if in_use is not None:
            book.forget(in_use)
        return best
    if in_use is not None:
        return in_use
    return RoomSheet.empty(frame, max(found.geometry.resolution, LEAST_SQUARE_M))


def _alike(sheet: RoomSheet, found: FoundRooms) -> float:
    """Return how much of the floor of map or sheet lies in regions and rooms that match."""
    window = window_over(found.geometry, sheet.raster.square_m)
    if window.rows * window.cols > MOST_SQUARES:
        return 0.0
    labels = sampled(found, window, sheet.raster.square_m)
    counts = common_counts(labels, slots_of(sheet.raster.on(window), sheet.rooms), len(sheet.rooms))
    squares = np.bincount(sheet.raster.ids.ravel(), minlength=MOST_NUMBER + 1)[sorted(sheet.rooms)]
    areas = counts[1:].sum(axis=1)
    floor, common = min(int(areas.sum()), int(squares.sum())), counts[1:, 1:]
    matches = common >= MATCH * (areas[:, np.newaxis] + squares - common)
    return float(common[matches].sum()) / floor if floor else 0.0


def _stale(sheet: RoomSheet, before: Ids) -> list[int]:
    """Return the rooms whose outlines are outdated, as enough of their squares have changed."""
    after = sheet.raster.ids
    squares = np.bincount(after.ravel(), minlength=MOST_NUMBER + 1)
    other = before != after
    changed = np.bincount(np.concatenate((before[other], after[other])), minlength=1)
    for room in np.flatnonzero(changed).tolist():
        sheet.stale[room] = sheet.stale.get(room, 0) + int(changed[room])
    least = STALE_M2 / sheet.raster.square_m**2
    return [
        number
        for number, room in sheet.rooms.items()
        if sheet.stale.get(number, 0) >= least or bool(room.outline) != bool(squares[number])
    ]


def refresh(book: RoomBook, changed: Iterable[int]) -> None:
    """Derive outline, area and neighbours anew of rooms whose squares have changed."""
    sheet = book.sheet
    rooms = set(changed)
    if sheet is None or not rooms:
        return
    for room in rooms:
        sheet.stale.pop(room, None)
    square_m = sheet.raster.square_m
    beside, shapes = joined(sheet.raster.ids, square_m), list[Room]()
    for known in book.rooms:
        shape = replace(known, neighbours=beside.get(known.id, ()), encloses=())
        if known.id in rooms:
            window, mask = sheet.raster.squares(known.id)
            shape = replace(
                shape,
                outline=outline(window, mask, square_m) if mask.any() else (),
                area_m2=round(int(np.count_nonzero(mask)) * square_m**2, 2),
            )
        shapes.append(shape)
    # Outlines with a hole that a room fits in.
    rings = {
        each.id
        for each in shapes
        if each.outline and area_m2(each.outline) > each.area_m2 + LEAST_M2
    }
    inner = {each.id: _inner_point(sheet, each.id) for each in shapes if rings and each.outline}
    for each in shapes:
        encloses: list[int] = []
        if each.id in rings:
            encloses = [at for at, point in inner.items() if is_near(each.outline, point, 0.0)]
        book.put(replace(each, encloses=tuple(at for at in encloses if at != each.id)))


def _inner_point(sheet: RoomSheet, room: int) -> Point:
    """Return the centre of a square of a room, away from its border."""
    window, mask = sheet.raster.squares(room)
    row, col = find_areas(largest_part(mask).astype(np.uint8)).inner[0].tolist()
    square_m = sheet.raster.square_m
    return (window.col0 + col + 0.5) * square_m, (window.row0 + row + 0.5) * square_m
