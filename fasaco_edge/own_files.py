"""Files this process writes: its own, never what somebody put in their place."""

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
            if status.st_uid != os.geteuid():
                raise PermissionError(errno.EPERM, "another user has put it there", str(path))
            if flags & os.O_TRUNC:
                os.ftruncate(descriptor, 0)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
