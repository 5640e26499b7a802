"""Output files, written atomically: only a complete file replaces an older one."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
