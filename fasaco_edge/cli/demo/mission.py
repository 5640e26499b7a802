"""The processes of a demo, daemons with recorders and robots, from start to end."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.console.terminal import command, err
from fasaco_edge.cli.demo.robots import FLEET, DemoRobot, fleet_recorder
from fasaco_edge.cli.demo.view import demo_view
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.addresses import free_port
from fasaco_edge.host.processes import python_program
from fasaco_edge.states import AT_WORK
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys

STOP_TIMEOUT_S = 8.0
RECORDERS_WITHIN_S = 60.0
# Time for which the state must stay "done" [simulated s]: a last map may still arrive.
SETTLE_SIM_S = 3.0
# Names of the logs of programs that end after the robots, as these programs record them.
LAST = ("daemon", "fleet")


@dataclass(frozen=True, slots=True)
class MissionEnding:
    """How the mission ended.

    Attributes:
        statuses: the last status of each daemon.
        wall_s: duration by this computer's clock [s].
        timed_out: whether the time limit ended the demo.
        makespan_s: time from the first robot's start of work to the last robot's end [simulated s].
    """

    statuses: tuple[Status, ...]
    wall_s: float
    timed_out: bool
    makespan_s: float = 0.0


class DemoMission:
    """Starts all processes on entry, ends them on exit."""

    def __init__(self, args: argparse.Namespace, robots: Sequence[DemoRobot]) -> None:
        self._args, self._robots = args, robots
        self._endpoint = f"tcp/127.0.0.1:{free_port()}"
        self._view = demo_view([robot.name for robot in robots], self._endpoint)
        self._processes: list[tuple[Path, subprocess.Popen[bytes]]] = []
        self._stack = ExitStack()
        # Log and arguments of each robot to start; keys of recorders that are not on the bus yet.
        self._waiting: list[tuple[Path, list[str]]] = []
        self._silent: set[str] = set()
        self._newest = [LatestSlot[Sample]() for _ in robots]
        self._statuses = [Status() for _ in robots]
        self._worked_at: list[float] = []
        self._started = 0.0
        self._done_since: float | None = None

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            # The router that connects all processes.
            self._bus = stack.enter_context(open_bus(BusSettings("router", (), (self._endpoint,))))
            stack.callback(self._stop)
            self._start(self._bus)
            self._stack = stack.pop_all()
        what = f"--fleet {FLEET} " if len(self._robots) > 1 else ""
        watch = f"{command()} watch {what}--connect {self._endpoint}"
        err().print(f"in another terminal: {watch}", soft_wrap=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def watch(self) -> MissionEnding | None:
        """Show the mission until its end, and return the ending; None if the user quits.

        Raises:
            KeyboardInterrupt: a signal ends it.
            ProcessEnded: one of the processes has ended.
        """
        self._started = time.monotonic()
        if not self._view.run(self._step):
            return None
        worked_at = self._worked_at
        worked_s = worked_at[-1] - worked_at[0] if worked_at else 0.0
        return MissionEnding(
            tuple(self._statuses),
            time.monotonic() - self._started,
            timed_out=self._done_since is None,
            makespan_s=worked_s * self._args.speed,
        )

    def _step(self, timeout_s: float) -> bool:
        """Take in statuses for up to ``timeout_s`` [s]; return whether the mission is over."""
        now = time.monotonic()
        self._check_processes()
        if self._waiting:
            self._let_start(self._bus, now)
        for number, newest in enumerate(self._newest):
            sample = newest.take(timeout_s / len(self._robots))
            if sample is not None:
                status = decode_tolerant(sample.payload, Status)
                self._statuses[number] = status
                if not self._waiting:
                    self._view.show(number, status, now - self._started)
                self._worked_at += [now] if status.state in AT_WORK else []
        is_done = all(status.state == "done" for status in self._statuses)
        self._done_since = (self._done_since or now) if is_done else None
        settle_s = max(SETTLE_SIM_S / self._args.speed, 1.5)
        if self._done_since is not None and now - self._done_since >= settle_s:
            return True
        return not self._waiting and bool(now - self._started >= self._args.timeout)

    def _start(self, bus: Bus) -> None:
        for robot, newest in zip(self._robots, self._newest, strict=True):
            robot.folder.mkdir(exist_ok=True)
            robot.write_config(self._args, self._endpoint)
            bus.listen(Keys(robot.name), topics.STATUS, newest.put)
            for name, words in robot.programs(self._args, self._endpoint):
                log = robot.folder / f"{name}.log"
                if name == "robot":
                    self._waiting.append((log, words))
                else:
                    self._spawn(log, words)
        if len(self._robots) > 1:
            out = self._robots[0].folder.parent
            self._spawn(out / "fleet.log", fleet_recorder(out, self._endpoint))
        self._silent = {Keys(robot.name).of(topics.RECORDER_ALIVE) for robot in self._robots}

    def _let_start(self, bus: Bus, now: float) -> None:
        """Start the robots once all recorders listen, or after ``RECORDERS_WITHIN_S``."""
        self._silent = {key for key in self._silent if not bus.alive(key)}
        if self._silent and now - self._started < RECORDERS_WITHIN_S:
            return
        for log, words in self._waiting:
            self._spawn(log, words)
        self._waiting, self._started = [], now

    def _spawn(self, log: Path, words: list[str]) -> None:
        program = python_program("fasaco_edge", *words)
        program += ["--with-parent", str(os.getpid())]
        with log.open("wb") as file:
            # A process group of its own keeps Ctrl-C away: the demo ends its processes in order.
            process = subprocess.Popen(program, stdout=file, stderr=file, process_group=0)
        self._processes.append((log, process))

    def _check_processes(self) -> None:
        for log, process in self._processes:
            if process.poll() is not None:
                last = deque(log.read_text(errors="replace").splitlines(), maxlen=5)
                raise ProcessEnded(
                    f"the {log.stem} ended with {process.returncode}:\n  " + "\n  ".join(last),
                    hint=f"see {log}",
                )

    def _stop(self) -> None:
        """End the robots first, so that the recordings have their last messages."""
        for is_last in (False, True):
            ending = [one for log, one in self._processes if (log.stem in LAST) == is_last]
            for process in ending:
                process.send_signal(signal.SIGTERM)
            for process in ending:
                try:
                    process.wait(STOP_TIMEOUT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
