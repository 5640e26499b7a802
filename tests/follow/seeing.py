"""A follower with a lidar on a plain, in simulated time: walls of the map, and what it lacks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fasaco_edge.follow.estimate import STAND, moved
from fasaco_edge.follow.follower import Follower
from fasaco_edge.follow.sight import Mount, Sight
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.motion import limited
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire.messages.base import LaserScan, encode_scan
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from tests.follow.closed_loop import LIMITS, PERIOD_S, path_message

RADIUS_M = 0.18
AHEAD = Mount()
BEAMS = 360
# A map from (-1, -3) to (7, 3) m.
GEOMETRY = GridGeometry(120, 160, 0.05, Pose2D(-1.0, -3.0))


@dataclass
class Disc:
    """Something round, that may move: x, y, radius [m], and its velocity [m/s]."""

    x: float
    y: float
    radius: float = 0.2
    vx: float = 0.0
    vy: float = 0.0


def plain_map(wall_y=None):
    """A free map; with a wall along y from there on [m]."""
    cells = np.zeros((GEOMETRY.rows, GEOMETRY.cols), np.int8)
    if wall_y is not None:
        cells[round((wall_y + 3.0) / 0.05) :] = 100
    return encode_occupancy_grid(OccupancyGrid(GEOMETRY, cells, "map", 1))


def scan_at(pose, discs, wall_y=None, noise=0.0, rng=None, mount=AHEAD, stamp_ns=0):
    """The scan of a lidar on a robot at ``pose``, as bytes."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x0, y0 = pose.x + cos * mount.x - sin * mount.y, pose.y + sin * mount.x + cos * mount.y
    ranges = []
    for index in range(BEAMS):
        angle = -math.pi + index * math.tau / BEAMS
        toward = pose.yaw + mount.yaw + (-angle if mount.upside_down else angle)
        ux, uy = math.cos(toward), math.sin(toward)
        nearest = (wall_y - y0) / uy if wall_y is not None and uy > 1e-9 else math.inf
        for disc in discs:
            dx, dy = disc.x - x0, disc.y - y0
            along, aside = dx * ux + dy * uy, ux * dy - uy * dx
            if along > 0.0 and abs(aside) < disc.radius:
                nearest = min(nearest, along - math.sqrt(disc.radius**2 - aside**2))
        if rng is not None and math.isfinite(nearest):
            nearest += rng.normal(0.0, noise)
        ranges.append(nearest if nearest < 8.0 else math.inf)
    told = LaserScan(-math.pi, math.tau / BEAMS, 0.05, 8.0, tuple(ranges), "laser", stamp_ns)
    return encode_scan(told)


@dataclass
class Seeing:
    """A robot that starts at 0, 0 and sees, and what stands or walks about."""

    discs: list[Disc] = field(default_factory=list)
    wall_y: float | None = None
    noise: float = 0.0
    scans: bool = True
    mount: Mount = field(default_factory=Mount)

    def __post_init__(self):
        self.now, self.pose, self.last = 10.0, Pose2D(0.0, 0.0), STAND
        self.touched_at = []
        self._rng = np.random.default_rng(1)
        self._sight = Sight(self.mount, RADIUS_M)
        self._sight.take_map(plain_map(self.wall_y))
        self.follower = Follower(LIMITS, sight=self._sight)
        self.follower.take_planner("a1")
        self.follower.take_heartbeat(self.now)

    def send(self, *xy):
        self.follower.take_path(path_message(xy))

    def run(self, seconds):
        return [self.step() for _ in range(round(seconds / PERIOD_S))]

    def step(self):
        self.now += PERIOD_S
        follower = self.follower
        follower.take_heartbeat(self.now)
        follower.take_pose(StampedPose(self.pose, "map", 0), self.now)
        if self.scans and round(self.now / PERIOD_S) % 2 == 0:
            payload = scan_at(self.pose, self.discs, self.wall_y, self.noise, self._rng, self.mount)
            follower.take_scan(payload, self.now)
        command = follower.step(self.now) or STAND
        before = self.last.speed
        self.last = type(command)(
            limited(before, command.speed, LIMITS.acceleration * PERIOD_S), command.turn_rate
        )
        self.pose = moved(self.pose, self.last, PERIOD_S)
        for disc in self.discs:
            disc.x, disc.y = disc.x + disc.vx * PERIOD_S, disc.y + disc.vy * PERIOD_S
        if self.gap <= 0.0:
            self.touched_at.append(self.last.speed)
        return follower.state

    @property
    def gap(self):
        """The distance between the robot's disc and the nearest thing [m]."""
        here = self.pose.x, self.pose.y
        gaps = [math.dist(here, (disc.x, disc.y)) - disc.radius for disc in self.discs]
        return min(gaps, default=math.inf) - RADIUS_M
