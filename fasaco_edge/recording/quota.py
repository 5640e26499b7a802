"""Room for what comes: of a robot's recordings the oldest parts go.

Only parts that a recorder of this robot has named are touched, only where no recorder writes
them, and nothing else that lies in the folder.
"""

from __future__ import annotations

import fcntl
import os
import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Quota:
    """How much the recordings of ``robot`` in a folder may take [bytes]; 0 for no limit."""

    robot: str
    most_bytes: int

    def keep(self, folder: Path, coming: int = 0) -> list[Path]:
        """Delete the oldest parts until ``coming`` bytes more fit; return what was deleted.

        Raises:
            OSError: the folder cannot be read, or a file in it not be deleted.
        """
        if not self.most_bytes:
            return []
        parts = sorted(self._parts(folder))
        total, deleted = sum(size for _, _, size in parts), []
        for _, path, size in parts:
            if total + coming <= self.most_bytes:
                break
            if _delete(path):
                deleted.append(path)
                total -= size
        return deleted

    def _parts(self, folder: Path) -> list[tuple[tuple[str, int, int], Path, int]]:
        """Return of each part its age, run by run, its path and its size [bytes]."""
        named = re.compile(rf"(\d{{8}}T\d{{6}}Z)-{re.escape(self.robot)}(?:-(\d+))?-part(\d+)\.rrd")
        found = []
        for path in folder.iterdir():
            match = named.fullmatch(path.name)
            if match and path.is_file() and not path.is_symlink():
                age = match[1], int(match[2] or 1), int(match[3])
                found.append((age, path, path.stat().st_size))
        return found


def _delete(path: Path) -> bool:
    """Delete a part; False where somebody writes it: they hold a lock on it."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        path.unlink()
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True
