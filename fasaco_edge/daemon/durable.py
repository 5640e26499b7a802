"""Bytes and names on the disk itself, where a loss of power does not reach them."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from fasaco_edge.own_files import open_own


def write_through(path: Path, payload: bytes) -> None:
    """Write a file; its bytes are on the disk when this returns.

    Raises:
        OSError: that failed.
    """
    with open(path, "wb", opener=open_own) as file:
        file.write(payload)
        file.flush()
        os.fsync(file.fileno())


def make_folder(folder: Path) -> None:
    """Make a folder, and what is missing above it.

    Raises:
        OSError: that failed.
    """
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
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
