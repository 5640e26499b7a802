"""The follower and the simulated base in one process, in simulated time, with delays."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import replace

import numpy as np

from fasaco_edge.follow.estimate import BaseLimits
from fasaco_edge.follow.follower import Follower
from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Activity, World
from fasaco_edge.wire.messages.paths import encode_path

CONFIG = SimulationConfig()
LIMITS = BaseLimits(
    CONFIG.speed_m_s,
    CONFIG.acceleration_m_s2,
    CONFIG.turn_rad_s,
    CONFIG.turn_acceleration_rad_s2,
    math.radians(1.0),
)
PERIOD_S = 0.05


def path_message(xy, yaw=None):
    """A path through points (x, y) [m], with headings [rad] or 0."""
    points = np.array(xy, np.float64).reshape(-1, 2)
    return encode_path(points, np.zeros(len(points)) if yaw is None else yaw, "map", 1)


class ClosedLoop:
    """A follower drives a world; poses and commands take a while, and cycles come late.

    The robot turns about a point ``left_m`` to the left of its poses; with ``turn_m`` it is one
    that cannot turn on the spot.
    """

    def __init__(self, truth: OccupancyGrid, start: Pose2D, *, delay_s=0.02, jitter_s=0.0,
                 noise=0.0, turn_gain=1.0, pose_hz=10.0, late_s=0.0, left_m=0.0, turn_m=0.0,
                 limits=LIMITS, seed=0):  # fmt: skip
        self.world = World(truth, start, replace(CONFIG, turn_radius_m=turn_m))
        self.follower = Follower(replace(limits, turn_radius=turn_m))
        self.follower.take_planner("a1")
        self.follower.take_heartbeat(0.0)
        self.now = 0.0
        self.states: Counter[FollowerState] = Counter()
        self.truth_at: list[Pose2D] = []
        self._delay_s, self._jitter_s, self._noise = delay_s, jitter_s, noise
        self._turn_gain, self._late_s, self._left_m = turn_gain, late_s, left_m
        self._rng = np.random.default_rng(seed)
        self._poses, self._commands = deque(), deque()
        self._tick, self._pose_ticks = 0, CONFIG.period_ticks(pose_hz)
        self._due = 0.0

    def send(self, xy, yaw=None):
        self.follower.take_path(path_message(xy, yaw))

    @property
    def trail(self):
        """Where the robot was, float64 (n, 2) [m]."""
        points = np.array([(pose.x, pose.y) for pose in self.truth_at])
        return points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-9)]

    def wait(self, seconds):
        until = self.now + seconds
        self.run(lambda: self.now > until)

    def drive(self, most_s=600.0):
        return self.run(lambda: self.follower.state is FollowerState.DRIVEN, most_s)

    def run(self, until, most_s=600.0):
        begun = self.now
        while not until():
            assert self.now - begun < most_s, (self.follower.state, self.follower.detail)
            self._step()
        return self.now - begun

    def _step(self):
        while self._commands and self._commands[0][0] <= self.now:
            _, command = self._commands.popleft()
            self.world.move(command.speed, command.turn_rate * self._turn_gain)
        self.world.tick()
        self._tick += 1
        self.now = self._tick * CONFIG.tick_s
        pose = self.world.pose
        self.truth_at.append(pose)
        if self._tick % self._pose_ticks == 0:
            dx, dy, turn = self._rng.normal(0.0, self._noise, 3) if self._noise else (0, 0, 0)
            dx += self._left_m * math.sin(pose.yaw)
            dy -= self._left_m * math.cos(pose.yaw)
            told = Pose2D(pose.x + dx, pose.y + dy, pose.yaw + turn)
            self._poses.append((self.now + self._late(), StampedPose(told)))
        while self._poses and self._poses[0][0] <= self.now:
            at, stamped = self._poses.popleft()
            self.follower.take_pose(stamped, at)
        if self.now >= self._due:
            self._due += PERIOD_S
            if self._late_s:
                # As of the node: cycles that were missed are not made up for.
                self._due = self.now + PERIOD_S + self._rng.uniform(0.0, self._late_s)
            self.follower.take_heartbeat(self.now)
            command = self.follower.step(self.now)
            self.states[self.follower.state] += 1
            if command is not None:
                self._commands.append((self.now + self._late(), command))

    def _late(self):
        return self._delay_s + self._rng.uniform(0.0, self._jitter_s)


def ideal_seconds(truth, start, xy):
    """How long the ideal driver takes [s]."""
    world = World(truth, start, CONFIG)
    world.tick()
    world.follow(np.array(xy, np.float64))
    ticks = 1
    while world.activity is not Activity.IDLE:
        world.tick()
        ticks += 1
    return ticks * CONFIG.tick_s
