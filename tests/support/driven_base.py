"""Base of a robot and its daemon on the bus, to test a follower in a separate process.

The base moves by the velocities, publishes its pose, and records when it receives each velocity.
``python -m tests.support.driven_base ENDPOINT`` imitates only a daemon's token and status.
"""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.follow.estimate import VelocityCommand, moved
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.status import ClaimReport, Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.base import decode_velocity
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from fasaco_edge.wire.schemas import TWIST
from tests.support.processes import ENVIRONMENT, PROGRAM, free_endpoint
from tests.support.waiting import until

# Time within which a follower has to stop [s].
LONGEST_S = 5.0
POSE_S = 0.05


class DrivenBase:
    """A base without inertia, with the token and the status of a planning daemon."""

    def __init__(self, secured: Mapping[str, Any] | None = None) -> None:
        self.endpoint = free_endpoint()
        self.keys = Keys()
        self.bus = open_bus(BusSettings("router", (), (self.endpoint,), secured or {}))
        # The velocities received, each with its time [s, monotonic].
        self.heard: list[tuple[float, VelocityCommand]] = []
        self.pose = Pose2D(0.0, 0.0)
        self.frame = "map"
        # The state that the daemon reports, and its Zenoh id.
        self.state, self.daemon = "covering", "a1"
        self.says_poses = self.says_status = True
        # Whether a second daemon waits, and publishes its status.
        self.has_second = False
        self.last_pose_at = 0.0
        self._path = self.bus.advertise(self.keys, topics.PATH)
        self._pose = self.bus.advertise(self.keys, topics.POSE)
        self._status = self.bus.advertise(self.keys, topics.STATUS)
        self._ros_pose: Publisher | None = None
        self._token: object | None = None
        self._stop = threading.Event()
        self.bus.listen(self.keys, topics.CMD_VEL, self._hear)
        self._thread = threading.Thread(target=self._move)
        self._thread.start()

    def take_ros(self, domain: int) -> None:
        """Move by ROS 2 velocities, and publish poses there, too."""
        self.bus.subscribe(f"{domain}/cmd_vel/**", self._hear)
        key = f"{domain}/pose/geometry_msgs::msg::dds_::PoseStamped_/RIHS01_0"
        self._ros_pose = self.bus.publisher(key, "")

    def plans(self, yes: bool = True, name: str = "a1") -> None:
        """Declare the token of a planning daemon; withdraw it if ``yes`` is False."""
        if self._token is not None:
            self.bus.withdraw(self._token)
            self._token = None
        if yes:
            self.daemon = name
            self._token = self.bus.token(self.keys.claim(name, "plans"))

    def send_path(
        self, *points: tuple[float, float], frame: str = "map", of: str | None = None
    ) -> float:
        """Publish a path of this daemon, or of daemon ``of``, "" for none; return the time [s]."""
        xy = np.array(points, np.float64).reshape(-1, 2)
        about = b"" if of == "" else named(of or self.daemon)
        self._path.put(encode_path(xy, np.zeros(len(xy)), frame, 1), about)
        return time.monotonic()

    def send_raw_path(self, payload: bytes) -> float:
        """Publish bytes as a path; return the time [s]."""
        self._path.put(payload, named(self.daemon))
        return time.monotonic()

    def send_raw_pose(self, payload: bytes) -> float:
        """Publish bytes as a pose; return the time [s]."""
        self._pose.put(payload)
        return time.monotonic()

    def newest(self) -> VelocityCommand | None:
        """Return the newest velocity of the last 0.2 s."""
        if self.heard and time.monotonic() - self.heard[-1][0] < 0.2:
            return self.heard[-1][1]
        return None

    def wait_until_it_moves(self) -> None:
        """Wait for a velocity above zero."""
        until(
            lambda: (newest := self.newest()) and newest.speed >= 0.1,
            why=lambda: f"it does not move; {self.heard[-1:]}",
        )

    def stopped_after(self, since: float) -> float:
        """Return the time from ``since`` to the final command to stand [s]; infinity for none."""
        until = since + 0.4
        while True:
            time.sleep(max(until - time.monotonic(), 0.01))
            later = [(at, command) for at, command in list(self.heard) if at >= since]
            stands = [at for at, command in later if command == VelocityCommand()]
            if stands or time.monotonic() > since + LONGEST_S:
                break
        if not stands or any(
            command != VelocityCommand() for at, command in later if at > stands[0]
        ):
            return math.inf
        return stands[0] - since

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join()
        self.bus.close()

    def _hear(self, sample: Sample) -> None:
        velocity = decode_velocity(sample.payload, sample.schema or TWIST)
        self.heard.append(
            (time.monotonic(), VelocityCommand(velocity.speed_m_s, velocity.turn_rad_s))
        )

    def _move(self) -> None:
        told = 0.0
        while not self._stop.wait(POSE_S):
            newest = self.newest()
            self.pose = moved(self.pose, newest or VelocityCommand(), POSE_S)
            now = time.monotonic()
            if self.says_poses:
                stamped = StampedPose(self.pose, self.frame, time.time_ns())
                self._pose.put(encode_pose_stamped(stamped))
                if self._ros_pose is not None:
                    self._ros_pose.put(encode_pose_stamped(stamped))
                self.last_pose_at = now
            if now - told <= 0.5:
                continue
            told = now
            if self.says_status and self._token is not None:
                self._status.put(status_of(self.daemon, self.state))
            if self.has_second:
                self._status.put(status_of("c3", stand="waits"))


def named(daemon: str) -> bytes:
    """Return the attachment of a daemon's path."""
    return encode_json(PathAttachment(daemon=daemon))


def status_of(daemon: str, state: str = "covering", stand: str = "plans") -> bytes:
    """Return the status of a daemon."""
    return encode_json(Status(state=state, claim=ClaimReport(daemon, stand)))


@contextmanager
def follower_process(
    endpoint: str, log: Path, *words: str, out: int | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a follower; end it."""
    command: Sequence[str] = [*PROGRAM, "follow", "--connect", endpoint, *words]
    with log.open("wb") as stderr:
        process = subprocess.Popen(command, stderr=stderr, stdout=out, env=ENVIRONMENT)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.terminate()
        process.wait(30)


def daemon_that_only_plans(endpoint: str) -> Bus:
    """Return a session with the token of a daemon, after its first status."""
    bus = open_bus(BusSettings("client", (endpoint,)))
    keys = Keys()
    status = bus.advertise(keys, topics.STATUS)
    bus.token(keys.claim("b2", "plans"))
    status.put(status_of("b2"))
    return bus


def main() -> None:
    """Imitate a daemon until killed; print "plans" once it plans."""
    bus = daemon_that_only_plans(sys.argv[1])
    status = bus.advertise(Keys(), topics.STATUS)
    print("plans", flush=True)
    while True:
        time.sleep(0.5)
        status.put(status_of("b2"))


if __name__ == "__main__":
    main()
