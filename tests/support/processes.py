"""Daemons and commands as separate processes, started as by a user or a service manager."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fasaco_edge.host.addresses import free_port
from tests.support.forked import ENVIRONMENT, OF_MANAGER, Forked, run_forked

# Longest time from SIGTERM to a daemon's end on a busy machine [s]; two seconds on a quiet machine.
STOP_S = 30.0
PROGRAM = (sys.executable, "-m", "fasaco_edge")


def free_endpoint() -> str:
    """Return a free Zenoh endpoint."""
    return f"tcp/127.0.0.1:{free_port()}"


@dataclass
class Daemon:
    """A running daemon."""

    process: subprocess.Popen[bytes] | Forked
    endpoint: str
    log: Path

    @property
    def pid(self) -> int:
        """Its process id."""
        return self.process.pid

    def log_text(self) -> str:
        """Return its log, which it writes to standard error."""
        return self.log.read_text(errors="replace")

    def stop(self, number: signal.Signals = signal.SIGTERM) -> float:
        """End it by a signal, check that it ends with 0 and in time; return the duration [s]."""
        asked = time.monotonic()
        self.process.send_signal(number)
        try:
            code = self.process.wait(STOP_S)
        except subprocess.TimeoutExpired as error:
            raise AssertionError(f"still there after {STOP_S} s:\n{self.log_text()}") from error
        assert code == 0, f"ended with {code}:\n{self.log_text()}"
        assert "Traceback" not in self.log_text(), self.log_text()
        return time.monotonic() - asked

    def kill(self) -> None:
        """Kill it."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


@contextmanager
def daemon_process(
    folder: Path,
    *words: str,
    env: dict[str, str] | None = None,
    state: bool = True,
    executed: bool = False,
    **sections: Any,
) -> Iterator[Daemon]:
    """Run a daemon with these sections of configuration; end it, and check how it ended.

    Args:
        folder: where its files are written; the next daemon there continues its progress.
        words: further arguments of its command.
        env: additional environment. With variables that a service manager does not set, the daemon
            is started; otherwise it is forked.
        state: whether its progress is kept in ``state`` of ``folder``; False if words or
            configuration give the place.
        executed: whether it is started, not forked, to be measured.
        sections: its configuration.
    """
    # The robots of most tests stand still, and publish their pose once.
    sections.setdefault("mission", {}).setdefault("lost_pose_s", 0.0)
    # Most tests count necessary plans; tests/daemon/test_spare_time.py tests the others.
    sections.setdefault("planner", {}).setdefault("spare_share", 0.0)
    # Most tests count cells; tests/daemon/test_line.py tests the line.
    sections["planner"].setdefault("line", "cells")
    sections.setdefault("bus", {}).setdefault("listen", [free_endpoint()])
    endpoint = [*sections["bus"]["listen"], *sections["bus"].get("connect", ())][0]
    number = len(list(folder.glob("daemon*.yaml")))
    config, log = folder / f"daemon{number}.yaml", folder / f"daemon{number}.log"
    config.write_text(yaml.safe_dump(sections))
    command = [*PROGRAM, "run", "--config", str(config), *words]
    if state and "--state" not in words:
        command += ["--state", str(folder / "state")]
    log.touch()
    process: subprocess.Popen[bytes] | Forked
    environment = ENVIRONMENT | (env or {})
    if set(env or ()).issubset(OF_MANAGER) and not executed:
        process = Forked(tuple(command[1:]), environment, os.devnull, log)
    else:
        with log.open("wb") as stderr:
            process = subprocess.Popen(command, stderr=stderr, env=environment)
    daemon = Daemon(process, endpoint, log)
    try:
        yield daemon
        if process.poll() is None:
            daemon.stop()
        else:
            assert process.returncode in (0, -signal.SIGKILL), daemon.log_text()
    finally:
        daemon.kill()


def mapped_files(pid: int) -> str:
    """Return the names of all files a process has mapped."""
    return Path(f"/proc/{pid}/maps").read_text()


def is_running(pid: int) -> bool:
    """Return whether a process exists and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def slowness(work_s: float = 0.03) -> float:
    """Return the duration of some work over its processor time, now; 1 on a quiet machine."""
    began, worked = time.monotonic(), time.thread_time()
    while time.thread_time() - worked < work_s:
        pass
    return max((time.monotonic() - began) / work_s, 1.0)


COMMAND_S = 1500.0


@dataclass(frozen=True)
class Ended:
    """Exit code and outputs of a command."""

    code: int
    out: str
    err: str


def fasaco_edge(*words: object) -> Ended:
    """Run a command to its end, in a forked process; fail on a traceback."""
    command = (*PROGRAM[1:], *(str(word) for word in words))
    ended = Ended(*run_forked(command, ENVIRONMENT, COMMAND_S))
    assert "Traceback" not in ended.err, ended.err
    return ended
