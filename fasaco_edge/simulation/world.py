"""Simulated world: a ground truth, a robot that maps it, and a clock of equal ticks.

No bus, no file, no wall clock: ``tick`` returns the messages to publish. The same calls give the
same values, bit for bit.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import StartBlocked, StartOutsideMap
from fasaco_edge.grid.geometry import Point, Pose2D, StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import disc_is_free
from fasaco_edge.simulation.mapper import Mapper
from fasaco_edge.simulation.robot import (
    ARRIVED_M,
    Battery,
    DriveState,
    SimulationConfig,
    corners_to_end,
    driven,
    moved_by,
    stopping_point,
)

# Spacing of the recorded track on straight runs [m]; corners are recorded as they are.
TRACK_SPACING_M = 0.02
# Number of the track's last points that show which part of a new path is driven already: at twenty
# times real time, a path planned in a second begins five metres behind the robot.
RECENT_TRACK_POINTS = 500
# Timeout of the velocity, after which a base stops by itself [s].
VELOCITY_TIMEOUT_S = 0.5
# Directions, relative to its heading, in which a base slides along a wall that it hits [deg].
SLIDES_DEG = (15, -15, 30, -30, 45, -45, 60, -60, 75, -75)
# Distance to another robot's hull at which the robot stops [m]; all robots have one size.
MEETING_M = 0.05
# Clearance of the robot's own way to its path, where possible [m].
MARGIN_M = 0.005


class Activity(enum.Enum):
    """Activity of the robot."""

    IDLE = "idle"
    """The robot has no path, or has driven it to its end."""
    DRIVING = "driving"
    """The robot is on a path, or on its way to one."""
    NO_WAY = "no_way"
    """The robot's map shows no clear way to the path's beginning; it searches after every scan."""
    STOPPED = "stopped"
    """The robot stopped before an obstacle of its own map, searched once for another way to its
    path, and waits for another path."""
    COLLIDED = "collided"
    """The robot drove into an obstacle, stands there, and waits for another path."""


# Distance from its start within which the robot is in its dock [m].
DOCK_M = 0.3
BATTERY_HZ = 1.0


@dataclass(frozen=True, slots=True)
class Emission:
    """Messages that the robot publishes after a tick: map, pose and battery, each or none."""

    map: OccupancyGrid | None = None
    pose: StampedPose | None = None
    battery: Battery | None = None


class World:
    """A robot that knows only what it has scanned, in a static building.

    Args:
        truth: the building. All pixels that are not free, even unknown ones, are obstacles.
        start: the robot's first pose, in the frame of ``truth``.
        config: the robot.
        mapper: the robot's mapper; None for a mapper without errors.

    Raises:
        StartOutsideMap: ``start`` is not on ``truth``.
        StartBlocked: the robot's hull does not fit at ``start``.
    """

    def __init__(
        self,
        truth: OccupancyGrid,
        start: Pose2D,
        config: SimulationConfig,
        mapper: Mapper | None = None,
    ) -> None:
        self._truth, self.config = truth, config
        # Name of the frame of all messages of the robot.
        self.frame = truth.frame
        col, row = truth.geometry.to_pixels(start.x, start.y)
        if not (0 <= row < truth.geometry.rows and 0 <= col < truth.geometry.cols):
            raise StartOutsideMap(
                f"the start ({start.x:g}, {start.y:g}) m is outside the map, "
                f"{truth.geometry.extent}"
            )
        if not _fits(truth, start, config):
            raise StartBlocked(
                f"a robot of radius {config.robot_radius_m:g} m does not fit at the start "
                f"({start.x:g}, {start.y:g}) m"
            )
        self.drive = DriveState(start)
        self.mapper = mapper or Mapper(truth, config)
        self._path: NDArray[np.float64] | None = None
        self._corners: list[Point] = []
        # The newest velocity, if the robot is driven by velocities: speed [m/s], turn rate [rad/s],
        # and its tick.
        self._commanded: tuple[float, float, int] | None = None
        self._dock = start.x, start.y
        self.battery = Battery(config.battery_min) if config.battery_min else None
        self._track = [(start.x, start.y)]
        self._ticks = 0
        self.activity = Activity.IDLE
        self.distance_m = 0.0
        self.collisions = 0
        self.stops = 0
        # Positions of other robots [m], by name; numbers of touches, and of stops before a robot.
        self.others: dict[str, Point] = {}
        self.touches = self.meetings = 0
        self._is_held = False
        # Number of the robot's stops when its path arrived.
        self._stopped_at = 0
        # Number of ticks that the robot has stood since it moved; longest time that it stood [s].
        self._stands, self.longest_stand_s = 0, 0.0

    @property
    def pose(self) -> Pose2D:
        """The robot's true pose."""
        return self.drive.pose

    @property
    def estimated_pose(self) -> Pose2D:
        """Its mapper's estimate of the pose."""
        return self.mapper.estimated(self.drive.pose)

    @property
    def stamp_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self._ticks * self.config.tick_ns

    @property
    def track(self) -> NDArray[np.float64]:
        """The points (x, y) [m] that the robot drove through, float64 (n, 2), the start first."""
        pose = self.drive.pose
        return np.array([*self._track, (pose.x, pose.y)], np.float64)

    def emission(self) -> Emission:
        """Return map and pose as they are now; there is no map before the first tick."""
        pose = StampedPose(self.estimated_pose, self.frame, self.stamp_ns)
        return Emission(self.mapper.snapshot(self.stamp_ns), pose, self.battery)

    def follow(self, path: NDArray[np.float64]) -> None:
        """Drive along ``path``, waypoints (x, y) [m], float64 (n, 2); stop if it is empty.

        It replaces the last path. The robot finds a way only after the scan in its first tick.
        """
        self._path, self._stopped_at = path, self.stops
        self._join()

    def move(self, speed_m_s: float, turn_rad_s: float) -> None:
        """Move with a velocity for up to VELOCITY_TIMEOUT_S from the next tick; drop the path."""
        self._commanded = speed_m_s, turn_rad_s, self._ticks
        self._path, self._corners = None, []

    @property
    def unanswered_s(self) -> float:
        """Time since the newest velocity while the robot moves, or is commanded to [s]."""
        if self._commanded is None or not (self.drive.moving or any(self._commanded[:2])):
            return 0.0
        return (self._ticks - self._commanded[2]) * self.config.tick_s

    def tick(self) -> Emission:
        """Let one time step pass; return the messages published after it."""
        self._move()
        self._ticks += 1
        if self.drive.moving:
            stood_s = self._stands * self.config.tick_s
            self._stands, self.longest_stand_s = 0, max(self.longest_stand_s, stood_s)
        elif self.distance_m > 0.0:
            self._stands += 1
        self._drain()
        if self._is_due(self.config.scan_hz):
            self.mapper.scan(self.pose)
            if self.activity is Activity.NO_WAY or self._may_try_again():
                self._join()
        pose = StampedPose(self.estimated_pose, self.frame, self.stamp_ns)
        return Emission(
            self.mapper.snapshot(self.stamp_ns) if self._is_due(self.config.map_hz) else None,
            pose if self._is_due(self.config.pose_hz) else None,
            self.battery if self._is_due(BATTERY_HZ) else None,
        )

    def _is_due(self, rate_hz: float) -> bool:
        """Return whether an event of a rate is due in this tick; all are due in the first tick."""
        return (self._ticks - 1) % self.config.period_ticks(rate_hz) == 0

    def _drain(self) -> None:
        battery, drive = self.battery, self.drive
        if battery is None:
            return
        if battery.level == 0.0:  # with an empty battery the robot stands
            self.drive = DriveState(drive.pose)
            self._path, self._corners, self.activity = None, [], Activity.IDLE
        away_m = math.dist(self._dock, (drive.pose.x, drive.pose.y))
        battery.tick(self.config.tick_s, moves=drive.moving, is_docked=away_m <= DOCK_M)

    def _join(self) -> None:
        if self._path is None:
            return
        track, is_clear = self._recent_track(), self.mapper.is_clear
        # Driving straight on, even within the margin, has priority over driving back.
        for goes_back, margin_m in ((False, MARGIN_M), (False, 0.0), (True, MARGIN_M), (True, 0.0)):
            has_room = partial(is_clear, margin_m=margin_m)
            route = corners_to_end(self._path, track, has_room, goes_back=goes_back)
            if route is not None:
                self._corners = [(float(x), float(y)) for x, y in route[::-1]]
                self.activity = Activity.DRIVING if self._corners else Activity.IDLE
                return
        self._corners, self.activity = [], Activity.NO_WAY

    def _may_try_again(self) -> bool:
        is_first = self.stops == self._stopped_at + 1
        return self.activity is Activity.STOPPED and is_first and not self.drive.moving

    def _recent_track(self) -> NDArray[np.float64]:
        """Return the track's last points, and the way to rest, on the robot's map, (n, 2) [m]."""
        here = (self.pose.x, self.pose.y)
        rest = stopping_point(self.drive, self.config)
        points = 2 + int(math.dist(here, rest) / TRACK_SPACING_M)
        ahead = np.linspace(here, rest, points).tolist()
        track = [*self._track[-RECENT_TRACK_POINTS:], *ahead]
        return np.array([self._on_map((x, y)) for x, y in track], np.float64)

    def _on_map(self, place: Point) -> Point:
        pose = self.mapper.estimated(Pose2D(*place))
        return pose.x, pose.y

    def _move(self) -> None:
        if self._commanded is not None:
            self._move_as_commanded(*self._commanded)
            return
        here = (self.pose.x, self.pose.y)
        while self._corners and math.dist(here, self._goal()) < ARRIVED_M:
            self._corners.pop()
        if not self._corners:
            if self.activity in (Activity.DRIVING, Activity.STOPPED):
                self.activity = Activity.IDLE
            if not self.drive.moving:
                return
        goal = self._goal() if self._corners and self._may_drive_on() else None
        if goal is not None or self.drive.moving:
            self._go_on(driven(self.drive, goal, self.config))

    def _goal(self) -> Point:
        return self.mapper.true_place(*self._corners[-1])

    def _may_drive_on(self) -> bool:
        """Return whether no obstacle of the robot's map, and no other robot, stops the robot."""
        if self.activity is Activity.STOPPED:
            return False
        ahead = driven(self.drive, self._goal(), self.config)
        rest = stopping_point(ahead, self.config)
        was_held, self._is_held = self._is_held, self._meets(rest)
        if self._is_held:
            self.meetings += not was_held
            return False
        if ahead.speed == 0.0 or self.mapper.is_clear_at(self._on_map(rest)):
            return True
        self.activity = Activity.STOPPED
        self.stops += 1
        return False

    def _move_as_commanded(self, speed_m_s: float, turn_rad_s: float, tick: int) -> None:
        if (self._ticks - tick) * self.config.tick_s > VELOCITY_TIMEOUT_S:
            speed_m_s = turn_rad_s = 0.0
        ahead = moved_by(self.drive, speed_m_s, turn_rad_s, self.config)
        was_touching = self.activity is Activity.COLLIDED
        self.activity = Activity.DRIVING if ahead.moving else Activity.IDLE
        hits = ahead.moving and not _fits(self._truth, ahead.pose, self.config)
        if hits and (slid := self._slid(ahead)) is not None:
            self.collisions += not was_touching
            self._go_on(slid)
            self.activity = Activity.COLLIDED
        elif ahead.moving or self.drive.moving:
            self._go_on(ahead)

    def _slid(self, ahead: DriveState) -> DriveState | None:
        here, pose = self.pose, ahead.pose
        way = math.dist((here.x, here.y), (pose.x, pose.y))
        for off in map(math.radians, SLIDES_DEG):
            along, share = pose.yaw + off, math.cos(off)
            x, y = here.x + share * way * math.cos(along), here.y + share * way * math.sin(along)
            slid = Pose2D(x, y, pose.yaw)
            if _fits(self._truth, slid, self.config):
                return DriveState(slid, share * ahead.speed, ahead.turn_rate)
        return None

    def _meets(self, place: Point, margin_m: float = MEETING_M) -> bool:
        """Return whether a point is too near to another robot, and nearer than this robot is."""
        here, least_m = (self.pose.x, self.pose.y), 2 * self.config.hull_radius_m + margin_m
        return any(
            math.dist(place, other) < min(least_m, math.dist(here, other) - 1e-9)
            for other in self.others.values()
        )

    def _go_on(self, ahead: DriveState) -> None:
        """Take over a state; stand still instead if it is in a wall, or in another robot."""
        if self._meets((ahead.pose.x, ahead.pose.y), 0.0):
            self.touches += self.drive.moving
            self.drive = DriveState(self.pose)
        elif not _fits(self._truth, ahead.pose, self.config):
            # Commands that keep pushing the robot against a wall count as one collision.
            self.collisions += self._commanded is None or self.drive.moving
            self.drive = DriveState(self.pose)
            self._path, self._corners, self.activity = None, [], Activity.COLLIDED
        else:
            # The track gets the point that the robot leaves, at intervals and at corners.
            here = (self.pose.x, self.pose.y)
            gone = math.dist(self._track[-1], here)
            turns_off = ahead.speed != 0.0 and self.drive.speed == 0.0
            if gone >= TRACK_SPACING_M or (gone > 0.0 and turns_off):
                self._track.append(here)
            self.distance_m += abs(ahead.speed) * self.config.tick_s
            self.drive = ahead


def _fits(truth: OccupancyGrid, pose: Pose2D, config: SimulationConfig) -> bool:
    x, y = truth.geometry.to_pixels(pose.x, pose.y)
    radius = config.hull_radius_m / truth.geometry.resolution
    return bool(disc_is_free(truth.cells, x, y, radius, config.free_at_most))
