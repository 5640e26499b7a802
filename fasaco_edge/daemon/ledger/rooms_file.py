"""Rooms on disk: a file beside the ledger, written when rooms change.

It is JSON with a version; squares of rooms are base64 of zlib. No content is trusted: a file that
``encode_rooms`` cannot have written is refused as a whole, set aside, and the daemon begins without
rooms. A new file is written beside the old one, fsynced, and renamed over it, so that a complete
file exists at every moment.
"""

from __future__ import annotations

import logging
import math
import os
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from fasaco_edge.daemon.ledger.disk_writer import MOST_WAIT_S, DiskWriter
from fasaco_edge.daemon.ledger.file import move_aside, reason_of
from fasaco_edge.errors import FasacoError, OrderError, RoomsFileError
from fasaco_edge.grid.geometry import (
    FARTHEST_M,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
    MOST_INDEX,
    Point,
    Window,
)
from fasaco_edge.host.durable import make_folder, sync_folder, write_through
from fasaco_edge.host.files import read_own
from fasaco_edge.mission.orders.keep_outs import PlaceName, name_faults
from fasaco_edge.mission.orders.passes import Passes, passes_document, passes_faults, passes_of
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY, Priority
from fasaco_edge.mission.rooms.room_book import (
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
from fasaco_edge.mission.rooms.room_raster import MOST_SQUARES, RoomRaster

MOST_BYTES = 16_000_000
"""Limit on the bytes of a file; longer files are not read."""
MOST_CORNERS = 1000
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
    outline: Annotated[list[_Corner], Meta(max_length=MOST_CORNERS)] = []
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


LOG = logging.getLogger(__name__)

# Least time between two writes that no command waits for [s], as memory cards wear out.
PERIOD_S = 5.0


class RoomsFile:
    """The file of a robot's rooms.

    Attributes:
        path: its name.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        self.path = folder / f"{robot}.rooms.json"
        self._new = folder / f"{robot}.rooms.json.new"
        # Why an unread file is to be set aside before the first write; "" for no such file.
        self._unwanted = ""

    def load(self) -> tuple[bytes, RoomBook, RoomsFileError | None]:
        """Return the file's bytes, the rooms in it, and the fault, if any; b"" without a file."""
        try:
            payload = read_own(self.path, MOST_BYTES)
            return payload, decode_rooms(payload), None
        except (FileNotFoundError, NotADirectoryError):
            # A file that appears later, on a disk mounted late, must not be overwritten.
            self._unwanted = "unread"
            return b"", RoomBook(), None
        except (OSError, RoomsFileError) as error:
            self._unwanted, why = "broken", reason_of(error)
        try:
            kept = f"kept as {self._set_aside()}"
        except OSError as error:
            kept = reason_of(error)
        return b"", RoomBook(), RoomsFileError(f"cannot read {self.path}: {why}; {kept}")

    def write(self, payload: bytes) -> None:
        """Write the file; once this returns, it survives a power failure.

        Raises:
            OSError: the write failed; the previous file is intact.
        """
        make_folder(self.path.parent)
        if self._unwanted and os.path.lexists(self.path):
            kept = self._set_aside()
            LOG.warning("the previous file of rooms is kept as %s", kept)
        self._unwanted = ""
        try:
            write_through(self._new, payload)
        except OSError:
            # A partial file only takes space on a disk that may be full.
            self._new.unlink(missing_ok=True)
            raise
        os.replace(self._new, self.path)
        sync_folder(self.path.parent)

    def _set_aside(self) -> str:
        """Rename the file that must not be overwritten; return its new name."""
        name = move_aside(self.path, self._unwanted)
        self._unwanted = ""
        # So that the new name survives a power failure.
        sync_folder(self.path.parent)
        return name


class RoomsKeeper:
    """Keeps the rooms of a daemon over all its missions.

    Attributes:
        book: the rooms.
        restored: the file's bytes when the daemon began; b"" for none.
    """

    def __init__(self, file: RoomsFile) -> None:
        self.restored, self.book, fault = file.load()
        self._path = file.path
        self._writer = DiskWriter[RoomBook](
            "rooms", lambda book: file.write(encode_rooms(book)), self._cannot_write
        )
        self._kept, self._kept_at = self.book.version, float("-inf")
        if fault is not None:
            self._writer.note(fault)

    def keep(self, now: float, *, at_once: bool = False) -> None:
        """Write the rooms if they have changed; ``at_once``: a command waits for it."""
        if self.book.version == self._kept or (now - self._kept_at < PERIOD_S and not at_once):
            return
        self._kept, self._kept_at = self.book.version, now
        self._writer.put(snapshot_of(self.book))

    def is_kept(self, now: float) -> bool:
        """Return whether the last change is on disk, or its timeout is over."""
        return not self._writer.is_behind() or now - self._kept_at > MOST_WAIT_S

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; they are logged already."""
        return self._writer.take_faults()

    def close(self, timeout_s: float) -> None:
        """Write pending changes, within ``timeout_s`` [s]."""
        self.keep(float("inf"))
        self._writer.close(timeout_s)

    def _cannot_write(self, error: Exception) -> RoomsFileError:
        return RoomsFileError(
            f"cannot write {self._path}: {reason_of(error)}",
            hint="rooms are kept in memory, and writing is retried; see ledger.fault, too",
        )
