"""Files that commands write: looked at before the work begins, so that none is done in vain."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fasaco_edge.errors import BadConfiguration


def check_output(file: Path | None) -> None:
    """Check that ``file`` can be written; None is no file at all.

    Raises:
        BadConfiguration: it is a folder, its folder is missing, or neither may be written to.
    """
    if file is None:
        return
    if file.is_dir():
        raise _unwritable(file, "that is a folder")
    if not file.parent.is_dir():
        raise _unwritable(file, f"there is no folder {file.parent}")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        raise _unwritable(file, "no permission")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Name ``file`` where the block fails to write it, on a full disk, say.

    Raises:
        BadConfiguration: the block raised OSError.
    """
    try:
        yield
    except OSError as error:
        raise _unwritable(file, error.strerror or str(error)) from error


def _unwritable(file: Path, why: str) -> BadConfiguration:
    return BadConfiguration(
        f"cannot write {file}: {why}", hint="name a place that exists and can be written to"
    )
