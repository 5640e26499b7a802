"""The processes of the demo: daemons with recorders, and robots; watched in a terminal."""

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

from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.console.terminal import (
    CLOCK,
    NARROW_BAR,
    Description,
    ProgressLines,
    err,
)
from fasaco_edge.cli.demo.mishaps import Mishaps
from fasaco_edge.cli.demo.robots import FLEET, DemoRobot, fleet_recorder
from fasaco_edge.client import phrases
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.addresses import free_port
from fasaco_edge.host.processes import python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys

PLAIN_LINE_EVERY_S = 5.0
STOP_TIMEOUT_S = 8.0
RECORDERS_WITHIN_S = 60.0
# "Done" has to hold for some maps [simulated s]: the last one may still be on its way.
SETTLE_SIM_S = 3.0
# Programs that subscribe to the robots, by the names of their logs.
LAST = ("daemon", "fleet")
AT_WORK = ("planning", "covering", "degraded")
# Widths of a percentage, and of as many figures as a name of a robot leaves [characters].
PERCENT, LEAST_FIGURES = 5, 24


class DemoView:
    """Shows the daemons' status as it comes in, a line a robot."""

    def __init__(self, titles: Sequence[str]) -> None:
        self._bar = ProgressLines(
            Description(NARROW_BAR + PERCENT + CLOCK + LEAST_FIGURES + 4, style="bold"),
            BarColumn(bar_width=NARROW_BAR),
            TextColumn("{task.percentage:>3.0f} %", markup=False),
            TimeElapsedColumn(),
            # In a narrow terminal the figures are cut, and nothing else.
            TextColumn(
                "{task.fields[figures]}",
                markup=False,
                table_column=Column(ratio=1, no_wrap=True),
            ),
            expand=True,
        )
        self._titles = titles
        self._tasks = [self._bar.add_task(text, total=1.0, figures="starting") for text in titles]
        self._printed_at = [0.0] * len(titles)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Show one status of the robot with this number."""
        fraction = status.coverage.fraction if status.coverage else 0.0
        text = phrases.figures(status)
        self._bar.update(self._tasks[robot], completed=fraction, figures=text)
        now = time.monotonic()
        if not self._bar.disable or now - self._printed_at[robot] < PLAIN_LINE_EVERY_S:
            return
        self._printed_at[robot] = now
        name = f"{self._titles[robot]}  " if len(self._tasks) > 1 else ""
        line = f"{elapsed_s:6.1f} s  {name}{100 * fraction:5.1f} % of cells  {text}"
        err().print(line, soft_wrap=True)


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
        self._mishaps = Mishaps(
            args.kill_after, args.split_after, (self._endpoint, self._far), err().print
        )
        self._killed = ""
        self._processes: list[tuple[Path, subprocess.Popen[bytes]]] = []
        self._stack = ExitStack()
        self._newest = [LatestSlot[Sample]() for _ in robots]

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            # The router that connects all processes.
            bus = stack.enter_context(open_bus(BusSettings("router", (), (self._endpoint,))))
            if self._far != self._endpoint:
                stack.enter_context(open_bus(BusSettings("router", (), (self._far,))))
            stack.enter_context(self._mishaps)
            stack.callback(self._stop)
            self._start(bus)
            self._stack = stack.pop_all()
        what = f"--fleet {FLEET}" if len(self._robots) > 1 else f"--robot {self._robots[0].name}"
        watch = f"fasaco-edge watch {what} --connect {self._endpoint}"
        err().print(f"watch it from another terminal: {watch}", soft_wrap=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def watch(self) -> Ending:
        """Show the mission until all is covered; return how it ended."""
        started = time.monotonic()
        done_since: float | None = None
        worked_at: list[float] = []
        statuses = [Status() for _ in self._robots]
        plans: dict[tuple[int, int], float] = {}
        settle_s = max(SETTLE_SIM_S / self._args.speed, 1.5)
        names = [robot.name for robot in self._robots]
        with DemoView(names if len(names) > 1 else [Path(self._args.map).stem]) as view:
            while (now := time.monotonic()) - started < self._args.timeout:
                self._check_processes()
                for number, newest in enumerate(self._newest):
                    sample = newest.take(timeout_s=0.25 / len(names))
                    if sample is not None:
                        status = decode_tolerant(sample.payload, Status)
                        if status.latency_ms.plan is not None:
                            plans[number, status.plan.plans] = status.latency_ms.plan
                        view.show(number, status, now - started)
                        statuses[number] = status
                        worked_at += [now] if status.state in AT_WORK else []
                if worked_at:
                    self._let_happen(now, worked_at[0])
                done = all(
                    status.state == "done" or robot.name == self._killed
                    for robot, status in zip(self._robots, statuses, strict=True)
                )
                done_since = (done_since or now) if done else None
                if done_since is not None and now - done_since >= settle_s:
                    break
        timed_out = done_since is None
        wall_s = time.monotonic() - started
        worked_s = worked_at[-1] - worked_at[0] if worked_at else 0.0
        return Ending(
            tuple(statuses), wall_s, tuple(plans.values()), timed_out,
            makespan_s=worked_s * self._args.speed, killed=self._killed,
        )  # fmt: skip

    def _let_happen(self, now: float, began: float) -> None:
        """Carry out due mishaps; a process of the last robot that they end is no failure."""
        last = self._robots[-1]
        victim = [one for log, one in self._processes if log.parent == last.folder]
        if self._mishaps.step(now, (now - began) * self._args.speed, victim):
            self._killed = last.name
            err().print(f"{last.name} is killed")

    def _start(self, bus: Bus) -> None:
        robots: list[tuple[Path, list[str]]] = []
        for number, (robot, newest) in enumerate(zip(self._robots, self._newest, strict=True)):
            endpoint = self._far if number % 2 else self._endpoint
            robot.folder.mkdir(exist_ok=True)
            robot.write_config(self._args, endpoint)
            bus.listen(Keys(robot.name), topics.STATUS, newest.put)
            for name, words in robot.programs(self._args, endpoint):
                log = robot.folder / f"{name}.log"
                if name == "robot":
                    robots.append((log, words))
                else:
                    self._spawn(log, words)
        if len(self._robots) > 1:
            out = self._robots[0].folder.parent
            self._spawn(out / "fleet.log", fleet_recorder(out, self._endpoint))
        if self._args.record == "all":
            self._await_recorders(bus)
        for log, words in robots:
            self._spawn(log, words)

    def _await_recorders(self, bus: Bus) -> None:
        """Wait for a while until all recorders listen: they start more slowly than a robot."""
        keys = {Keys(robot.name).of(topics.RECORDER_ALIVE) for robot in self._robots}
        until = time.monotonic() + RECORDERS_WITHIN_S
        while keys and time.monotonic() < until:
            self._check_processes()
            keys = {key for key in keys if not bus.alive(key)}
            time.sleep(0.05)

    def _spawn(self, log: Path, words: list[str]) -> None:
        program = python_program("fasaco_edge", *words)
        program += ["--with-parent", str(os.getpid())]
        with log.open("wb") as file:
            process = subprocess.Popen(program, stdout=file, stderr=file)
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
