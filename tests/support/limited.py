"""A memory limit that the kernel holds, as that of a unit is held: a control group of our own."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path("/sys/fs/cgroup")
UNIT = Path(__file__).parents[2] / "deploy" / "fasaco-edge.service"
# Of version 1 and 2: the folder, the limit, one more that swapping must not get around, the peak.
VERSIONS = (
    (ROOT / "memory", "memory.limit_in_bytes", "memory.memsw.limit_in_bytes"),
    (ROOT, "memory.max", "memory.swap.max"),
)


def unit_limit(name: str = "MemoryMax", unit: Path = UNIT) -> int:
    """Return a limit that a unit sets [bytes]."""
    found = re.search(rf"^{name}=(\d+)M$", unit.read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return int(found[1]) << 20


@dataclass(frozen=True)
class Group:
    """A control group with a limit."""

    folder: Path

    @property
    def program(self) -> tuple[str, ...]:
        """Words before a program that run it in here."""
        join = f'echo $$ >"{self.folder}/cgroup.procs" && exec "$@"'
        return ("sh", "-c", join, "sh")

    @property
    def kills(self) -> int:
        """How many of its processes the kernel has ended for want of memory."""
        for name in ("memory.oom_control", "memory.events"):
            with suppress(OSError):
                text = (self.folder / name).read_text()
                if found := re.search(r"^oom_kill (\d+)$", text, re.MULTILINE):
                    return int(found[1])
        return 0


def why_not() -> str:
    """Return why there can be no such group here; "" if there can."""
    try:
        with memory_group(1 << 30):
            return ""
    except OSError as error:
        return f"no control group that limits memory: {error}"


@contextmanager
def memory_group(limit: int) -> Iterator[Group]:
    """Make a group whose processes may have ``limit`` [bytes] together; remove it afterwards.

    Raises:
        OSError: there is no memory controller, or it is not ours to use.
    """
    folder, name, swap = _version()
    group = folder / f"fasaco-memory-{os.getpid()}-{time.monotonic_ns()}"
    group.mkdir()
    try:
        if not (group / name).exists():
            raise OSError(f"no {name} in {folder}")
        (group / name).write_text(str(limit))
        with suppress(OSError):  # where there is no swap, nothing needs to be said of it
            (group / swap).write_text("0" if swap == "memory.swap.max" else str(limit))
        yield Group(group)
    finally:
        until = time.monotonic() + 10.0
        while group.exists() and time.monotonic() < until:
            with suppress(OSError):
                group.rmdir()
            time.sleep(0.02)


def _version() -> tuple[Path, str, str]:
    if (ROOT / "memory").is_dir():
        return VERSIONS[0]
    if "memory" in (ROOT / "cgroup.subtree_control").read_text().split():
        return VERSIONS[1]
    raise OSError("the memory controller is off")
