"""Daemons started as a service manager starts them: with a socket on which they say READY."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.support.forked import Forked
from tests.support.processes import ENVIRONMENT, PROGRAM

# As the unit has it; so a run that never gets ready ends.
START_S = 180.0
STOP_S = 10.0


@dataclass
class Service:
    """A daemon that was started.

    Attributes:
        log: where its standard error goes.
    """

    process: subprocess.Popen[bytes] | Forked
    log: Path
    ready: threading.Event

    def wait_ready(self, timeout_s: float = START_S) -> bool:
        """Wait until it says that it is ready; False where it ends, or does not in time."""
        deadline = time.monotonic() + timeout_s
        while not self.ready.wait(0.05):
            if self.process.poll() is not None or time.monotonic() > deadline:
                return False
        return True

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int | None:
        """Ask it to end; return its exit code, None where it did not end."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            return None

    def said(self) -> str:
        """Return what it has said on standard error."""
        return self.log.read_text(errors="replace")


@contextmanager
def service(
    folder: Path, words: Sequence[str], environment: Mapping[str, str] | None = None
) -> Iterator[Service]:
    """Start ``fasaco-edge`` with ``words``; whatever becomes of it, it is gone afterwards.

    Args:
        folder: for its log, ``service.log``.
        words: command and options.
        environment: beside ours; with one it is executed, else forked.
    """
    log = folder / "service.log"
    with (
        tempfile.TemporaryDirectory(prefix="notify-") as place,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard,
        log.open("ab") as stderr,
    ):
        address = f"{place}/socket"
        heard.bind(address)
        ready = threading.Event()
        threading.Thread(target=_listen, args=(heard, ready), daemon=True).start()
        told = ENVIRONMENT | {"NOTIFY_SOCKET": address} | dict(environment or {})
        process: subprocess.Popen[bytes] | Forked
        if environment is None:
            process = Forked((*PROGRAM[1:], *words), told, log, log)
        else:
            # In a session of its own, so that what it has started can be ended with it.
            process = subprocess.Popen(
                [*PROGRAM, *words], stderr=stderr, stdout=stderr, env=told, start_new_session=True
            )
        try:
            yield Service(process, log, ready)
        finally:
            if isinstance(process, Forked):
                process.kill()
            else:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            heard.shutdown(socket.SHUT_RDWR)


def _listen(heard: socket.socket, ready: threading.Event) -> None:
    """Take all that is said, so that nobody waits for us."""
    with suppress(OSError):  # closed
        while word := heard.recv(4096):
            if b"READY=1" in word.split(b"\n"):
                ready.set()


def show(line: str) -> None:
    """Show how far a campaign is: in place of the line before, where that can be."""
    is_terminal = sys.stderr.isatty()
    print(*(["\r", line, "\x1b[K"] if is_terminal else [line]), sep="",
          end="" if is_terminal else "\n", file=sys.stderr, flush=True)  # fmt: skip
