"""A real daemon as a process of its own, and a session beside it.

A real recorder beside a daemon, as a process of its own.
"""

from __future__ import annotations

import os
import queue
import signal
import socket
import subprocess
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml

from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus, BusSettings, Sample, open_bus
from fasaco_edge.errors import BusUnavailable, NotYet, ProcessEnded
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.processes import python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.json_text import decode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.maps import encode_occupancy_grid
from fasaco_edge.wire.poses import encode_pose_stamped

START_TIMEOUT_S = 20.0
# The first path needs the kernels; on a slow computer their loading takes long.
PATH_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 8.0
LOOK_EVERY_S = 0.002
PROGRAM = python_program("fasaco_edge")


def warm_kernels() -> None:
    """Compile the kernels into the cache, so that no daemon has to.

    In a process of its own: this one stays as small as a client on the bus is.

    Raises:
        ProcessEnded: that failed.
    """
    try:
        subprocess.run([*PROGRAM, "warmup"], check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        raise ProcessEnded(f"warmup ended with {error.returncode}:\n{error.stderr}") from error


class DaemonProcess:
    """``fasaco-edge run`` on a free port of loopback: started on entry, ended on exit.

    Attributes:
        keys: its keys.
        endpoint: where it listens.
    """

    def __init__(self, config: dict[str, Any] | None = None) -> None:
        self.keys = Keys()
        self.endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._config = {**(config or {}), "bus": {"listen": [self.endpoint]}}
        self._folder = tempfile.TemporaryDirectory(prefix="fasaco-bench-")
        self._log = Path(self._folder.name) / "daemon.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._started = 0.0
        self._bus: Bus | None = None

    def __enter__(self) -> Self:
        folder = Path(self._folder.name)
        file = folder / "config.yaml"
        file.write_text(yaml.safe_dump(self._config), encoding="utf-8")
        with self._log.open("wb") as log:
            self._started = time.monotonic()
            command = [*PROGRAM, "run", "--config", str(file), "--state", str(folder / "state")]
            self._process = subprocess.Popen(
                [*command, "--with-parent", str(os.getpid())], stdout=log, stderr=log
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bus is not None:
            self._bus.close()
        if self._process is not None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._folder.cleanup()

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self._process is not None
        return self._process.pid

    def join(self) -> Bus:
        """Return a session with it, as soon as it listens.

        Raises:
            ProcessEnded: it has ended by itself.
            BusUnavailable: it does not listen in time.
        """
        host, _, port = self.endpoint.removeprefix("tcp/").partition(":")
        # To be refused costs the starting process nothing.
        while not _listens(host, int(port)):
            self._wait("listen at " + self.endpoint)
        self._bus = open_bus(BusSettings("client", (self.endpoint,)))
        return self._bus

    def wait_alive(self, bus: Bus) -> float:
        """Wait for its liveliness token; return the time since its start [s]."""
        while not bus.alive(self.keys.of(topics.ALIVE)):
            self._wait("say that it is alive")
        return time.monotonic() - self._started

    def wait_status(self, bus: Bus) -> float:
        """Wait until it answers with a status; return the time since its start [s]."""
        while not any(not reply.is_error for reply in bus.get(self.keys.rpc("status"))):
            self._wait("answer with a status")
        return time.monotonic() - self._started

    def check(self) -> None:
        """Raise ProcessEnded if it has ended."""
        if self._process is not None and self._process.poll() is not None:
            last = deque(self._log.read_text(errors="replace").splitlines(), maxlen=5)
            code = self._process.returncode
            raise ProcessEnded(f"the daemon ended with {code}:\n  " + "\n  ".join(last))

    def _wait(self, for_it_to: str) -> None:
        self.check()
        if time.monotonic() - self._started > START_TIMEOUT_S:
            raise BusUnavailable(f"the daemon did not {for_it_to} in {START_TIMEOUT_S:.0f} s")
        time.sleep(LOOK_EVERY_S)


@dataclass(frozen=True, slots=True)
class PathArrival:
    """A path as it came in: when [s, monotonic], and what its attachment says of it."""

    at: float
    about: dict[str, Any]


class MapSource:
    """Publishes maps and the pose to a daemon, and hears its paths."""

    def __init__(self, daemon: DaemonProcess, bus: Bus) -> None:
        keys = daemon.keys
        self._daemon = daemon
        self._maps = bus.advertise(keys, topics.MAP)
        self._poses = bus.advertise(keys, topics.POSE)
        self._arrivals = queue.SimpleQueue[tuple[float, Sample]]()
        bus.subscribe(
            keys.of(topics.PATH), lambda sample: self._arrivals.put((time.monotonic(), sample))
        )
        for publisher in (self._maps, self._poses):
            self._await_listener(publisher)

    def put_pose(self, pose: StampedPose) -> None:
        """Publish a pose."""
        self._poses.put(encode_pose_stamped(pose))

    def put_map(self, grid: OccupancyGrid) -> float:
        """Publish a map; return when [s, monotonic]."""
        payload = encode_occupancy_grid(grid)
        at = time.monotonic()
        self._maps.put(payload)
        return at

    def wait_path(self, map_stamp_ns: int) -> PathArrival:
        """Return the first path planned on the map of that stamp.

        Paths without a plan, a walk cut off before a new obstacle, are passed over.

        Raises:
            NotYet: none came in time.
            ProcessEnded: the daemon has ended.
        """
        deadline = time.monotonic() + PATH_TIMEOUT_S
        while time.monotonic() < deadline:
            try:
                at, sample = self._arrivals.get(timeout=0.5)
            except queue.Empty:
                self._daemon.check()
                continue
            about = decode_json(sample.attachment)
            if about["map_stamp_ns"] == map_stamp_ns and about["planner"] is not None:
                return PathArrival(at, about)
        raise NotYet(
            f"no path for a map after {PATH_TIMEOUT_S:.0f} s", hint="is the machine overloaded?"
        )

    def forget_paths(self) -> None:
        """Let go of the paths that nobody waited for."""
        while not self._arrivals.empty():
            self._arrivals.get()

    def _await_listener(self, publisher: Publisher) -> None:
        deadline = time.monotonic() + START_TIMEOUT_S
        while not publisher.has_listeners():
            if time.monotonic() > deadline:
                raise BusUnavailable("the daemon does not subscribe to maps and poses")
            time.sleep(LOOK_EVERY_S)


def _listens(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError:
        return False
    return True


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def recorder_beside(daemon: DaemonProcess, bus: Bus) -> Iterator[None]:
    """Record what ``daemon`` does, from the moment the recorder listens to the end of the block.

    Raises:
        ProcessEnded: it ended by itself, or does not listen in time.
    """
    with tempfile.TemporaryDirectory(prefix="fasaco-bench-") as folder:
        command = [*PROGRAM, "record", "--out", folder, "--connect", daemon.endpoint]
        with Path(folder, "recorder.log").open("w+b") as log:
            process = subprocess.Popen(
                [*command, "--with-parent", str(os.getpid())], stdout=log, stderr=log
            )
            try:
                _wait_alive(process, daemon, bus, Path(log.name))
                yield
            finally:
                process.terminate()
                try:
                    process.wait(STOP_TIMEOUT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _wait_alive(
    process: subprocess.Popen[bytes], daemon: DaemonProcess, bus: Bus, log: Path
) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    while not bus.alive(daemon.keys.of(topics.RECORDER_ALIVE)):
        if process.poll() is not None or time.monotonic() > deadline:
            said = log.read_text(errors="replace").splitlines()[-5:]
            raise ProcessEnded("the recorder does not listen:\n  " + "\n  ".join(said))
        time.sleep(LOOK_EVERY_S)
