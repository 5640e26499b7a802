"""The rooms' file as bytes: JSON with a version; squares of rooms as base64 of zlib.

No content is trusted: a file that ``encode_rooms`` cannot have written is refused as a whole.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from fasaco_edge.errors import OrderError, RoomsFileError
from fasaco_edge.grid.geometry import (
    FARTHEST_M,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
    MOST_INDEX,
    Point,
    Window,
)
from fasaco_edge.mission.map.room_book import (
    LIKE_NUMBER,
    MOST_CUTS,
    MOST_NUMBER,
    MOST_ROOMS,
    MOST_SHEETS,
    Room,
    RoomBook,
    RoomSettings,
    RoomSheet,
)
from fasaco_edge.mission.map.room_raster import MOST_SQUARES, RoomRaster
from fasaco_edge.mission.orders.keep_outs import PlaceName, name_faults
from fasaco_edge.mission.orders.passes import Passes, passes_document, passes_faults, passes_of
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY, Priority

MOST_BYTES = 16_000_000
"""Limit on the bytes of a file; longer ones are not read."""
MOST_OUTLINE = 1000
_LEVEL = 1

_Number = Annotated[int, Meta(ge=1, le=MOST_NUMBER)]
_Index = Annotated[int, Meta(ge=-MOST_INDEX, le=MOST_INDEX)]
_Length = Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)]
_Corner = tuple[_Length, _Length]


class _Note(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An object without unknown members."""


class RasterNote(_Note, frozen=True):
    """Squares from (row0, col0) on; ``ids``: zlib of uint16, little endian, row by row."""

    row0: _Index
    col0: _Index
    rows: Annotated[int, Meta(ge=0, le=MOST_SQUARES)]
    cols: Annotated[int, Meta(ge=0, le=MOST_SQUARES)]
    ids: bytes


class RoomNote(_Note, frozen=True, omit_defaults=True):
    """A room; members as in ``Room`` and its settings."""

    id: _Number
    name: PlaceName | None = None
    by_hand: bool = False
    passes: Passes | None = None
    skip: bool = False
    priority: Priority = USUAL_PRIORITY
    outline: Annotated[list[_Corner], Meta(max_length=MOST_OUTLINE)] = []
    area_m2: Annotated[float, Meta(ge=0)] = 0.0
    neighbours: Annotated[list[_Number], Meta(max_length=MOST_ROOMS)] = []
    encloses: Annotated[list[_Number], Meta(max_length=MOST_ROOMS)] = []


class SheetNote(_Note, frozen=True):
    """The rooms of one building."""

    frame: Annotated[str, Meta(max_length=4096)]
    square_m: Annotated[float, Meta(ge=MIN_RESOLUTION_M, le=MAX_RESOLUTION_M)]
    squares: RasterNote
    gone: RasterNote
    rooms: Annotated[list[RoomNote], Meta(max_length=MOST_ROOMS)]
    cuts: Annotated[list[tuple[_Corner, _Corner]], Meta(max_length=MOST_CUTS)]


class BookNote(_Note, frozen=True):
    """A whole file."""

    version: Literal[1]
    next_id: Annotated[int, Meta(ge=1, le=MOST_NUMBER + 1)]
    sheets: Annotated[list[SheetNote], Meta(max_length=MOST_SHEETS)]


def snapshot_of(book: RoomBook) -> RoomBook:
    """Return a copy of a book that another thread can encode.

    Rooms and rasters are shared, as a book replaces them and never changes them.
    """
    sheets = [replace(each, rooms=dict(each.rooms), cuts=list(each.cuts)) for each in book.sheets]
    return RoomBook(sheets, book.next_id)


def encode_rooms(book: RoomBook) -> bytes:
    """Return a book as bytes; ``decode_rooms`` reads them."""
    sheets = [
        SheetNote(
            frame=each.frame,
            square_m=each.raster.square_m,
            squares=_raster_note(each.raster),
            gone=_raster_note(each.gone),
            rooms=[_room_note(room) for room in each.rooms.values()],
            cuts=list(each.cuts),
        )
        for each in book.sheets
    ]
    return msgspec.json.encode(BookNote(version=1, next_id=book.next_id, sheets=sheets))


def _raster_note(raster: RoomRaster) -> RasterNote:
    raster = raster.cropped()
    window, packed = raster.window, zlib.compress(raster.ids.astype("<u2").tobytes(), _LEVEL)
    return RasterNote(
        row0=window.row0, col0=window.col0, rows=window.rows, cols=window.cols, ids=packed
    )


def _room_note(room: Room) -> RoomNote:
    settings = room.settings
    document = None if settings.passes is None else passes_document(settings.passes, settings.kinds)
    return RoomNote(
        id=room.id,
        name=room.name or None,
        by_hand=room.is_by_hand,
        passes=msgspec.convert(document, Passes | None),
        skip=settings.skip,
        priority=settings.priority,
        outline=list(room.outline),
        area_m2=room.area_m2,
        neighbours=list(room.neighbours),
        encloses=list(room.encloses),
    )


def decode_rooms(payload: bytes) -> RoomBook:
    """Return the book in ``payload``.

    Raises:
        RoomsFileError: ``encode_rooms`` of this version cannot have written it.
    """
    try:
        note = msgspec.json.decode(payload, type=BookNote)
        numbers = [room.id for each in note.sheets for room in each.rooms]
        if len(set(numbers)) < len(numbers):
            raise ValueError("two rooms have one number")
        return RoomBook([_sheet(each, note.next_id) for each in note.sheets], note.next_id)
    except (msgspec.DecodeError, UnicodeError, OrderError, ValueError, zlib.error) as error:
        raise RoomsFileError(f"no file of rooms: {error}") from error
    except RecursionError as error:
        raise RoomsFileError("no file of rooms: nested too deeply") from error


def _sheet(note: SheetNote, next_id: int) -> RoomSheet:
    rooms = {room.id: _room(room) for room in note.rooms}
    names = [room.name for room in rooms.values() if room.name]
    if len(set(names)) < len(names):
        raise ValueError("two rooms have one name")
    if max(rooms, default=0) >= next_id:
        raise ValueError("the next number is taken")
    raster, gone = (_raster(each, note.square_m) for each in (note.squares, note.gone))
    there = _numbers(raster)
    if not there <= rooms.keys():
        raise ValueError("squares have numbers of no room")
    if any(room.outline and room.id not in there for room in rooms.values()):
        raise ValueError("a room has an outline, and no squares")
    if max(_numbers(gone), default=0) >= next_id:
        raise ValueError("squares have numbers that are still to come")
    nothing = RoomRaster.empty(note.square_m)
    return RoomSheet(note.frame, raster, gone, nothing, raster, rooms, list(note.cuts))


def _numbers(raster: RoomRaster) -> set[int]:
    return set(np.unique(raster.ids).tolist()) - {0}


def _room(note: RoomNote) -> Room:
    for fault in (*name_faults(note.name or ""), *passes_faults(note.passes)):
        raise fault
    if note.name is not None and LIKE_NUMBER.fullmatch(note.name):
        raise ValueError(f"{note.name!r} is no name")
    if len(note.outline) in (1, 2):
        raise ValueError("an outline has three corners or more")
    _check_finite([note.area_m2])
    passes, kinds = (None, ()) if note.passes is None else passes_of(note.passes)
    settings = RoomSettings(passes, kinds, note.skip, note.priority)
    outline: Sequence[Point] = note.outline
    return Room(
        *(note.id, note.name or "", note.by_hand, settings),
        *(tuple(outline), note.area_m2, tuple(note.neighbours), tuple(note.encloses)),
    )


def _check_finite(values: Iterable[float]) -> None:
    if not all(map(math.isfinite, values)):
        raise ValueError("a number is not finite")


def _raster(note: RasterNote, square_m: float) -> RoomRaster:
    count = note.rows * note.cols
    if count > MOST_SQUARES:
        raise ValueError(f"at most {MOST_SQUARES} squares, got {note.rows} x {note.cols}")
    unpacking = zlib.decompressobj()
    # One byte more than expected, to detect longer data.
    octets = unpacking.decompress(note.ids, 2 * count + 1)
    if len(octets) != 2 * count or not unpacking.eof or unpacking.unused_data:
        raise ValueError(f"squares of {note.rows} x {note.cols} need {2 * count} bytes")
    ids = np.frombuffer(octets, "<u2").astype(np.uint16).reshape(note.rows, note.cols)
    window = Window(note.row0, note.col0, note.row0 + note.rows, note.col0 + note.cols)
    return RoomRaster(square_m, window, ids)
