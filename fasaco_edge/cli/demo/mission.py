"""The processes of the demo: daemon with recorder, and robot; watched in a terminal."""

from __future__ import annotations

import argparse
import math
import os
import signal
import socket
import subprocess
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import yaml
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.console.terminal import err
from fasaco_edge.errors import BusUnavailable, ProcessEnded
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.host.processes import python_program
from fasaco_edge.planners.grids import start_point
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.watch import phrases
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys

PLAIN_LINE_EVERY_S = 5.0
START_TIMEOUT_S = 20.0
STOP_TIMEOUT_S = 8.0
# "Done" has to hold for some maps [simulated s]: the last one may still be on its way.
SETTLE_SIM_S = 3.0


class DemoView:
    """Shows the daemon's status as it comes in."""

    def __init__(self, title: str) -> None:
        self._console = err()
        self._bar = Progress(
            TextColumn("{task.description}", style="bold", markup=False),
            BarColumn(bar_width=28),
            TextColumn("{task.percentage:>3.0f} % of cells", markup=False),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=1.0, figures="starting")
        self._printed_at = 0.0

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, status: Status, elapsed_s: float) -> None:
        """Show one status."""
        fraction = status.coverage.fraction if status.coverage else 0.0
        text = phrases.figures(status)
        self._bar.update(self._task, completed=fraction, figures=text)
        now = time.monotonic()
        if not self._console.is_terminal and now - self._printed_at >= PLAIN_LINE_EVERY_S:
            self._printed_at = now
            line = f"{elapsed_s:6.1f} s  {100 * fraction:5.1f} % of cells  {text}"
            self._console.print(line, soft_wrap=True)


@dataclass(frozen=True, slots=True)
class Ending:
    """How the mission ended.

    Attributes:
        status: the daemon's last status.
        wall_s: how long it took [s].
        replan_ms: time of every plan heard of [ms].
        timed_out: whether time ran out first.
    """

    status: Status
    wall_s: float
    replan_ms: tuple[float, ...]
    timed_out: bool


class DemoMission:
    """Starts everything on entry, ends everything on exit."""

    def __init__(self, args: argparse.Namespace, out: Path) -> None:
        self._args = args
        self._out = out
        self._map = find_map(args.map)
        self._endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._keys = Keys()
        self._processes: list[tuple[str, subprocess.Popen[bytes]]] = []
        self._bus: Bus | None = None
        self._newest = LatestSlot[Sample]()

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def watch(self) -> Ending:
        """Show the mission until all is covered; return how it ended."""
        started = time.monotonic()
        done_since: float | None = None
        status = Status()
        plans: dict[int, float] = {}
        settle_s = max(SETTLE_SIM_S / self._args.speed, 1.5)
        with DemoView(str(self._args.map)) as view:
            while (now := time.monotonic()) - started < self._args.timeout:
                self._check_processes()
                sample = self._newest.take(timeout_s=0.25)
                if sample is not None:
                    status = decode_tolerant(sample.payload, Status)
                    _note_plan(plans, status)
                    view.show(status, now - started)
                done = status.state == "done"
                done_since = (done_since or now) if done else None
                if done_since is not None and now - done_since >= settle_s:
                    break
        timed_out = status.state != "done"
        return Ending(status, time.monotonic() - started, tuple(plans.values()), timed_out)

    def _start(self) -> None:
        config = self._out / "config.yaml"
        config.write_text(yaml.safe_dump(self._config()), encoding="utf-8")
        recording = ["--record", str(self._out)]
        # Its own progress, from the beginning: no other daemon's, nor an earlier demo's.
        state = ["--state", str(self._out / "state"), "--fresh"]
        self._spawn("daemon", ["run", "--config", str(config), *recording, *state])
        self._bus = self._join()
        self._bus.listen(self._keys, topics.STATUS, self._newest.put)
        robot = ["--speed", str(self._args.speed), "--robot-radius", str(self._args.robot_radius)]
        trail = ["--trail-out", str(self._out / "trail.csv")]
        driver = ["--connect", self._endpoint, "--driver", self._args.driver]
        driver += ["--battery-min", str(self._args.battery_min)]
        self._spawn("robot", ["simulate", str(self._map), *driver, *robot, *trail])
        if self._args.driver == "follow":
            speed = ["--speed", str(self._args.speed)]
            self._spawn("follower", ["follow", "--config", str(config), *speed])

    def _config(self) -> dict[str, object]:
        simulated = SimulationConfig()
        charging: dict[str, object] = {}
        if self._args.battery_min:
            truth = read_map(self._map)
            x_m, y_m = start_point(self._map, truth, self._args.robot_radius)
            charging["mission"] = {"dock": {"x_m": x_m, "y_m": y_m, "approach_m": 0.0}}
            charging["battery"] = {}
        return charging | {
            "robot": {
                "radius_m": self._args.robot_radius,
                "tool_width_m": self._args.cell,
                "speed_m_s": simulated.speed_m_s,
                "turn_deg_s": math.degrees(simulated.turn_rad_s),
                "turn_deg_s2": math.degrees(simulated.turn_acceleration_rad_s2),
                "acceleration_m_s2": simulated.acceleration_m_s2,
            },
            "bus": {"listen": [self._endpoint]},
            "planner": {"seed": self._args.seed, "line": self._args.line},
        }

    def _spawn(self, name: str, words: list[str]) -> None:
        program = python_program("fasaco_edge", *words)
        program += ["--with-parent", str(os.getpid())]
        with (self._out / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(program, stdout=log, stderr=log)
        self._processes.append((name, process))

    def _join(self) -> Bus:
        """Connect to the daemon, once it listens."""
        deadline = time.monotonic() + START_TIMEOUT_S
        while True:
            self._check_processes()
            try:
                return open_bus(BusSettings("client", (self._endpoint,)))
            except BusUnavailable:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)

    def _check_processes(self) -> None:
        for name, process in self._processes:
            if process.poll() is not None:
                log = self._out / f"{name}.log"
                last = deque(log.read_text(errors="replace").splitlines(), maxlen=5)
                raise ProcessEnded(
                    f"the {name} ended with {process.returncode}:\n  " + "\n  ".join(last),
                    hint=f"see {log}",
                )

    def _stop(self) -> None:
        """End the robot first, so that the recording holds its last messages."""
        for _, process in reversed(self._processes):
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._bus is not None:
            self._bus.close()


def _note_plan(plans: dict[int, float], status: Status) -> None:
    if status.latency_ms.plan is not None:
        plans[status.plan.plans] = status.latency_ms.plan


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
