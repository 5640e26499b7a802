"""Output files, written atomically: a complete file replaces an older one."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(file: Path) -> Iterator[Path]:
    """Yield the name by which ``file`` is to be written; it is there once the block has ended well.

    Where that fails, as on a full disk, what was there before stays as it was. A link is followed;
    a device or a pipe is written to as it is, and so is a file in a folder that is not.

    Raises:
        OSError: it cannot be put in its place.
    """
    target = Path(os.path.realpath(file))
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        mode = None
    if mode is not None and not (stat.S_ISREG(mode) and os.access(target.parent, os.W_OK)):
        yield file
        return
    # Nobody else can have put something there; by the ending some formats are told.
    new = target.with_name(f".{os.urandom(8).hex()}{target.suffix}")
    try:
        yield new
        if mode is not None:
            new.chmod(stat.S_IMODE(mode))
        new.replace(target)
    except OSError as error:
        if error.filename == os.fspath(new):
            error.filename = os.fspath(file)  # what was asked for
        raise
    finally:
        new.unlink(missing_ok=True)
