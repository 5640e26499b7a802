"""Disk space for recordings: names and age of runs, deletion of old parts, free space.

A run's name begins with a number above the highest existing one, as clocks may go backward (at each
boot without a clock battery). Only parts of this robot's recordings are deleted, but none that is
still being written.
"""

from __future__ import annotations

import fcntl
import logging
import os
import re
import shutil
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.durable import file_in_place_of
from fasaco_edge.host.processes import MB

NUMBERED = re.compile(r"run(\d{5,9})-.*\.rrd")
# Upper limit of a run's number; a file with a larger number is not from a recorder.
MOST_RUNS = 900_000_000
TIME = "%Y%m%dT%H%M%SZ"
# Free space above the minimum that is required to resume recording [bytes].
RESUME_BYTES = 1_000_000

LOG = logging.getLogger(__name__)


def cannot_record(folder: Path, error: OSError) -> BadConfiguration:
    """Return the error of a folder that cannot be read, made or written to."""
    file = file_in_place_of(folder)
    why = error.strerror or error if file is None else f"{file} is not a folder"
    return BadConfiguration(
        f"cannot record into {folder}: {why}",
        hint="name a folder that may be written to",
    )


def next_run(folder: Path, robot: str, began: datetime) -> str:
    """Return the name of a new run of ``robot``, numbered after all existing ones.

    Raises:
        BadConfiguration: the folder cannot be read.
    """
    try:
        names = os.listdir(folder) if folder.is_dir() else []
    except OSError as error:
        raise cannot_record(folder, error) from error
    runs = [int(match[1]) for match in map(NUMBERED.fullmatch, names) if match]
    newest = max((number for number in runs if number < MOST_RUNS), default=0)
    return f"run{newest + 1:05}-{began:{TIME}}-{robot}"


def delete_oldest(folder: Path, robot: str, most_bytes: int) -> list[Path]:
    """Delete the oldest of ``robot``'s parts until they take at most ``most_bytes``; return them.

    Raises:
        OSError: the folder cannot be read, or a file cannot be deleted.
    """
    parts = oldest_first(folder, robot)
    total, deleted = sum(size for _, size in parts), []
    for path, size in parts:
        if total <= most_bytes:
            break
        if _delete(path):
            deleted.append(path)
            total -= size
    return deleted


def oldest_first(folder: Path, robot: str) -> list[tuple[Path, int]]:
    """Return the parts of a robot's recordings, each with its size [bytes], the oldest first.

    Runs of early releases, whose names have no number, come first, in order of their time.

    Raises:
        OSError: the folder cannot be read.
    """
    named = re.compile(rf"(?:run(\d{{5,9}})-)?(\d{{8}}T\d{{6}}Z)-{re.escape(robot)}-part(\d+)\.rrd")
    found = []
    for path in folder.iterdir():
        match = named.fullmatch(path.name)
        if match and path.is_file() and not path.is_symlink():
            run, began, part = match.groups()
            found.append((int(run or 0), began, int(part), path, path.stat().st_size))
    return [(path, size) for *_, path, size in sorted(found)]


def _delete(path: Path) -> bool:
    """Delete a part; return False if a recorder is writing it and holds its lock."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        path.unlink()
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


@dataclass(frozen=True, slots=True)
class DiskBudget:
    """A folder of recordings: limits of parts, of free space and of all recordings.

    Attributes:
        folder: created if missing.
        part_bytes: size at which the next part begins.
        least_free_bytes: space that must stay free on the disk.
        part_s: age at which the next part begins [s]; 0 for never. Rerun's index of a part grows by
            a megabyte a minute until the part's footer is written.
        robot: name of the robot.
        quota_bytes: limit of all its recordings; 0 for none.
    """

    folder: Path
    part_bytes: int
    least_free_bytes: int
    part_s: float = 0.0
    robot: str = ""
    quota_bytes: int = 0

    @property
    def _free_bytes(self) -> int:
        try:
            return shutil.disk_usage(self.folder).free
        except OSError:
            # The folder or its disk is gone: no free space until it is back.
            return 0

    def is_full(self) -> bool:
        """Return whether there is less free space than required."""
        return self._free_bytes < self.least_free_bytes

    def may_begin(self) -> bool:
        """Return whether there is enough space to resume."""
        return self._free_bytes >= self.least_free_bytes + RESUME_BYTES

    def keep_quota(self) -> None:
        """Delete the oldest parts that exceed the quota."""
        if not self.quota_bytes:
            return
        try:
            # Leave space for the part being written.
            deleted = delete_oldest(self.folder, self.robot, self.quota_bytes - self.part_bytes)
        except OSError as error:
            LOG.warning("recordings above their quota stay: %s", error)
            return
        if deleted:
            LOG.info("deleted for the quota: %s", ", ".join(path.name for path in deleted))


def budget_of(config: DaemonConfig, folder: Path, name: str = "") -> DiskBudget:
    """Return the budget of a configuration for recordings of ``name``, by default its robot.

    Raises:
        BadConfiguration: a size is invalid, or the robot's name is no key.
    """
    limits, robot = config.recording, name or config.keys().robot
    if 0 < limits.quota_mb < 2 * limits.part_mb:
        raise BadConfiguration(
            f"a quota has to be 0 or at least two parts, {2 * limits.part_mb} MB, "
            f"got {limits.quota_mb} MB"
        )
    return DiskBudget(
        folder,
        limits.part_mb * MB,
        limits.least_free_mb * MB,
        60.0 * limits.part_min,
        robot,
        limits.quota_mb * MB,
    )
