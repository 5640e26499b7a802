"""A robot for a daemon to work for: it drives along its paths, and its map changes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.building import building, robot_pose, with_crate
from fasaco_edge.bench.daemon_process import DaemonProcess, MapSource
from fasaco_edge.bus.session import Bus, Sample
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire.paths import decode_path

POSES_HZ = 10
SPEED_M_S = 0.5
# A crate moves so often [s]: each time what is left of the path is planned anew.
MAP_EVERY_S = 1.0


class CoveringRobot:
    """Drives; to be told of paths on Zenoh's threads, and to be ticked by one.

    Attributes:
        paths: how many it was given.
    """

    def __init__(self, source: MapSource) -> None:
        self.paths = 0
        self._source = source
        self._building = building()
        self._at = np.array([2.5, 2.5])
        self._ahead: NDArray[np.float64] = np.empty((0, 2))
        self._maps, self._map_due = 0, 0.0
        self._lock = threading.Lock()

    def take_path(self, sample: Sample) -> None:
        """Drive this from now on."""
        ahead = decode_path(sample.payload).xy
        with self._lock:
            self.paths += 1
            self._ahead = ahead

    def tick(self, now: float) -> None:
        """Drive on for a period, and say where it is; now and then a map."""
        with self._lock:
            self._drive(SPEED_M_S / POSES_HZ)
        x, y = self._at
        self._source.forget_paths()
        self._source.put_pose(StampedPose(Pose2D(x, y), stamp_ns=time.time_ns()))
        if now >= self._map_due:
            self._maps += 1
            self._map_due = now + MAP_EVERY_S
            self._source.put_map(with_crate(self._building, self._maps, time.time_ns()))

    def _drive(self, metres: float) -> None:
        while len(self._ahead) and metres > 0.0:
            way = self._ahead[0] - self._at
            left = float(np.hypot(*way))
            if left > metres:
                self._at = self._at + way * (metres / left)
                return
            self._at, self._ahead, metres = self._ahead[0], self._ahead[1:], metres - left


@contextmanager
def robot_beside(daemon: DaemonProcess, bus: Bus) -> Iterator[CoveringRobot]:
    """Let a robot drive for the block, from the moment it has its first path."""
    source = MapSource(daemon, bus)
    robot = CoveringRobot(source)
    bus.subscribe(daemon.keys.path, robot.take_path)
    stamp_ns = time.time_ns()
    source.put_pose(robot_pose(stamp_ns))
    source.put_map(with_crate(building(), 0, stamp_ns))
    source.wait_path(stamp_ns)
    over = threading.Event()

    def drive() -> None:
        while not over.wait(1.0 / POSES_HZ):
            robot.tick(time.monotonic())

    thread = threading.Thread(target=drive, name="robot")
    thread.start()
    try:
        yield robot
    finally:
        over.set()
        thread.join()
