"""What happens to the files of a kernel cache: by loss of power, worn cards and other users."""

from __future__ import annotations

import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fasaco_edge.kernels.manifest import LOCK, MANIFEST

# Whoever else is on this computer.
NOBODY = 65534
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")


def kernel_files(folder: Path) -> list[Path]:
    """Return all files of compiled kernels in a folder; what is noted of them comes last."""
    files = (file for file in folder.iterdir() if file.name != LOCK)
    return sorted(files, key=lambda file: (file.name == MANIFEST, file.name))


def cut(at: float | int) -> Callable[[Path], None]:
    """Cut a file off: at a byte (from the end, where negative), or at a share of its length."""

    def harm(file: Path) -> None:
        length = file.stat().st_size
        os.truncate(file, round(at * length) if isinstance(at, float) else at % length)

    return harm


def altered(at: float | int) -> Callable[[Path], None]:
    """Turn one bit of a file over: at a byte (from the end, where negative), or at a share."""

    def harm(file: Path) -> None:
        content = bytearray(file.read_bytes())
        content[int(at * len(content)) if isinstance(at, float) else at] ^= 1
        file.write_bytes(content)

    return harm


def zeroed(file: Path) -> None:
    """Leave a file with its length, and nothing in it: its blocks were never written."""
    file.write_bytes(bytes(file.stat().st_size))


class _Mischief:
    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[Callable[[str, int], None], tuple[str, int]]:
        return os.mkdir, (str(self._mark), 0o700)


def other_pickle(file: Path) -> None:
    """Put a pickle in place of what a file holds, of the same length, that leaves a mark."""
    held = file.read_bytes()
    evil = pickle.dumps(_Mischief(mark_of(file)))
    file.write_bytes(evil + held[len(evil) :])


def mark_of(file: Path) -> Path:
    """Return what is there once what ``other_pickle`` left has been unpickled."""
    return file.parent.with_name("unpickled")


def a_folder(file: Path) -> None:
    """Put a folder in its place."""
    file.unlink()
    file.mkdir()


def a_link(file: Path) -> None:
    """Put a link to it in its place."""
    elsewhere = shutil.copy2(file, file.parent.with_name("elsewhere"))
    file.unlink()
    file.symlink_to(elsewhere)


def a_pipe(file: Path) -> None:
    """Put a pipe in its place, that nobody ever writes to."""
    file.unlink()
    os.mkfifo(file, 0o600)


# By a loss of power or a worn card.
HARMS: dict[str, Callable[[Path], None]] = {
    "gone": Path.unlink,
    "empty": cut(0),
    "zeroed": zeroed,
    "cut in the middle": cut(0.5),
    "altered in the middle": altered(0.5),
}
# By somebody.
MISDEEDS: dict[str, Callable[[Path], None]] = {
    "another pickle": other_pickle,
    "a folder": a_folder,
    "a link": a_link,
    "a pipe": a_pipe,
    "its group may write": lambda file: file.chmod(0o660),
    "everybody may write": lambda file: file.chmod(0o602),
}
# For root alone to try.
TAKEN: dict[str, Callable[[Path], None]] = {
    "of another user": lambda file: os.chown(file, NOBODY, NOBODY)
}
