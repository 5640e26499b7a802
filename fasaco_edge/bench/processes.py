"""Daemon in a process of its own, a session with it, and the robot that publishes to it.

The robot's map is of a fully known building, 50 m x 50 m, with halls of ten metres. A crate in it
moves.
"""

from __future__ import annotations

import os
import queue
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable, NotYet, ProcessEnded
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid
from fasaco_edge.host.addresses import free_port
from fasaco_edge.host.processes import python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.poses import encode_pose_stamped

# Timeouts, long enough for a busy computer, and interval of checks [s].
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
        keys: keys of the daemon.
        endpoint: the endpoint that the daemon listens at.
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
        """Process id of the daemon."""
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
        """Wait for the daemon's liveliness token; return the time since its start [s]."""
        while not bus.alive(self.keys.of(topics.ALIVE)):
            self._wait("say that it is alive")
        return time.monotonic() - self._started

    def wait_status(self, bus: Bus) -> float:
        """Wait until the daemon replies with a status; return the time since its start [s]."""
        while not any(not reply.is_error for reply in bus.get(self.keys.rpc("status"))):
            self._wait("answer with a status")
        return time.monotonic() - self._started

    def check(self) -> None:
        """Raise ProcessEnded if the daemon has ended."""
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


RESOLUTION_M = 0.05
HALL_PX, WALL_PX, DOOR_PX, CRATE_PX = 200, 4, 30, 16
# Number of places of the crate, and their spacing, less than its width [pixels].
CRATE_PLACES, CRATE_STEP_PX = 12, 12
# Timeout of a path [s]: before the first one, a slow computer takes long to load the kernels.
PATH_TIMEOUT_S = 300.0


def building(side_px: int = 1000) -> OccupancyGrid:
    """Return a fully known building of ``side_px`` x ``side_px`` pixels of 0.05 m."""
    cells = np.full((side_px, side_px), FREE, np.int8)
    walls = range(0, side_px, HALL_PX)
    for wall in walls:
        cells[wall : wall + WALL_PX] = OCCUPIED
        cells[:, wall : wall + WALL_PX] = OCCUPIED
    for wall in walls[1:]:
        for hall in walls:
            door = slice(hall + (HALL_PX - DOOR_PX) // 2, hall + (HALL_PX + DOOR_PX) // 2)
            cells[wall : wall + WALL_PX, door] = FREE
            cells[door, wall : wall + WALL_PX] = FREE
    cells[-WALL_PX:] = cells[:, -WALL_PX:] = OCCUPIED
    geometry = GridGeometry(side_px, side_px, RESOLUTION_M, Pose2D(0.0, 0.0))
    return OccupancyGrid(geometry, cells)


def with_crate(grid: OccupancyGrid, number: int, stamp_ns: int) -> OccupancyGrid:
    """Return the building with a crate in the hall farthest from the robot.

    Crates of successive numbers stand at different places, so that each map gains and loses
    coverable cells.
    """
    side = grid.geometry.rows
    row, col = side - HALL_PX // 2, side - HALL_PX + 2 * CRATE_PX
    col += CRATE_STEP_PX * (number % CRATE_PLACES)
    cells = grid.cells.copy()
    cells[row : row + CRATE_PX, col : col + CRATE_PX] = OCCUPIED
    return replace(grid, cells=cells, stamp_ns=stamp_ns)


def robot_pose(stamp_ns: int) -> StampedPose:
    """Return the pose of a robot in the building's first hall."""
    return StampedPose(Pose2D(2.5, 2.5), stamp_ns=stamp_ns)


class MapSource:
    """Publishes maps and the pose to a daemon, and receives its paths."""

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
        """Publish a map; return when that was [s, monotonic]."""
        payload = encode_occupancy_grid(grid)
        at = time.monotonic()
        self._maps.put(payload)
        return at

    def wait_path(self, map_stamp_ns: int) -> tuple[float, float]:
        """Return the arrival [s, monotonic] of the first path planned on the map with this stamp,
        and its time of planning [ms].

        Paths without a plan, which only end before a new obstacle, are skipped.

        Raises:
            NotYet: no path came in time.
            ProcessEnded: the daemon has ended.
        """
        deadline = time.monotonic() + PATH_TIMEOUT_S
        while time.monotonic() < deadline:
            try:
                at, sample = self._arrivals.get(timeout=0.5)
            except queue.Empty:
                self._daemon.check()
                continue
            about = decode_tolerant(sample.attachment, PathAttachment)
            if about.map_stamp_ns == map_stamp_ns and about.planner is not None:
                return at, about.plan_ms
        raise NotYet(
            f"no path for a map after {PATH_TIMEOUT_S:.0f} s", hint="is the machine overloaded?"
        )

    def _await_listener(self, publisher: Publisher) -> None:
        deadline = time.monotonic() + START_TIMEOUT_S
        while not publisher.has_listeners():
            if time.monotonic() > deadline:
                raise BusUnavailable("the daemon does not subscribe to maps and poses")
            time.sleep(LOOK_EVERY_S)
