"""Scratch folder: where numba keeps what this process alone compiles."""

from __future__ import annotations

import atexit
import errno
import fcntl
import functools
import os
import shutil
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path

from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels.folder import temporary_folder, unguessable

# Folders of code for one process alone: how their names begin, and the age by which their process
# has surely locked them [s].
SCRATCH, SURE_S = "fasaco-edge-scratch-", 60.0


@functools.cache
def scratch_folder() -> str:
    """Return the folder, which is removed with the process.

    Raises:
        PermissionError: other users could write there.
    """
    base = temporary_folder()
    if why := why_not_trusted(unguessable(base)):
        raise PermissionError(errno.EPERM, f"no folder for what is compiled: {why}", str(base))
    _remove_left(base)
    folder, maker = tempfile.mkdtemp(prefix=SCRATCH, dir=base), os.getpid()
    with suppress(OSError):  # a disk without locks
        fcntl.flock(os.open(folder, os.O_RDONLY), fcntl.LOCK_SH)  # until the process has ended

    def clear() -> None:
        # A forked process must not remove the folder.
        if os.getpid() == maker:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(clear)
    return folder


def _remove_left(base: Path) -> None:
    """Remove the folders that killed processes of this user left: no process locks them."""
    for left in base.glob(f"{SCRATCH}*"):
        with suppress(OSError), ExitStack() as held:
            opened = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            held.callback(os.close, opened)
            about = os.fstat(opened)
            if about.st_uid == os.geteuid() and time.time() - about.st_mtime > SURE_S:
                fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left, ignore_errors=True)
