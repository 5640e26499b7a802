"""The processes of the demo: daemons with recorders, and robots; from their start to their end."""

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
from fasaco_edge.cli.demo.mishaps import Mishaps
from fasaco_edge.cli.demo.robots import FLEET, DemoRobot, fleet_recorder
from fasaco_edge.cli.demo.view import demo_view
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.addresses import free_port
from fasaco_edge.host.processes import python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys

STOP_TIMEOUT_S = 8.0
RECORDERS_WITHIN_S = 60.0
# "Done" has to hold for some maps [simulated s]: the last one may still be on its way.
SETTLE_SIM_S = 3.0
# Programs that subscribe to the robots, by the names of their logs.
LAST = ("daemon", "fleet")
AT_WORK = ("planning", "covering", "degraded")


@dataclass(frozen=True, slots=True)
class Ending:
    """How the mission ended.

    Attributes:
        statuses: the last status of each daemon.
        wall_s: how long it took [s].
        replan_ms: time of every plan reported [ms].
        timed_out: whether time ran out first.
        makespan_s: from when the first robot worked until the last was done, in simulated time.
        killed: name of the robot that was killed; "" for none.
    """

    statuses: tuple[Status, ...]
    wall_s: float
    replan_ms: tuple[float, ...]
    timed_out: bool
    makespan_s: float = 0.0
    killed: str = ""


class DemoMission:
    """Starts everything on entry, ends everything on exit."""

    def __init__(self, args: argparse.Namespace, robots: Sequence[DemoRobot]) -> None:
        self._args, self._robots = args, robots
        self._endpoint = f"tcp/127.0.0.1:{free_port()}"
        # Another router for every second robot, if the network is to be split.
        self._far = self._endpoint
        if args.split_after is not None:
            self._far = f"tcp/127.0.0.1:{free_port()}"
        self._view = demo_view(
            Path(args.map).stem, [robot.name for robot in robots], self._endpoint
        )
        self._mishaps = Mishaps(
            args.kill_after, args.split_after, (self._endpoint, self._far), self._view.say
        )
        self._killed = ""
        self._processes: list[tuple[Path, subprocess.Popen[bytes]]] = []
        self._stack = ExitStack()
        # Robots that have not started: log and words of each; keys of absent recorders.
        self._waiting: list[tuple[Path, list[str]]] = []
        self._silent: set[str] = set()
        self._newest = [LatestSlot[Sample]() for _ in robots]
        self._statuses = [Status() for _ in robots]
        self._plans: dict[tuple[int, int], float] = {}
        self._worked_at: list[float] = []
        self._started = 0.0
        self._done_since: float | None = None

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            # The router that connects all processes.
            self._bus = stack.enter_context(open_bus(BusSettings("router", (), (self._endpoint,))))
            if self._far != self._endpoint:
                stack.enter_context(open_bus(BusSettings("router", (), (self._far,))))
            stack.enter_context(self._mishaps)
            stack.callback(self._stop)
            self._start(self._bus)
            self._stack = stack.pop_all()
        what = f"--fleet {FLEET} " if len(self._robots) > 1 else ""
        watch = f"{command()} watch {what}--connect {self._endpoint}"
        err().print(f"in another terminal: {watch}", soft_wrap=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def watch(self) -> Ending:
        """Show the mission until all is covered; return how it ended.

        Raises:
            KeyboardInterrupt: the user quits.
            ProcessEnded: one of the processes has ended.
        """
        self._started = time.monotonic()
        with self._view:
            self._view.run(self._step)
        worked_at = self._worked_at
        worked_s = worked_at[-1] - worked_at[0] if worked_at else 0.0
        return Ending(
            tuple(self._statuses),
            time.monotonic() - self._started,
            tuple(self._plans.values()),
            timed_out=self._done_since is None,
            makespan_s=worked_s * self._args.speed,
            killed=self._killed,
        )

    def _step(self, timeout_s: float) -> bool:
        """Take in statuses, waiting up to ``timeout_s`` [s]; return whether the mission is over."""
        now = time.monotonic()
        self._check_processes()
        if self._waiting:
            self._let_start(self._bus, now)
        for number, newest in enumerate(self._newest):
            sample = newest.take(timeout_s / len(self._robots))
            if sample is not None:
                status = decode_tolerant(sample.payload, Status)
                if status.latency_ms.plan is not None:
                    self._plans[number, status.plan.plans] = status.latency_ms.plan
                self._statuses[number] = status
                if not self._waiting:
                    self._view.show(number, status, now - self._started)
                self._worked_at += [now] if status.state in AT_WORK else []
        if self._worked_at:
            self._let_happen(now, self._worked_at[0])
        is_done = all(
            status.state == "done" or robot.name == self._killed
            for robot, status in zip(self._robots, self._statuses, strict=True)
        )
        self._done_since = (self._done_since or now) if is_done else None
        settle_s = max(SETTLE_SIM_S / self._args.speed, 1.5)
        if self._done_since is not None and now - self._done_since >= settle_s:
            return True
        return not self._waiting and bool(now - self._started >= self._args.timeout)

    def _let_happen(self, now: float, began: float) -> None:
        """Carry out due mishaps; a process of the last robot that they end is no failure."""
        last = self._robots[-1]
        victim = [one for log, one in self._processes if log.parent == last.folder]
        if self._mishaps.step(now, (now - began) * self._args.speed, victim):
            self._killed = last.name
            self._view.say(f"{last.name} is killed")

    def _start(self, bus: Bus) -> None:
        for number, (robot, newest) in enumerate(zip(self._robots, self._newest, strict=True)):
            endpoint = self._far if number % 2 else self._endpoint
            robot.folder.mkdir(exist_ok=True)
            robot.write_config(self._args, endpoint)
            bus.listen(Keys(robot.name), topics.STATUS, newest.put)
            for name, words in robot.programs(self._args, endpoint):
                log = robot.folder / f"{name}.log"
                if name == "robot":
                    self._waiting.append((log, words))
                else:
                    self._spawn(log, words)
        if len(self._robots) > 1:
            out = self._robots[0].folder.parent
            self._spawn(out / "fleet.log", fleet_recorder(out, self._endpoint))
        if self._args.record == "all":
            self._silent = {Keys(robot.name).of(topics.RECORDER_ALIVE) for robot in self._robots}

    def _let_start(self, bus: Bus, now: float) -> None:
        """Start the robots once all recorders listen, which start more slowly, or after a while."""
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
            # Ctrl-C in the terminal is for the demo, which ends them in order: one that dies of it
            # first would be a failure.
            process = subprocess.Popen(program, stdout=file, stderr=file, process_group=0)
        self._processes.append((log, process))

    def _check_processes(self) -> None:
        for log, process in self._processes:
            if process.poll() is not None and log.parent.name != self._killed:
                last = deque(log.read_text(errors="replace").splitlines(), maxlen=5)
                raise ProcessEnded(
                    f"the {log.stem} ended with {process.returncode}:\n  " + "\n  ".join(last),
                    hint=f"see {log}",
                )

    def _stop(self) -> None:
        """End the robots first, so that the recordings hold their last messages."""
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
