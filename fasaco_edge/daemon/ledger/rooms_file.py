"""Rooms on disk: a file beside the ledger, written by a thread of its own when rooms change.

A new file is written beside the old one, fsynced, and renamed over it: at every moment there is a
complete one. A file that cannot be read is set aside, and the rooms begin anew.
"""

from __future__ import annotations

import logging
import os
import threading
from collections import deque
from pathlib import Path

from fasaco_edge.daemon.figures import log_fault
from fasaco_edge.daemon.ledger.file import move_aside, reason_of
from fasaco_edge.daemon.ledger.rooms_codec import (
    MOST_BYTES,
    BookSnapshot,
    decode_rooms,
    encode_rooms,
)
from fasaco_edge.errors import FasacoError, RoomsFileError
from fasaco_edge.host.durable import make_folder, sync_folder, write_through
from fasaco_edge.host.files import read_own
from fasaco_edge.mission.map.room_book import RoomBook

LOG = logging.getLogger(__name__)

# Least time between two writes without a command that waits [s]: memory cards wear out.
PERIOD_S = 5.0
# Time before a retry after a failure, and longest wait of a command for the disk [s].
RETRY_S, MOST_WAIT_S = 2.0, 1.0


class RoomsFile:
    """The file of a robot's rooms.

    Attributes:
        path: its name.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        self.path = folder / f"{robot}.rooms.json"
        self._new = folder / f"{robot}.rooms.json.new"
        # Why a file that was not read is set aside before the first write; "" for no such file.
        self._unwanted = ""

    def load(self) -> tuple[bytes, RoomBook, RoomsFileError | None]:
        """Return the file's bytes, the rooms in it, and the fault, if any; b"" without a file."""
        try:
            payload = read_own(self.path, MOST_BYTES)
            return payload, decode_rooms(payload), None
        except (FileNotFoundError, NotADirectoryError):
            # One that appears later, on a disk mounted late, is not overwritten.
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
            OSError: the write failed; the file before is intact.
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
        # Otherwise it may have its old name after a power failure.
        sync_folder(self.path.parent)
        return name


class RoomsKeeper:
    """Keeps the rooms of a daemon, through all its missions.

    Attributes:
        book: the rooms.
        restored: the bytes of the file that the daemon began with; b"" for none.
    """

    def __init__(self, file: RoomsFile) -> None:
        self.restored, self.book, fault = file.load()
        self._file = file
        self._faults = deque[FasacoError]()
        self._kept, self._kept_at = self.book.version, float("-inf")
        self._changed = threading.Condition()
        self._waiting: BookSnapshot | None = None
        self._trouble = ""
        self._is_ending = False
        # Started with the first change.
        self._thread: threading.Thread | None = None
        if fault is not None:
            self._note(fault)

    def keep(self, now: float, *, at_once: bool = False) -> None:
        """Write the rooms if they have changed; ``at_once``: a command waits for it."""
        if self.book.version == self._kept or (now - self._kept_at < PERIOD_S and not at_once):
            return
        self._kept, self._kept_at = self.book.version, now
        with self._changed:
            self._waiting = BookSnapshot.of(self.book)
            self._changed.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="rooms", daemon=True)
            self._thread.start()

    def is_kept(self, now: float) -> bool:
        """Return whether the last change passed on is on disk, or has waited for long enough."""
        with self._changed:
            is_behind = self._waiting is not None and not self._trouble
        return not is_behind or now - self._kept_at > MOST_WAIT_S

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; they are logged already."""
        return [self._faults.popleft() for _ in range(len(self._faults))]

    def close(self, timeout_s: float) -> None:
        """Write what has changed and end the thread, within ``timeout_s`` [s]."""
        self.keep(float("inf"))
        if self._thread is None:
            return
        with self._changed:
            self._is_ending = True
            self._changed.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        is_failed = False
        while True:
            with self._changed:
                if is_failed:
                    self._changed.wait_for(lambda: self._is_ending, RETRY_S)
                else:
                    self._changed.wait_for(lambda: self._is_ending or self._waiting is not None)
                book, is_ending = self._waiting, self._is_ending
            is_failed = book is not None and not self._write(book)
            with self._changed:
                if not is_failed and self._waiting is book:
                    self._waiting = None
                if is_ending and (is_failed or self._waiting is None):
                    return

    def _write(self, book: BookSnapshot) -> bool:
        try:
            self._file.write(encode_rooms(book))
        except Exception as error:
            # No failure here may stop the mission.
            text = f"cannot write {self._file.path}: {reason_of(error)}"
            if text != self._trouble:
                self._trouble = text
                hint = "rooms are kept in memory, and writing is retried; see ledger.fault, too"
                self._note(RoomsFileError(text, hint=hint))
            return False
        self._trouble = ""
        return True

    def _note(self, fault: FasacoError) -> None:
        log_fault(LOG, fault)
        self._faults.append(fault)
