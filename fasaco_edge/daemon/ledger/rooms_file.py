"""Rooms on disk: a file beside the ledger, written when rooms change.

A new file is written beside the old one, fsynced, and renamed over it, so that a complete file
exists at every moment. A file that cannot be read is set aside, and the daemon begins without
rooms.
"""

from __future__ import annotations

import logging
import os
from pathlib import Path

from fasaco_edge.daemon.ledger.disk_writer import MOST_WAIT_S, DiskWriter
from fasaco_edge.daemon.ledger.file import move_aside, reason_of
from fasaco_edge.daemon.ledger.rooms_codec import (
    MOST_BYTES,
    decode_rooms,
    encode_rooms,
    snapshot_of,
)
from fasaco_edge.errors import FasacoError, RoomsFileError
from fasaco_edge.host.durable import make_folder, sync_folder, write_through
from fasaco_edge.host.files import read_own
from fasaco_edge.mission.map.room_book import RoomBook

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
        # Why a file that was not read is set aside before the first write; "" for none.
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
            LOG.warning("the file of rooms before is kept as %s", kept)
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
        restored: the bytes of the file that the daemon began with; b"" for none.
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
