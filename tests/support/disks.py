"""Small disks, to test a full disk."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[Path]:
    """Mount a tmpfs of a size, such as 24m, at ``folder``; yield the folder.

    Raises:
        PermissionError: this process has no right to mount.
    """
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        raise PermissionError("no right to mount a disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def disk_fixture(size: str) -> Any:
    """Return a fixture: a disk of a size; it skips the test without the right to mount."""

    @pytest.fixture
    def disk(tmp_path: Path) -> Iterator[Path]:
        folder = tmp_path / "disk"
        folder.mkdir()
        try:
            with small_disk(folder, size):
                yield folder
        except PermissionError as error:
            pytest.skip(str(error))

    return disk
