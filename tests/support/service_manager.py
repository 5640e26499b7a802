"""Service manager like systemd: $NOTIFY_SOCKET, and a memory limit by a control group."""

from __future__ import annotations

import os
import re
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.support.outsider import TIMEOUT_S


class Manager:
    """Listens on $NOTIFY_SOCKET."""

    def __init__(self, folder: Path) -> None:
        self.said: list[str] = []
        self.address = str(folder / "notify")
        self._read = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.address)
        self._socket.settimeout(0.05)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def count(self, word: str, seconds: float) -> int:
        """Return the number of notifications ``word`` within the next ``seconds`` [s]."""
        before = len(self.said)
        time.sleep(seconds)
        return self.said[before:].count(word)

    def wait(self, word: str, seconds: float = TIMEOUT_S) -> str:
        """Return the next notification that begins with ``word``."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            for number, text in enumerate(self.said[self._read :], self._read):
                if text.startswith(word):
                    self._read = number + 1
                    return text
            time.sleep(0.02)
        raise AssertionError(f"no {word}, but {self.said[self._read :]}")

    def close(self) -> None:
        self._closed.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closed.is_set():
            with suppress(TimeoutError):
                self.said.append(self._socket.recv(65536).decode())


ROOT = Path("/sys/fs/cgroup")
UNIT = Path(__file__).parents[2] / "deploy" / "fasaco-edge.service"
# For control groups version 1 and 2: the folder, the memory limit, the limit with swap.
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
        """Command that runs the program after it in this group."""
        join = f'echo $$ >"{self.folder}/cgroup.procs" && exec "$@"'
        return ("sh", "-c", join, "sh")

    @property
    def kills(self) -> int:
        """Number of its processes that the kernel has killed for lack of memory."""
        for name in ("memory.oom_control", "memory.events"):
            with suppress(OSError):
                text = (self.folder / name).read_text()
                if found := re.search(r"^oom_kill (\d+)$", text, re.MULTILINE):
                    return int(found[1])
        return 0


def why_not() -> str:
    """Return why this computer allows no such group; "" if it does."""
    try:
        with memory_group(1 << 30):
            return ""
    except OSError as error:
        return f"no control group that limits memory: {error}"


@contextmanager
def memory_group(limit: int) -> Iterator[Group]:
    """Make a group whose processes may have ``limit`` [bytes] together; remove it afterwards.

    Raises:
        OSError: there is no memory controller, or no right to use it.
    """
    folder, name, swap = _version()
    group = folder / f"fasaco-memory-{os.getpid()}-{time.monotonic_ns()}"
    group.mkdir()
    try:
        if not (group / name).exists():
            raise OSError(f"no {name} in {folder}")
        (group / name).write_text(str(limit))
        with suppress(OSError):  # without swap, this file is missing
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
