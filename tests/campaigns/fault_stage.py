"""A robot of processes, each of which can fail: daemons, router, followers, a pose source.

``python -m tests.campaigns.fault_stage ENDPOINT`` is the pose source: it publishes where the base
says that it is.
"""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import yaml
import zenoh

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire.messages.base import decode_velocity
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from fasaco_edge.wire.schemas import POSE_STAMPED
from tests.campaigns.fault_links import Link
from tests.support.forked import Forked
from tests.support.outsider import MAP, open_client
from tests.support.processes import ENVIRONMENT, free_endpoint
from tests.support.rooms import map_bytes, room
from tests.support.waiting import until

PREFIX = "fasaco/@v1/robot"
TRUTH = "truth"
HALL_M = (30.0, 6.0)
START = Pose2D(1.0, 3.0)
PERIOD_S = 0.05
# The map comes again and again, for those that join late [s].
MAP_S = 2.0
# A base stops by itself where nothing comes for so long [s].
TIMEOUT_S = 0.5
# Slowest speed and turn rate that count as motion [m/s, rad/s].
MOVES_M_S, MOVES_RAD_S = 0.01, 0.05
READY_S = 90.0
# What a slow part sends arrives so late [s].
DELAY_S = 1.0

PARTS = ("planner", "second daemon", "router", "follower", "pose", "second follower")
ROUTER = Path(__file__).parents[1] / "support" / "router.py"


class Base:
    """A base that moves as commanded, and a note of everything that it receives.

    Attributes:
        moves: time [s, monotonic] and sender of each command that moves.
        planned: time, id of each status of a daemon that plans.
        pose: where the base is.
    """

    def __init__(self, endpoint: str) -> None:
        self.moves: list[tuple[float, str]] = []
        self.planned: list[tuple[float, str]] = []
        self.waiting = 0
        self.pose = START
        self.left_hall = False
        self._newest = (-math.inf, 0.0, 0.0)
        self._stop = threading.Event()
        self._session = open_client(endpoint)
        self._session.declare_subscriber(f"{PREFIX}/cmd_vel", self._take)
        self._session.declare_subscriber(f"{PREFIX}/status", self._take_status)
        self._thread = threading.Thread(target=self._move, daemon=True)
        self._thread.start()

    def tokens(self, key: str) -> list[str]:
        """Return the last chunks of the tokens that match a key below the robot's."""
        replies = self._session.liveliness().get(f"{PREFIX}/{key}", timeout=2.0)
        return [str(reply.ok.key_expr).rpartition("/")[2] for reply in replies if reply.ok]

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join()
        self._session.close()  # type: ignore[no-untyped-call]

    def _take(self, sample: zenoh.Sample) -> None:
        velocity, now = decode_velocity(sample.payload.to_bytes()), time.monotonic()
        self._newest = now, velocity.speed_m_s, velocity.turn_rad_s
        if abs(velocity.speed_m_s) > MOVES_M_S or abs(velocity.turn_rad_s) > MOVES_RAD_S:
            self.moves.append((now, str(sample.timestamp).partition("/")[2]))

    def _take_status(self, sample: zenoh.Sample) -> None:
        claim = json.loads(sample.payload.to_bytes()).get("claim", {})
        if claim.get("stand") == "plans":
            self.planned.append((time.monotonic(), claim["id"]))
        elif claim.get("stand") == "waits":
            self.waiting += 1

    def _move(self) -> None:
        hall, encoding = map_bytes(room(*HALL_M)), zenoh.Encoding(f"application/cdr;{MAP}")
        map_at = -math.inf
        while not self._stop.wait(PERIOD_S):
            if time.monotonic() - map_at > MAP_S:
                map_at = time.monotonic()
                self._session.put(f"{PREFIX}/map", hall, encoding=encoding)
            came_at, speed, rate = self._newest
            if time.monotonic() - came_at > TIMEOUT_S:
                speed = rate = 0.0
            yaw, way = self.pose.yaw + rate * PERIOD_S, speed * PERIOD_S
            x, y = self.pose.x + way * math.cos(yaw), self.pose.y + way * math.sin(yaw)
            self.pose = Pose2D(x, y, yaw)
            self.left_hall |= not (0.1 < x < HALL_M[0] - 0.1 and 0.1 < y < HALL_M[1] - 0.1)
            stamped = StampedPose(self.pose, "map", time.time_ns())
            self._session.put(TRUTH, encode_pose_stamped(stamped))


class Stage:
    """All parts, started; the robot drives once ``begin`` has returned.

    Args:
        folder: for configurations, states and logs.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: dict[str, subprocess.Popen[bytes] | Forked] = {}
        self._loops: list[threading.Thread] = []
        self._over = threading.Event()
        self._exits = ExitStack()
        self._router = free_endpoint()
        self._start("router")
        self.base = Base(self._router)
        self.links = {part: Link(self._router) for part in PARTS if part != "router"}

    def begin(self) -> None:
        """Start all, and wait until the robot drives and the second ones wait."""
        for part in ("pose", "planner"):
            self._start(part)
        self._until(lambda: bool(self.base.planned), "a planner")
        self._start("follower")
        self._until(lambda: bool(self.base.moves), "commands")
        for part in ("second daemon", "second follower"):
            self._start(part)
        self._until(lambda: self.base.waiting > 0, "a daemon that waits")
        until = time.monotonic() + 6.0
        # Of old ones both drive.
        while "waits" not in self.base.tokens("driver/*/*") and time.monotonic() < until:
            time.sleep(0.1)

    def fail(self, part: str, fault: str) -> None:
        """Have a part fail."""
        links = list(self.links.values()) if part == "router" else [self.links[part]]
        match fault:
            case "frozen":
                self._processes[part].send_signal(signal.SIGSTOP)
            case "killed":
                self._processes[part].kill()
            case "restarted":
                loop = threading.Thread(target=self._restart_again_and_again, args=(part,))
                loop.start()
                self._loops.append(loop)
            case "cut off":
                for link in links:
                    link.cut()
            case "slow":
                for link in links:
                    link.delay_s = DELAY_S

    def close(self) -> None:
        """End all."""
        self._over.set()
        for loop in self._loops:
            loop.join()
        for part in self._processes:
            self._end(part)
        self.base.close()
        for link in self.links.values():
            link.close()
        self._exits.close()

    def _restart_again_and_again(self, part: str, every_s: float = 2.5) -> None:
        while True:
            self._end(part)
            if self._over.is_set():
                return
            self._start(part)
            self._over.wait(every_s)

    def _end(self, part: str) -> None:
        process = self._processes[part]
        process.kill()
        process.wait()
        if isinstance(process, subprocess.Popen) and process.stdin is not None:
            process.stdin.close()

    def _start(self, part: str) -> None:
        name = part.replace(" ", "-")
        if part == "router":
            words = [str(ROUTER), self._router]
        elif part == "pose":
            words = ["-m", "tests.campaigns.fault_stage", self.links[part].endpoint]
        elif "follower" in part:
            words = ["-m", "fasaco_edge", "follow", "--config", str(self._config(part))]
        else:
            words = ["-m", "fasaco_edge", "run", "--config", str(self._config(part))]
            words += ["--state", str(self._folder / name)]
        is_ours = part in ("router", "pose")
        file = self._folder / f"{name}.log"
        if not is_ours:
            self._processes[part] = Forked(tuple(words), ENVIRONMENT, file, file)
            return
        log = self._exits.enter_context(file.open("ab"))
        self._processes[part] = subprocess.Popen(
            [sys.executable, *words], stdin=subprocess.PIPE, stdout=log, stderr=log, env=ENVIRONMENT
        )

    def _config(self, part: str) -> Path:
        config = self._folder / f"{part.replace(' ', '-')}.yaml"
        bus = {"mode": "client", "listen": [], "connect": [self.links[part].endpoint]}
        sections: dict[str, Any] = {"robot": {"name": "robot", "tool_width_m": 0.35}, "bus": bus}
        config.write_text(yaml.safe_dump(sections))
        return config

    def _until(self, holds: Callable[[], bool], what: str) -> None:
        until(holds, READY_S, why=lambda: f"no {what} after {READY_S:g} s: see {self._folder}")


def main() -> None:
    """Be the pose source until killed."""
    session = open_client(sys.argv[1])
    encoding = zenoh.Encoding(f"application/cdr;{POSE_STAMPED}")
    poses = session.declare_publisher(f"{PREFIX}/pose", encoding=encoding)
    session.declare_subscriber(TRUTH, lambda sample: poses.put(sample.payload))
    threading.Event().wait()


if __name__ == "__main__":
    main()
