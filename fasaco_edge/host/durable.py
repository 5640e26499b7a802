"""Durable writes: bytes and names that survive a power failure (fsync)."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from fasaco_edge.host.files import open_own


def write_through(path: Path, payload: bytes, *, mode: int = 0o644) -> None:
    """Write a file; its bytes are on the disk when this returns.

    Args:
        path: the file.
        payload: what is to be in it.
        mode: who may read and write a file that is new, less what the umask takes away.

    Raises:
        OSError: that failed.
    """
    with open(path, "wb", opener=lambda name, flags: open_own(name, flags, mode)) as file:
        file.write(payload)
        file.flush()
        os.fsync(file.fileno())


def make_folder(folder: Path, *, mode: int = 0o777) -> None:
    """Make a folder, and what is missing above it.

    Args:
        folder: its path.
        mode: who may enter and write those that are new, less what the umask takes away.

    Raises:
        OSError: that failed.
    """
    if folder.is_dir():
        return
    make_folder(folder.parent, mode=mode)
    folder.mkdir(mode=mode, exist_ok=True)
    sync_folder(folder.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder written to the disk.

    Raises:
        OSError: that failed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network disks know no such thing.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)
