"""Robot driven by an imitation of Nav2's controller server.

``python -m tests.support.nav2_robot JSON``: endpoint, domain (null behind a bridge), release, start
(x, y [m]), and faults. It publishes its pose, and prints its record as JSON once its standard input
ends. The controller imitates nav2_regulated_pure_pursuit_controller: it continues at the nearest
pose of the path within half a costmap, and turns to the goal's heading at the goal. The goal
checker imitates SimpleGoalChecker (stateful), the progress checker SimpleProgressChecker. Their
parameters are those of deploy/turtlebot.md.
"""

from __future__ import annotations

import json
import math
import random
import sys
import threading
import time
from typing import Any

from tests.support.nav2_server import (
    ABORTED,
    CANCELED,
    SUCCEEDED,
    ActionServer,
    Faults,
    Handle,
    open_session,
)

PERIOD_S = 0.05
SEARCH_M = 2.5
TOLERANCE_M, TOLERANCE_RAD = 0.1, 0.5
LOOK_AHEAD_M = 0.15
TURN_RAD_S = 3.0
PROGRESS_M, PROGRESS_S = 0.5, 10.0
POSE_TYPE = "geometry_msgs/msg/PoseStamped"
POSE_HASH = "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"


class Nav2Robot:
    """Robot and controller server."""

    def __init__(self, wanted: dict[str, Any]) -> None:
        self.wanted = wanted
        self.x, self.y = wanted["start"]
        self.yaw = 0.0
        self.driven_m = 0.0
        # Pauses between goals, except after an abort, a restart or the last goal.
        self.standing_s = self.driving_s = self._idle_s = 0.0
        self._counts_idle = False
        self.trail: list[tuple[float, float]] = []
        self.errors: list[int] = []
        self.restarts = 0
        self.refused: list[str] = []
        self.counts = {"goals": 0, "preempted": 0, "canceled": 0}
        self._random = random.Random(wanted.get("seed", 0))
        self._server = self._serve()
        self._path: list[tuple[float, float]] = []
        # Heading of the goal, and whether the robot has reached its position.
        self._end_yaw, self._is_there = 0.0, False
        self._progress = (0.0, 0.0, 0.0)
        self._session = open_session(wanted["endpoint"])
        key = "pose"
        if wanted["domain"] is not None:
            key = f"{wanted['domain']}/pose/geometry_msgs::msg::dds_::PoseStamped_/{POSE_HASH}"
        self._poses = self._session.declare_publisher(key)

    def run(self, stop: threading.Event) -> None:
        """Drive until ``stop`` is set."""
        last = time.monotonic()
        next_abort = self._after("abort_every_s")
        next_restart = self._after("restart_every_s")
        count = 0
        while not stop.wait(PERIOD_S):
            now = time.monotonic()
            dt, last = min(now - last, 0.2), now
            # Without a goal, an abort is skipped: later it would abort a goal at its start.
            abort = now >= next_abort and self._server.current is not None
            if now >= next_abort:
                next_abort = self._after("abort_every_s")
            if now >= next_restart:
                next_restart = self._after("restart_every_s")
                self._restart()
            self._tick(dt, now, abort=abort)
            count += 1
            if count % 2 == 0:
                self._publish()
        self._leave()

    def _after(self, name: str) -> float:
        mean_s = self.wanted.get(name)
        return time.monotonic() + (self._random.uniform(0.5, 1.5) * mean_s if mean_s else math.inf)

    def _faults(self) -> Faults:
        wanted = self.wanted
        # With the same seed, each start would lose the same replies.
        seed = wanted.get("seed", 0) + 1000 * self.restarts
        return Faults(wanted.get("delay_s", 0.0), wanted.get("lost", 0.0), seed)

    def _serve(self) -> ActionServer:
        wanted, faults = self.wanted, self._faults()
        action = wanted.get("action", "/follow_path")
        release = wanted.get("release", "jazzy")
        return ActionServer(wanted["endpoint"], wanted["domain"], release, faults, action)

    def _restart(self) -> None:
        self._leave()
        self.restarts += 1
        self._counts_idle = False
        time.sleep(1.0)
        self._path = []
        self._server = self._serve()

    def _leave(self) -> None:
        self.refused += self._server.refused
        for name, count in self._server.counts.items():
            self.counts[name] += count
        self._server.close()

    def _tick(self, dt: float, now: float, *, abort: bool) -> None:
        """One cycle of ControllerServer::computeControl."""
        server = self._server
        for handle in (server.pending, server.current):
            if handle is not None and handle.is_canceling:
                server.end(handle, CANCELED)
        if server.pending is not None:
            self._begin(server.accept_pending(), now)
        if (handle := server.current) is None:
            self._idle_s += dt
            return
        self.driving_s += dt
        if abort:
            self._abort(handle, 106, "no valid control was found")
            return
        if math.dist((self.x, self.y), self._progress[:2]) > PROGRESS_M:
            self._progress = (self.x, self.y, now)
        elif now - self._progress[2] > PROGRESS_S:
            self._abort(handle, 105, "failed to make progress")
            return
        if self._is_there:
            self._turn(self._end_yaw, dt)
        else:
            self._drive(dt)
        far = math.dist((self.x, self.y), self._path[-1])
        self._is_there = self._is_there or far <= TOLERANCE_M
        off = abs(math.remainder(self._end_yaw - self.yaw, math.tau))
        if self._is_there and off <= TOLERANCE_RAD:
            server.end(handle, SUCCEEDED)
            self._idle_s, self._counts_idle = 0.0, True

    def _begin(self, handle: Handle, now: float) -> None:
        """Check a goal as the controller server does, and begin it."""
        goal = handle.message
        if goal.controller_id not in ("", "FollowPath"):
            self._abort(handle, 101, f"no controller {goal.controller_id}")
        elif goal.goal_checker_id not in ("", "goal_checker"):
            self._abort(handle, 100, f"no goal checker {goal.goal_checker_id}")
        elif not goal.path.poses:
            self._abort(handle, 103, "the path is empty")
        elif goal.path.header.frame_id != "map":
            self._abort(handle, 102, f"no transform from {goal.path.header.frame_id}")
        else:
            poses = [pose.pose for pose in goal.path.poses]
            assert all(
                abs(math.hypot(pose.orientation.z, pose.orientation.w) - 1.0) < 1e-6
                for pose in poses
            )
            self._path = [(pose.position.x, pose.position.y) for pose in poses]
            last = poses[-1].orientation
            self._end_yaw, self._is_there = 2.0 * math.atan2(last.z, last.w), False
            self._progress = (self.x, self.y, now)
            if self._counts_idle:
                self.standing_s += self._idle_s
            self._idle_s, self._counts_idle = 0.0, False

    def _abort(self, handle: Handle, code: int, text: str) -> None:
        self.errors.append(code)
        self._counts_idle = False
        self._server.end(handle, ABORTED, code, text)

    def _drive(self, dt: float) -> None:
        here, path = (self.x, self.y), self._path
        nearest, best, way = 0, math.dist(here, path[0]), 0.0
        for index in range(1, len(path)):
            way += math.dist(path[index - 1], path[index])
            if way > SEARCH_M:
                break
            if (far := math.dist(here, path[index])) < best:
                nearest, best = index, far
        del path[:nearest]
        carrot = next((p for p in path if math.dist(here, p) >= LOOK_AHEAD_M), path[-1])
        turn = self._turn(math.atan2(carrot[1] - self.y, carrot[0] - self.x), dt)
        # Large turns are made on the spot, as with use_rotate_to_heading.
        step = self.wanted.get("speed", 1.0) * dt if abs(turn) < 0.785 else 0.0
        step = min(step, math.dist(here, carrot))
        self.x += step * math.cos(self.yaw)
        self.y += step * math.sin(self.yaw)
        self.driven_m += step
        if not self.trail or math.dist(self.trail[-1], (self.x, self.y)) > 0.05:
            self.trail.append((self.x, self.y))

    def _turn(self, yaw: float, dt: float) -> float:
        """Turn towards a heading; return the angle to it before the turn [rad]."""
        turn = math.remainder(yaw - self.yaw, math.tau)
        most = TURN_RAD_S * dt
        self.yaw += min(max(turn, -most), most)
        return turn

    def _publish(self) -> None:
        types = self._server.store.types
        sec, nanosec = divmod(time.time_ns(), 1_000_000_000)
        message = types[POSE_TYPE](
            header=types["std_msgs/msg/Header"](
                stamp=types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id="map"
            ),
            pose=types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](x=self.x, y=self.y, z=0.0),
                orientation=types["geometry_msgs/msg/Quaternion"](
                    x=0.0, y=0.0, z=math.sin(self.yaw / 2), w=math.cos(self.yaw / 2)
                ),
            ),
        )
        store = self._server.store
        self._poses.put(bytes(store.serialize_cdr(message, POSE_TYPE, little_endian=True)))


def main() -> None:
    """Drive until standard input ends."""
    robot, stop = Nav2Robot(json.loads(sys.argv[1])), threading.Event()
    print("ready", flush=True)
    thread = threading.Thread(target=robot.run, args=(stop,))
    thread.start()
    sys.stdin.read()
    stop.set()
    thread.join()
    names = ("x", "y", "driven_m", "driving_s", "standing_s", "errors", "restarts", "refused")
    names += ("counts", "trail")
    print(json.dumps({name: getattr(robot, name) for name in names}), flush=True)


if __name__ == "__main__":
    main()
