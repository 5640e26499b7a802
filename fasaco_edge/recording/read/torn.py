"""Repair of recordings torn by a crash: each is truncated after its last complete frame.

A power failure or a full disk leaves a torn frame at the end, and Rerun then refuses the whole
file. A file has a header of 12 bytes, then frames: each is two little-endian u64 (kind, length) and
``length`` bytes; kind 0 is the footer. Rerun never calls fsync, so several frames may be missing.
"""

from __future__ import annotations

import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fasaco_edge.errors import MalformedMessage, UnreadableRecording
from fasaco_edge.host.files import check_plain

MAGIC = b"RRF"
HEADER_BYTES = 12
FRAME = struct.Struct("<QQ")
FOOTER_KIND = 0
LAST_KIND = 3
# After a power failure a file has its full size, and zeros in place of data not yet written. A
# complete frame may also end with a zero, and the data after the footer with three zeros.
MOST_ZEROS = 3
_BLOCK = 65536
HINT = "name the .rrd files that a recorder has written"
DAMAGED_HINT = "the file is damaged: name the other parts of the run without it"


@dataclass(frozen=True, slots=True)
class Scan:
    """The frames of a recording.

    Attributes:
        frames: number of complete frames.
        whole_bytes: size up to the end of the last complete frame [bytes].
        total_bytes: size of the file [bytes].
        has_footer: whether the recording was closed properly.
    """

    frames: int
    whole_bytes: int
    total_bytes: int
    has_footer: bool

    @property
    def torn_bytes(self) -> int:
        """Bytes after the last complete frame."""
        return self.total_bytes - self.whole_bytes


@dataclass(frozen=True, slots=True)
class Repair:
    """A truncated recording and the bytes removed; or why it could not be read."""

    path: Path
    cut_bytes: int
    failed: str = ""

    def __str__(self) -> str:
        if self.failed:
            return f"{self.path.name} could not be checked: {self.failed}"
        return f"{self.path.name} was torn: cut {self.cut_bytes} bytes after the last frame"


def scan_recording(recording: BinaryIO, known_bytes: int = HEADER_BYTES) -> Scan | None:
    """Return the scan of the frames of ``recording``; None if the file is not a recording.

    A file with less than a header, whose writer was killed, counts as a recording without frames.
    The first ``known_bytes`` are header and complete frames, which the scan skips and does not
    count.
    """
    total = os.fstat(recording.fileno()).st_size
    data = _end_of_data(recording, total)
    solid = min(data + MOST_ZEROS, total)
    recording.seek(0)
    header = recording.read(HEADER_BYTES)
    if data < HEADER_BYTES - MOST_ZEROS and MAGIC.startswith(header[: min(data, len(MAGIC))]):
        return Scan(0, 0, total, has_footer=False)
    if len(header) < HEADER_BYTES or not header.startswith(MAGIC):
        return None
    end, frames, has_footer = max(known_bytes, HEADER_BYTES), 0, False
    while not has_footer:
        recording.seek(end)
        head = recording.read(FRAME.size)
        if len(head) < FRAME.size:
            break
        kind, length = FRAME.unpack(head)
        if kind > LAST_KIND or end + FRAME.size + length > solid:
            break
        if kind == FOOTER_KIND and solid < total:
            break  # the data that follow a footer and locate it are zeros
        end += FRAME.size + length
        frames += 1
        has_footer = kind == FOOTER_KIND
    return Scan(frames, end, total, has_footer)


@contextmanager
def open_part(path: Path) -> Iterator[tuple[BinaryIO, Scan]]:
    """Open a part of a recording; add its name to errors raised within the context.

    Raises:
        UnreadableRecording: the file is missing or damaged, or is not a recording.
    """
    try:
        check_plain(path)
        with path.open("rb") as recording:
            scan = scan_recording(recording)
            if scan is None:
                raise UnreadableRecording(f"{path}: this is no recording", hint=HINT)
            yield recording, scan
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror or error}", hint=HINT) from error
    except (ValueError, MalformedMessage) as error:
        raise UnreadableRecording(f"{path}: {error}", hint=DAMAGED_HINT) from error


def _end_of_data(recording: BinaryIO, total: int) -> int:
    """Return the offset at which the zeros at the end of a file begin [bytes]."""
    while total:
        start = max(total - _BLOCK, 0)
        recording.seek(start)
        if solid := recording.read(total - start).rstrip(b"\0"):
            return start + len(solid)
        total = start
    return 0


def repair_recording(path: Path) -> Repair | None:
    """Truncate ``path`` after its last complete frame; None if nothing was torn.

    Left unchanged are a file that a writer has locked, a recording with a footer or without a
    header, and any file that is not a recording.
    """
    with open(path, "r+b", opener=_open_no_link) as recording:
        try:
            fcntl.flock(recording, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None
        scan = scan_recording(recording)
        if scan is None or scan.has_footer or not scan.whole_bytes or not scan.torn_bytes:
            return None
        recording.truncate(scan.whole_bytes)
    return Repair(path, scan.torn_bytes)


def _open_no_link(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW | os.O_CLOEXEC)


def repair_folder(folder: Path) -> list[Repair]:
    """Truncate every torn recording in ``folder``; return the repairs in order of name.

    For a file that cannot be read or truncated, the repair holds the reason: such a file must not
    prevent new recordings.

    Raises:
        OSError: the folder cannot be read.
    """
    repairs = []
    for path in sorted(folder.glob("*.rrd")):
        try:
            is_plain = path.is_file() and not path.is_symlink()
            repair = repair_recording(path) if is_plain else None
        except OSError as error:
            repair = Repair(path, 0, error.strerror or str(error))
        if repair is not None:
            repairs.append(repair)
    return repairs
