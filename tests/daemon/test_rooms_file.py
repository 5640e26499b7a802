"""The file of rooms: read as it was written, whatever else lies in its place."""

from __future__ import annotations

import base64
import errno
import json
import os
import zlib

import numpy as np
import pytest

from fasaco_edge.daemon.ledger import rooms_file
from fasaco_edge.daemon.ledger.rooms_file import (
    PERIOD_S,
    RoomsFile,
    RoomsKeeper,
    decode_rooms,
    encode_rooms,
)
from fasaco_edge.errors import RoomsFileError
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.rooms import FoundRooms
from fasaco_edge.mission.rooms.room_book import RoomBook, RoomSettings
from fasaco_edge.mission.rooms.room_edits import split
from fasaco_edge.mission.rooms.room_matching import HOLD_CHANGE
from fasaco_edge.mission.rooms.room_watch import update
from fasaco_edge.planners.passes import Pass


def found():
    labels = np.ones((30, 60), np.int32)
    labels[:, 40:] = 2
    return FoundRooms(GridGeometry(*labels.shape, 0.1, Pose2D(-2.0, 1.0)), labels, 2)


def two_rooms(frame="map"):
    book = RoomBook()
    for _ in range(HOLD_CHANGE):
        update(book, found(), frame)
    return book


def full():
    book = two_rooms("downstairs")
    for _ in range(HOLD_CHANGE):
        update(book, found(), "map")
    numbers = [room.id for room in book.rooms]
    book.name(numbers[0], "küche")
    kinds = Pass("edge"), Pass(angle_deg=30.0, speed_m_s=0.2), Pass(lanes="cross")
    book.set(numbers[1], RoomSettings(3, kinds, skip=True, priority=80))
    split(book, "küche", ((0.0, 0.0), (0.0, 5.0)))
    return book


def written(book):
    return encode_rooms(book)


def test_a_written_book_of_rooms_is_read_back():
    book = full()
    again = decode_rooms(written(book))
    assert [sheet.frame for sheet in again.sheets] == ["map", "downstairs"]
    assert again.rooms == book.rooms
    assert again.sheets[1].rooms == book.sheets[1].rooms
    assert again.sheet.cuts == book.sheet.cuts
    assert again.next_id == book.next_id == 6
    assert written(again) == written(book)
    # It goes on as if nothing had been: the same map changes nothing.
    update(again, found(), "map")
    assert again.rooms == book.rooms


def raster(ids, rows=1, cols=2):
    packed = zlib.compress(np.array(ids, "<u2").tobytes())
    octets = base64.b64encode(packed).decode()
    return {"row0": 0, "col0": 0, "rows": rows, "cols": cols, "ids": octets}


ROOM = {"id": 1, "name": "a"}
SHEET = {
    "frame": "map",
    "square_m": 0.1,
    "squares": raster([1, 0]),
    "gone": raster([], 0, 0),
    "rooms": [ROOM],
    "cuts": [],
}


def document(**members):
    return {"version": 1, "next_id": 2, "sheets": [SHEET | members]}


BOMB = base64.b64encode(zlib.compress(bytes(10_000_000))).decode()
WRONG = [
    (b"", "truncated"),
    (b"\xff\xfe", ""),
    (b"[]", "Expected `object`"),
    (b"[" * 100_000, ""),
    ({"version": 2, "next_id": 1, "sheets": []}, "version"),
    ({"version": 1, "next_id": 0, "sheets": []}, "next_id"),
    ({"version": 1, "next_id": 1, "sheets": [SHEET] * 9}, "length"),
    ({"version": 1, "next_id": 1, "sheets": [SHEET]}, "next number is taken"),
    (document(more=1), "unknown field"),
    (document(square_m=0.0), "square_m"),
    (document(rooms=[ROOM, ROOM | {"id": 1}]), "one number"),
    ({"version": 1, "next_id": 2, "sheets": [SHEET, SHEET | {"frame": "up"}]}, "one number"),
    (document(rooms=[]), "numbers of no room"),
    (document(rooms=[ROOM | {"name": " a"}]), "printable"),
    (document(rooms=[ROOM | {"name": "room 3"}]), "is no name"),
    (document(rooms=[ROOM | {"name": "2"}]), "is no name"),
    (document(rooms=[ROOM | {"id": 70_000}]), "id"),
    (document(rooms=[ROOM | {"passes": ["rest"]}]), "rest goes after"),
    (document(rooms=[ROOM | {"outline": [[0, 0], [1, 0]]}]), "three corners"),
    (
        document(squares=raster([0, 0]), rooms=[ROOM | {"outline": [[0, 0], [1, 0], [1, 1]]}]),
        "no squares",
    ),
    (document(rooms=[ROOM | {"outline": [[0, 0], [1, 0], [1e300, 0]]}]), "outline"),
    (document(cuts=[[[0, 0]]]), "cuts"),
    (document(squares=raster([1])), "need 4 bytes"),
    (document(squares=raster([1, 0, 0])), "need 4 bytes"),
    (document(squares=raster([1, 9])), "numbers of no room"),
    (document(gone=raster([1, 9])), "still to come"),
    (document(squares=raster([1, 0]) | {"ids": "AAAA"}), "decompressing"),
    (document(squares=raster([1, 0]) | {"ids": BOMB}), "need 4 bytes"),
    (document(squares=raster([1, 0], 1_000_000, 1_000_000)), "at most"),
    (document(squares=raster([1, 0]) | {"row0": 2**40}), "row0"),
]


@pytest.mark.parametrize(("payload", "why"), WRONG)
def test_an_invalid_file_of_rooms_is_refused_as_a_whole(payload, why):
    octets = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
    with pytest.raises(RoomsFileError, match="no file of rooms") as refused:
        decode_rooms(octets)
    assert why in str(refused.value)


def test_no_altered_byte_breaks_the_reader():
    """A byte more, less, or another: it is refused, or other rooms; nothing else."""
    octets, random = written(full()), np.random.default_rng(1)
    for at in random.integers(0, len(octets), 300).tolist():
        for altered in (
            octets[:at],
            octets[:at] + bytes([octets[at] ^ 1 << int(random.integers(8))]) + octets[at + 1 :],
            octets[:at] + b"0" + octets[at:],
        ):
            try:
                again = decode_rooms(altered)
            except RoomsFileError:
                continue
            update(again, found(), "map")


def kept(folder):
    return sorted(path.name for path in folder.iterdir())


def test_changes_are_written_and_restored(tmp_path):
    keeper = RoomsKeeper(RoomsFile(tmp_path, "robot"))
    for _ in range(HOLD_CHANGE):
        update(keeper.book, found(), "map")
    keeper.keep(0.0)
    keeper.book.name(1, "kitchen")
    keeper.keep(0.5 * PERIOD_S)
    assert not keeper.take_faults()
    # A command does not wait for the next period.
    keeper.keep(0.5 * PERIOD_S, at_once=True)
    while not keeper.is_kept(0.5 * PERIOD_S):
        pass
    again = RoomsKeeper(RoomsFile(tmp_path, "robot"))
    assert again.book.room("kitchen").id == 1
    assert again.restored
    keeper.book.name(2, "hall")
    keeper.close(5.0)
    assert RoomsKeeper(RoomsFile(tmp_path, "robot")).book.room("hall").id == 2
    assert kept(tmp_path) == ["robot.rooms.json"]


def test_without_rooms_nothing_is_written(tmp_path):
    keeper = RoomsKeeper(RoomsFile(tmp_path / "state", "robot"))
    keeper.keep(0.0)
    keeper.close(1.0)
    assert not (tmp_path / "state").exists()


def test_a_broken_file_is_set_aside_and_the_daemon_continues(tmp_path):
    (tmp_path / "robot.rooms.json").write_bytes(b"{")
    keeper = RoomsKeeper(RoomsFile(tmp_path, "robot"))
    (fault,) = keeper.take_faults()
    assert fault.code == "rooms_file"
    assert "kept as robot.rooms.json.broken-" in str(fault)
    assert keeper.book.rooms == ()
    (name,) = kept(tmp_path)
    assert (tmp_path / name).read_bytes() == b"{"


def test_a_file_that_could_not_be_set_aside_is_not_overwritten(tmp_path, monkeypatch):
    (tmp_path / "robot.rooms.json").write_bytes(b"{")
    with monkeypatch.context() as patched:
        patched.setattr(rooms_file, "move_aside", read_only)
        keeper = RoomsKeeper(RoomsFile(tmp_path, "robot"))
    (fault,) = keeper.take_faults()
    assert str(fault).endswith("; Read-only file system")
    for _ in range(HOLD_CHANGE):
        update(keeper.book, found(), "map")
    keeper.close(5.0)
    aside, name = sorted(kept(tmp_path), key=len, reverse=True)
    assert (tmp_path / aside).read_bytes() == b"{"
    assert decode_rooms((tmp_path / name).read_bytes()).rooms == keeper.book.rooms


def read_only(*_):
    raise OSError(errno.EROFS, os.strerror(errno.EROFS))


def test_a_file_that_appears_after_the_start_is_not_overwritten(tmp_path):
    """On a disk that is mounted late."""
    keeper = RoomsKeeper(RoomsFile(tmp_path, "robot"))
    (tmp_path / "robot.rooms.json").write_bytes(written(full()))
    for _ in range(HOLD_CHANGE):
        update(keeper.book, found(), "map")
    keeper.close(5.0)
    (aside,) = (name for name in kept(tmp_path) if ".unread-" in name)
    assert decode_rooms((tmp_path / aside).read_bytes()).room("küche")
