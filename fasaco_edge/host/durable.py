"""Whole files: writes that survive a power failure, and output files that replace complete ones."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fasaco_edge.host.files import open_own


def write_through(path: Path, payload: bytes, *, mode: int = 0o644) -> None:
    """Write a file; its bytes are on the disk when this returns.

    ``mode``: permissions of a new file, restricted by the umask.

    Raises:
        OSError: it failed.
    """
    with open(path, "wb", opener=lambda name, flags: open_own(name, flags, mode)) as file:
        file.write(payload)
        file.flush()
        os.fsync(file.fileno())


def make_folder(folder: Path, *, mode: int = 0o777) -> None:
    """Make a folder, and its missing parents; OSError if that fails.

    ``mode``: permissions of new folders, restricted by the umask.
    """
    if folder.is_dir():
        return
    make_folder(folder.parent, mode=mode)
    folder.mkdir(mode=mode, exist_ok=True)
    sync_folder(folder.parent)


def file_in_place_of(folder: Path) -> Path | None:
    """Return what lies in place of a folder, or of one of its parents; None if it can be made."""
    found = next((each for each in (folder, *folder.parents) if os.path.exists(each)), None)
    return None if found is None or os.path.isdir(found) else found


def sync_folder(folder: Path) -> None:
    """Write the names in a folder to the disk; OSError if that fails."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network disks do not support fsync of folders.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


@contextmanager
def whole(file: Path) -> Iterator[Path]:
    """Yield a name to write to; once the block has succeeded, that file replaces ``file``.

    If the block fails, for instance on a full disk, the previous file stays unchanged. A link is
    followed. Devices, pipes, and files in read-only folders are written to directly.

    Raises:
        OSError: the file cannot be written or replaced.
    """
    target = Path(os.path.realpath(file))
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        mode = None
    if mode is not None and not (stat.S_ISREG(mode) and os.access(target.parent, os.W_OK)):
        yield file
        return
    # The random name cannot exist already; the suffix is kept, as some writers choose the format by
    # it.
    new = target.with_name(f".{os.urandom(8).hex()}{target.suffix}")
    try:
        yield new
        if mode is not None:
            new.chmod(stat.S_IMODE(mode))
        new.replace(target)
    except OSError as error:
        if error.filename == os.fspath(new):
            error.filename = os.fspath(file)  # the requested name
        raise
    finally:
        new.unlink(missing_ok=True)
