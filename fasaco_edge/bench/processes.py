"""Daemon in a process of its own, and a session with it."""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self

import yaml

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable, ProcessEnded
from fasaco_edge.host.addresses import free_port
from fasaco_edge.host.processes import python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys

# Timeouts, long enough for a busy computer [s].
START_TIMEOUT_S = 180.0
STOP_TIMEOUT_S = 8.0
LOOK_EVERY_S = 0.002
PROGRAM = python_program("fasaco_edge")


def warm_kernels() -> None:
    """Compile missing kernels into the cache, so that no daemon compiles.

    Another process compiles them: this one stays as small as a client on the bus.

    Raises:
        ProcessEnded: compiling failed.
    """
    warmup = [*PROGRAM, "warmup"]
    if subprocess.run([*warmup, "--check"], check=False, capture_output=True).returncode == 0:
        return
    try:
        subprocess.run(warmup, check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        raise ProcessEnded(f"warmup ended with {error.returncode}:\n{error.stderr}") from error


class DaemonProcess:
    """``fasaco-edge run`` on a free port of loopback: started on entry, ended on exit.

    Attributes:
        keys: its keys.
        endpoint: the endpoint that it listens at.
    """

    def __init__(self, config: dict[str, Any] | None = None) -> None:
        self.keys = Keys()
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self._config = {**(config or {}), "bus": {"listen": [self.endpoint]}}
        self._ends = ExitStack()

    def __enter__(self) -> Self:
        folder = Path(self._ends.enter_context(tempfile.TemporaryDirectory(prefix="fasaco-bench-")))
        file, self._log = folder / "config.yaml", folder / "daemon.log"
        file.write_text(yaml.safe_dump(self._config), encoding="utf-8")
        words = ("run", "--config", str(file), "--state", str(folder / "state"))
        self._started = time.monotonic()
        self._process = self._ends.enter_context(_running(words, self._log))
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.close()

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def join(self) -> Bus:
        """Return a session with the daemon, as soon as it listens.

        Raises:
            ProcessEnded: the daemon has ended.
            BusUnavailable: it does not listen in time.
        """
        host, _, port = self.endpoint.removeprefix("tcp/").partition(":")
        # Refused connections do not slow down the starting daemon.
        while not _listens(host, int(port)):
            self._wait("listen at " + self.endpoint)
        return self._ends.enter_context(open_bus(BusSettings("client", (self.endpoint,))))

    def wait_alive(self, bus: Bus) -> float:
        """Wait for its liveliness token; return the time since its start [s]."""
        while not bus.alive(self.keys.of(topics.ALIVE)):
            self._wait("say that it is alive")
        return time.monotonic() - self._started

    def wait_status(self, bus: Bus) -> float:
        """Wait until it replies with a status; return the time since its start [s]."""
        while not any(not reply.is_error for reply in bus.get(self.keys.rpc("status"))):
            self._wait("answer with a status")
        return time.monotonic() - self._started

    def check(self) -> None:
        """Raise ProcessEnded if it has ended."""
        if (code := self._process.poll()) is not None:
            raise ProcessEnded(f"the daemon ended with {code}:{_last_lines(self._log)}")

    def _wait(self, for_it_to: str) -> None:
        self.check()
        if time.monotonic() - self._started > START_TIMEOUT_S:
            raise BusUnavailable(f"the daemon did not {for_it_to} in {START_TIMEOUT_S:.0f} s")
        time.sleep(LOOK_EVERY_S)


def _listens(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError:
        return False
    return True


@contextmanager
def _running(words: Sequence[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of this package during the block, with its output in ``log``."""
    with log.open("wb") as output:
        command = [*PROGRAM, *words, "--with-parent", str(os.getpid())]
        process = subprocess.Popen(command, stdout=output, stderr=output)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _last_lines(log: Path) -> str:
    lines = log.read_text(errors="replace").splitlines()[-5:]
    return "".join(f"\n  {line}" for line in lines)
