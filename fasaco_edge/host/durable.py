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
        payload: its content.
        mode: permissions of a new file, restricted by the umask.

    Raises:
        OSError: it failed.
    """
    with open(path, "wb", opener=lambda name, flags: open_own(name, flags, mode)) as file:
        file.write(payload)
        file.flush()
        os.fsync(file.fileno())


def make_folder(folder: Path, *, mode: int = 0o777) -> None:
    """Make a folder, and its missing parents.

    Args:
        folder: its path.
        mode: permissions of new folders, restricted by the umask.

    Raises:
        OSError: it failed.
    """
    if folder.is_dir():
        return
    make_folder(folder.parent, mode=mode)
    folder.mkdir(mode=mode, exist_ok=True)
    sync_folder(folder.parent)


def sync_folder(folder: Path) -> None:
    """Write the names in a folder to the disk.

    Raises:
        OSError: it failed.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network disks do not support fsync of folders.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)
