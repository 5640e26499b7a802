"""Files and folders of this process: its own, never what somebody else put in their place."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path


def open_own(path: str | Path, flags: int, mode: int = 0o644) -> int:
    """Open a file to write it, made where it was not there; return its descriptor.

    A link is not followed, and a plain file of another user is not taken: in a folder that others
    may write to, either may be a trap.

    Raises:
        OSError: that failed, or the file is not ours.
    """
    flags |= os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    # What is there is only emptied once it is known to be ours.
    descriptor = os.open(path, flags & ~os.O_TRUNC, mode)
    try:
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode):
            _check_owner(path, status)
            if flags & os.O_TRUNC:
                os.ftruncate(descriptor, 0)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def read_own(path: str | Path, most: int = -1) -> bytes:
    """Return what is in a plain file of ours, or of root's, that is no link; ``most`` bytes of it.

    Raises:
        OSError: that failed, or it is somebody else's.
    """
    # Where it is no plain file, to open it may wait, or do something.
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        _check_owner(path, status)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "no plain file", str(path))
        return file.read(most)


def make_own_folder(folder: Path) -> None:
    """Make a folder, or take the one there is, if it is ours: nor is a link of somebody's taken.

    Raises:
        OSError: that failed, or it is somebody else's.
    """
    folder.mkdir(exist_ok=True)
    _check_owner(folder, folder.lstat())


def _check_owner(path: str | Path, status: os.stat_result) -> None:
    if status.st_uid not in (os.geteuid(), 0):
        raise PermissionError(errno.EPERM, "another user has put it there", str(path))
