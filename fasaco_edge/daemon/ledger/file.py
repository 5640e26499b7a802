"""A robot's ledger on disk: two generations, each complete or absent.

``<robot>.ledger`` is the newest ledger, ``<robot>.ledger.previous`` its predecessor. A new ledger
is written to ``<robot>.ledger.new`` and fsynced, and then the files are renamed: at every moment
one of them is complete, and ``load`` finds the newest. Unusable files are set aside under a name
that contains the reason. For each reason the newest few files and the largest file are kept, except
files without covered cells and swept floor.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.daemon.ledger.codec import MOST_BYTES, decode_ledger, encode_ledger
from fasaco_edge.errors import FasacoError, LedgerFileError, LedgerMismatchError
from fasaco_edge.host.durable import make_folder, sync_folder, write_through
from fasaco_edge.host.files import FileTooLongError, open_own, read_own
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot

# Number of files set aside for one reason that are kept, besides the largest.
KEPT_ASIDE = 3


@dataclass(frozen=True, slots=True)
class LoadedLedger:
    """Result of reading the disk: a ledger or none, and the fault, if any.

    Attributes:
        note: the note of a ledger that has other cells than required; "" for none.
    """

    ledger: LedgerSnapshot | None = None
    fault: FasacoError | None = None
    note: str = ""


def lock_file(folder: Path, robot: str) -> Path:
    """Return the file whose lock keeps other daemons from writing a robot's ledger."""
    return folder / f"{robot}.ledger.lock"


def why_no_lock(name: Path) -> str:
    """Return what lies in place of the lock file, "" for nothing.

    It is not set aside: a ledger must not be written to where another user's link leads.
    """
    kind = "a link" if name.is_symlink() else "a folder" if name.is_dir() else ""
    return f"{kind} lies in place of {name}" if kind else ""


class LedgerFile:
    """The files of one robot in a folder; only one process may use them at a time.

    Attributes:
        path: the newest generation.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        self.path = folder / f"{robot}.ledger"
        self._new = folder / f"{robot}.ledger.new"
        self._previous = folder / f"{robot}.ledger.previous"
        self._generations = (self._new, self.path, self._previous)
        self._lock: int | None = None
        self._exclusive = False
        # Files to rename before the next write; the new names contain the reason.
        self._unwanted: list[tuple[Path, str]] = []
        # Whether the new generation is complete, but not yet renamed.
        self._moving = False

    def lock(self) -> OSError | None:
        """Lock this ledger against other processes until this one ends.

        Returns why it cannot be written at present: its folder is missing or read-only. Without a
        folder the first write locks it.

        Raises:
            LedgerFileError: another process holds the lock.
        """
        self._exclusive = True
        folder = self.path.parent
        try:
            self._take_lock()
            if os.access(folder, os.W_OK):
                return None
            is_read_only = os.statvfs(folder).f_flag & os.ST_RDONLY
        except OSError as error:
            return error
        code = errno.EROFS if is_read_only else errno.EACCES
        return OSError(code, os.strerror(code))

    def load(self, cell_m: float) -> LoadedLedger:
        """Return the newest complete ledger and any fault; finish an interrupted write."""
        broken: dict[Path, str] = {}
        for path in self._generations:
            try:
                ledger = decode_ledger(_read(path), cell_m)
            except (FileNotFoundError, NotADirectoryError):
                continue
            except LedgerMismatchError as error:
                note = _note_of(path)
                fault = self._after_aside(error, self._generations, "mismatch")
                return LoadedLedger(fault=fault, note=note)
            except (OSError, LedgerFileError) as error:
                # An interrupted write is no fault: the previous ledger is intact. But a file that
                # the disk fails to read may be complete.
                if path != self._new or (isinstance(error, OSError) and os.path.lexists(path)):
                    broken[path] = reason_of(error)
                continue
            return LoadedLedger(ledger, self._taken(path, broken))
        if broken:
            lost = LedgerFileError(
                f"no ledger could be read ({_reasons(broken)}): a new one was started",
                hint="everything has to be covered again; check the disk",
            )
            return LoadedLedger(fault=self._after_aside(lost, broken, "broken"))
        # A file that appears later, on a disk mounted late, must not be overwritten.
        self._unwanted = [(path, "unread") for path in (self.path, self._previous)]
        return LoadedLedger()

    def write(self, ledger: LedgerSnapshot) -> list[str]:
        """Write a ledger that survives a power failure; return new names of files set aside.

        Raises:
            LedgerFileError: another process has taken the lock since ``lock``.
            OSError: the write failed; the previous ledger is intact.
        """
        payload = encode_ledger(ledger)
        make_folder(self.path.parent)
        if self._lock is not None and not os.fstat(self._lock).st_nlink:
            # The lock file was deleted, perhaps with its folder: another process could make a new
            # one.
            os.close(self._lock)
            self._lock = None
        if self._exclusive and self._lock is None:
            self._take_lock()
        kept = self._rename_unwanted()
        if self._moving and self._new.exists():
            self._move_on()  # it may be the newest complete ledger
        try:
            write_through(self._new, payload)
        except OSError:
            # A partial file only takes space on a disk that may be full.
            self._new.unlink(missing_ok=True)
            raise
        self._moving = True
        self._move_on()
        return kept

    def set_aside(self, why: str) -> list[str]:
        """Rename the existing files to names that contain ``why``; return the new names.

        Raises:
            OSError: renaming failed; it is retried before the next write.
        """
        self._unwanted = [(path, why) for path in self._generations]
        return self._rename_unwanted()

    def _take_lock(self) -> None:
        make_folder(self.path.parent)
        # The file is not opened for writing: that would keep the disk from turning read-only.
        # Non-blocking: opening a pipe of this name would wait for a writer.
        name = lock_file(self.path.parent, self.path.stem)
        try:
            lock = open_own(name, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            if why := why_no_lock(name):
                raise OSError(error.errno, f"{why}: remove it") from error
            raise
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(lock)
            raise LedgerFileError(
                f"another daemon uses the ledger {self.path}",
                hint="stop it, or give this one another robot.name, mission.state_dir or --state",
            ) from error
        except OSError:
            pass  # there are no locks on this disk
        self._lock = lock

    def _taken(self, path: Path, broken: dict[Path, str]) -> FasacoError | None:
        """Make the file that was read the newest ledger; return the fault of the others, if any."""
        if path == self._new:
            self._moving = True
            try:
                self._move_on()
            except OSError as error:
                return LedgerFileError(f"cannot write {self.path}: {reason_of(error)}")
        if path != self._previous and not broken:
            return None
        fault = LedgerFileError(
            f"resumed from the previous ledger ({_reasons(broken) or f'no {self.path.name}'})",
            hint="the last second or two before the end may be lost; check the disk",
        )
        return self._after_aside(fault, broken, "broken")

    def _after_aside(self, fault: FasacoError, paths: Iterable[Path], why: str) -> FasacoError:
        """Return ``fault`` with the new names of the files."""
        self._unwanted = [(path, why) for path in paths]
        try:
            kept = self._rename_unwanted()
        except OSError as error:
            return type(fault)(f"{fault}; {reason_of(error)}", hint=fault.hint)
        if not kept:
            return fault
        return type(fault)(f"{fault}; kept as {', '.join(kept)}", hint=fault.hint)

    def _rename_unwanted(self) -> list[str]:
        """Rename files that must not be overwritten; return the new names."""
        kept = []
        while self._unwanted:
            path, why = self._unwanted[-1]
            if path.exists() and _is_empty(path):
                path.unlink()
            elif path.exists():
                kept.append(move_aside(path, why))
            self._unwanted.pop()
        if kept:
            # So that the new names survive a power failure.
            sync_folder(self.path.parent)
        return kept[::-1]

    def _move_on(self) -> None:
        """Rename the newest file to the previous, then the new file to the newest.

        After a crash in between, ``load`` finds the new file under its own name.
        """
        if self.path.exists():
            os.replace(self.path, self._previous)
        os.replace(self._new, self.path)
        self._moving = False
        sync_folder(self.path.parent)


def move_aside(path: Path, why: str) -> str:
    """Rename a file that must not be overwritten; return its new name, which contains ``why``.

    Raises:
        OSError: renaming failed.
    """
    aside = _free_name(path, why)
    path.rename(aside)
    _prune(path, why, aside)
    return aside.name


def _reasons(broken: dict[Path, str]) -> str:
    return "; ".join(f"{path.name}: {why}" for path, why in broken.items())


def _read(path: Path) -> bytes:
    try:
        return read_own(path, MOST_BYTES)
    except FileTooLongError as error:
        raise LedgerFileError(str(error.strerror)) from error


def _note_of(path: Path) -> str:
    """Return the note of a ledger, regardless of its cells; "" if it cannot be read."""
    with contextlib.suppress(OSError, FasacoError):
        return decode_ledger(_read(path), None).note
    return ""


def _is_empty(path: Path) -> bool:
    with contextlib.suppress(OSError, FasacoError):
        return decode_ledger(_read(path), None).is_empty
    return False


def _prune(path: Path, why: str, newest: Path) -> None:
    """Delete files set aside for the reason ``why``, except the newest few and the largest."""
    older = [other for other in _aside(path, why).values() if other != newest]
    largest = max([*older, newest], key=lambda other: other.stat().st_size)
    for other in older[: 1 - KEPT_ASIDE]:
        if other != largest:
            other.unlink()


def _free_name(path: Path, why: str) -> Path:
    """Return a name with the time, and a number that gives the order even if the clock jumps."""
    moment = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    number = max((number for number, _, _ in _aside(path, why)), default=0) + 1
    return path.with_name(f"{path.name}.{why}-{moment}" + (f"-{number}" if number > 1 else ""))


def _aside(path: Path, why: str) -> dict[tuple[int, str, str], Path]:
    """Return the files set aside for one reason by number, time and name, oldest first."""
    form = re.compile(re.escape(f"{path.name}.{why}-") + r"(\w+Z)(?:-(\d+))?")
    found = {
        (int(match[2] or 1), match[1], other.name): other
        for other in path.parent.iterdir()
        if (match := form.fullmatch(other.name))
    }
    return dict(sorted(found.items()))


def reason_of(error: Exception) -> str:
    """Return the reason of a failure without the path, which the message names anyway."""
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
