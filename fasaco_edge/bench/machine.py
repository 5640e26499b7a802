"""Placement of processes (cores, niceness, CPU weight), and the machine that figures come from."""

from __future__ import annotations

import os
import platform
import resource
import time
from collections.abc import Iterator, Set
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fasaco_edge import __version__

CGROUPS = Path("/sys/fs/cgroup")
# cgroups(7): a weight of 100 of version 2 is 1024 shares of version 1.
SHARES_OF_WEIGHT = 1024 / 100


def cpu_seconds(pid: int) -> float:
    """Return how long a process and its threads have run [s], those that ended included."""
    # clock_getcpuclockid(3): the clock of a process is made of its id.
    return time.clock_gettime((~pid << 3) | 2)


def place(pid: int, cores: Set[int], niceness: int) -> None:
    """Let all threads of a process run on these cores, and as nicely.

    Threads that it starts later do as those that start them.
    """
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(ProcessLookupError):
            os.sched_setaffinity(int(task.name), cores)
            os.setpriority(os.PRIO_PROCESS, int(task.name), niceness)


@contextmanager
def weighed(pid: int, weight: int) -> Iterator[str]:
    """Put a process into a control group of its own for the block; say which, "" for none.

    Like ``CPUWeight`` of a unit; only root may, and only where there are control groups.
    """
    name = f"fasaco-bench-{os.getpid()}"
    shares = round(weight * SHARES_OF_WEIGHT)
    choices = ((CGROUPS, "cpu.weight", weight), (CGROUPS / "cpu", "cpu.shares", shares))
    for parent, file, value in choices:
        group = parent / name
        if not _is_made(group, file, str(value), pid):
            continue
        try:
            yield f"{file} {value}"
        finally:
            _dissolve(group)
        return
    yield ""


def _is_made(group: Path, file: str, value: str, pid: int) -> bool:
    # With version 1 the folder of all groups is an ordinary one.
    if not (group.parent / "cgroup.procs").exists():
        return False
    try:
        group.mkdir()
    except OSError:
        return False
    try:
        # Opened, not made: without the controller there is no such file.
        for name, text in ((file, value), ("cgroup.procs", str(pid))):
            with (group / name).open("r+", encoding="ascii") as control:
                control.write(text)
    except OSError:
        _dissolve(group)
        return False
    return True


def _dissolve(group: Path) -> None:
    with suppress(OSError):
        for pid in (group / "cgroup.procs").read_text(encoding="ascii").split():
            (group.parent / "cgroup.procs").write_text(pid, encoding="ascii")
        group.rmdir()


def machine() -> dict[str, Any]:
    """Return processor, cores, load, Python and package version as JSON values."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load_1min": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "version": __version__,
    }


def peak_mb() -> float:
    """Return the most memory this process was ever resident with [MB]."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, 1)


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        if name.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()
