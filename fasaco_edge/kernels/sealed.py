"""Sealed files, which carry the SHA-256 of their content: a damaged one is never used as code.

A power failure leaves files that are empty, truncated or full of zeros, a worn card wrong bytes;
such machine code crashes the process, and a pickle may do anything. So each file begins with a line
that has the digest of the rest, and is checked before a byte of it is used::

    fasaco-edge sealed 9f86d081...\\n
    content

That detects damage, not malice, which could write the digest, too: ``fasaco_edge.host.files``
checks who could have written the file. Reading needs no right to write, as in a folder of root's.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path

from fasaco_edge.host.durable import write_through
from fasaco_edge.host.files import UntrustedFileError, read_trusted

_WORD = b"fasaco-edge sealed "
_HEX = 64
_HEAD = len(_WORD) + _HEX + 1
# A file that is being written.
PARTIAL = ".partial-"


class UnsoundFileError(Exception):
    """A file cannot be used; the text says why, without its name."""


class MissingFileError(UnsoundFileError):
    """There is no such file."""


def _head_of(payload: bytes | memoryview) -> bytes:
    return _WORD + hashlib.sha256(payload).hexdigest().encode() + b"\n"


def read_sealed(file: Path, user: int | None = None) -> memoryview:
    """Return the content of a sealed file, byte for byte as it was written.

    Args:
        file: the file, in a folder that is trusted.
        user: whose it may be, beside root; without it this process's.

    Raises:
        MissingFileError: there is no such file.
        UnsoundFileError: it is damaged or cannot be read, or others could have written it.
    """
    try:
        sealed = read_trusted(file, user)
    except FileNotFoundError:
        raise MissingFileError("is gone") from None
    except OSError as error:
        raise UnsoundFileError(f"cannot be read: {error.strerror}") from error
    except UntrustedFileError as why:
        raise UnsoundFileError(f"is not trusted: {why}") from why
    payload = memoryview(sealed)[_HEAD:]
    if sealed[:_HEAD] != _head_of(payload):
        raise UnsoundFileError("is damaged" if sealed else "is empty")
    return payload


def seal_of(payload: memoryview) -> bytes:
    """Return the seal that ``read_sealed`` found on a payload: another content has another one."""
    return bytes(memoryview(payload.obj)[:_HEAD])


def write_sealed(file: Path, payload: bytes) -> None:
    """Write a sealed file in one step: a reader meanwhile finds the one before it, or none.

    Raises:
        OSError: that failed; the file before it stays.
    """
    # One for each process, so that two may write one file at once.
    partial = file.with_name(f"{file.name}{PARTIAL}{os.getpid()}")
    try:
        remove(partial)  # of a process of the same number, that was killed
        write_through(partial, _head_of(payload) + payload, mode=0o600)
        if file.is_dir():
            remove(file)
        partial.replace(file)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def remove(path: Path) -> None:
    """Remove whatever has this name, if anything.

    Raises:
        OSError: that failed.
    """
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def sweep(folder: Path, pattern: str) -> list[Path]:
    """Remove damaged files, and unfinished ones of processes that have ended.

    Args:
        folder: the folder, which is trusted.
        pattern: of the names of all sealed files that count.

    Returns:
        those files that are sound.

    Raises:
        OSError: something could not be removed.
    """
    for partial in folder.glob(f"*{PARTIAL}*"):
        number = partial.name.rpartition(PARTIAL)[2]
        if not Path("/proc", number).exists():
            remove(partial)
    sound = []
    for file in sorted(folder.glob(pattern)):
        try:
            read_sealed(file)
            sound.append(file)
        except UnsoundFileError as why:
            # What cannot be read now may be sound, and is written again by who needs it. A link
            # cannot be opened either.
            if not isinstance(why.__cause__, OSError) or file.is_symlink():
                remove(file)
    return sound
