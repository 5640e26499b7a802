"""Simulated robot: a differential drive that follows a polyline, and changes to new polylines.

It drives straight and turns on the spot. The drive is ideal (no slip, no delay), so that a run
shows effects of the path alone. It comes to rest at every corner: that is the cost of turns.

A path begins at the centre of the cell that the robot was in when it was planned. Since then the
robot has moved on: through the first waypoints, if the new path begins like the old one, or to one
side. It may skip only waypoints that it has driven through. Its position alone does not determine
them: a path into a dead end and back passes the same point twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.motion import limited, stopping_rate

MAY_BE_ZERO = ("padding_m", "free_at_most", "turn_radius_m", "battery_min")

# Distance within which the robot has reached a corner [m].
ARRIVED_M = 1e-3
# Heading error below which the robot starts to drive [rad]: after 10 m it is then within ARRIVED_M
# of its corner.
ALIGNED_RAD = 1e-4
# Heading error up to which the robot steers while driving; above, it comes to rest and turns [rad].
MISALIGNED_RAD = 0.05
# Bend up to which the robot steers and does not stop [rad].
STRAIGHT_RAD = 0.02
# A smaller bend is a corner, too, if the robot would miss it by more than this [m].
CUT_M = 0.002
# Distance from the track within which a waypoint has been driven through [m], at least half of the
# track's spacing.
PASSED_WITHIN_M = 0.02
# As a last resort, the path is joined anywhere within this distance of its start [m].
JOIN_WITHIN_M = 2.0
# A way back may leave the track at each of its last BACK_POINTS points, and at every BACK_STRIDE-th
# point before.
BACK_POINTS, BACK_STRIDE = 100, 10


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """The robot, its scanner and its rates. Times and rates are in simulated time.

    The defaults are a TurtleBot3 Waffle with an LDS-01 scanner, rounded.

    Attributes:
        speed_m_s: driving speed [m/s].
        turn_rad_s: turning speed in place [rad/s].
        acceleration_m_s2: acceleration and deceleration of driving [m/s^2].
        turn_acceleration_rad_s2: acceleration and deceleration of turning [rad/s^2].
        robot_radius_m: radius that the planner uses [m].
        padding_m: difference of that radius and the hull's [m]. Only the hull collides: a robot as
            wide as its corridor would touch at the first rounding error.
        range_m: range of the scanner [m].
        free_at_most: occupancy values up to this are free [percent].
        map_chunk_m: the published map grows by blocks of about this size [m].
        tick_s: the simulation's time step [s].
        scan_hz, map_hz, pose_hz: rates [Hz]; their periods are rounded to whole ticks.
        turn_radius_m: radius of the tightest arc that the base drives by velocities, forward or
            backward [m]; 0 for a base that turns on the spot, and drives only forward.
        battery_min: driving time of its battery [min]; 0 for unlimited. It charges where the robot
            began.
    """

    speed_m_s: float = 0.25
    turn_rad_s: float = 1.8
    acceleration_m_s2: float = 0.5
    turn_acceleration_rad_s2: float = 3.2
    robot_radius_m: float = 0.2
    padding_m: float = 0.02
    range_m: float = 3.5
    free_at_most: int = 25
    map_chunk_m: float = 1.0
    tick_s: float = 0.02
    scan_hz: float = 5.0
    map_hz: float = 2.0
    pose_hz: float = 10.0
    turn_radius_m: float = 0.0
    battery_min: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, may_be_zero = getattr(self, field.name), field.name in MAY_BE_ZERO
            if not math.isfinite(value) or value < 0 or (value == 0 and not may_be_zero):
                least = "at least 0" if may_be_zero else "above 0"
                raise BadConfiguration(f"{field.name} must be {least}, got {value:g}")
        if self.padding_m >= self.robot_radius_m:
            raise BadConfiguration(
                f"padding_m must be below robot_radius_m ({self.robot_radius_m}), "
                f"got {self.padding_m}"
            )

    @property
    def hull_radius_m(self) -> float:
        """Radius of the disc that collides [m]."""
        return self.robot_radius_m - self.padding_m

    @property
    def tick_ns(self) -> int:
        """The time step [ns]."""
        return round(self.tick_s * 1e9)

    def period_ticks(self, rate_hz: float) -> int:
        """Return the period of a rate in ticks, at least 1."""
        return max(1, round(1.0 / (rate_hz * self.tick_s)))


@dataclass(frozen=True, slots=True)
class DriveState:
    """Pose and velocity of the robot.

    Attributes:
        pose: pose in the map frame.
        speed: forward speed [m/s]; negative only with a turning radius.
        turn_rate: counter-clockwise [rad/s].
    """

    pose: Pose2D
    speed: float = 0.0
    turn_rate: float = 0.0

    @property
    def moving(self) -> bool:
        """Whether any wheel turns."""
        return self.speed != 0.0 or self.turn_rate != 0.0


def driven(state: DriveState, goal: Point | None, config: SimulationConfig) -> DriveState:
    """Return the state a tick later, for a robot that drives to ``goal`` [m] and stops there.

    Without a goal the robot brakes. It drives only while it points at the goal, and
    turns only at rest, except for corrections below MISALIGNED_RAD.
    """
    dt = config.tick_s
    pose = state.pose
    speed_goal = turn_goal = 0.0
    if goal is not None:
        ahead_x, ahead_y = goal[0] - pose.x, goal[1] - pose.y
        error = math.remainder(math.atan2(ahead_y, ahead_x) - pose.yaw, math.tau)
        if abs(error) <= (MISALIGNED_RAD if state.speed > 0.0 else ALIGNED_RAD):
            distance = math.hypot(ahead_x, ahead_y)
            speed_goal = stopping_rate(distance, config.acceleration_m_s2, dt)
        if state.speed == 0.0 or speed_goal > 0.0:
            rate = stopping_rate(abs(error), config.turn_acceleration_rad_s2, dt)
            turn_goal = math.copysign(min(rate, config.turn_rad_s), error)
    speed = limited(state.speed, min(speed_goal, config.speed_m_s), config.acceleration_m_s2 * dt)
    turn_rate = limited(state.turn_rate, turn_goal, config.turn_acceleration_rad_s2 * dt)
    yaw = math.remainder(pose.yaw + turn_rate * dt, math.tau)
    moved = Pose2D(pose.x + speed * dt * math.cos(yaw), pose.y + speed * dt * math.sin(yaw), yaw)
    return DriveState(moved, speed, turn_rate)


def moved_by(
    state: DriveState, speed_m_s: float, turn_rad_s: float, config: SimulationConfig
) -> DriveState:
    """Return the state a tick later, of a base that follows a velocity within its limits."""
    dt = config.tick_s
    slowest = -config.speed_m_s if config.turn_radius_m else 0.0
    goal = min(max(speed_m_s, slowest), config.speed_m_s)
    turn_goal = min(max(turn_rad_s, -config.turn_rad_s), config.turn_rad_s)
    speed = limited(state.speed, goal, config.acceleration_m_s2 * dt)
    turn_rate = limited(state.turn_rate, turn_goal, config.turn_acceleration_rad_s2 * dt)
    if config.turn_radius_m:
        tightest = abs(speed) / config.turn_radius_m
        turn_rate = min(max(turn_rate, -tightest), tightest)
    pose = state.pose
    heading = pose.yaw + 0.5 * turn_rate * dt
    way = speed * dt
    yaw = math.remainder(pose.yaw + turn_rate * dt, math.tau)
    moved = Pose2D(pose.x + way * math.cos(heading), pose.y + way * math.sin(heading), yaw)
    return DriveState(moved, speed, turn_rate)


def stopping_point(state: DriveState, config: SimulationConfig) -> Point:
    """Return the point (x, y) [m] where the robot would come to rest if it braked now."""
    # (v - a dt) dt, (v - 2 a dt) dt, ... add up to v^2 / 2a - v dt / 2.
    reach = max(
        state.speed**2 / (2.0 * config.acceleration_m_s2) - 0.5 * state.speed * config.tick_s, 0.0
    )
    pose = state.pose
    return pose.x + reach * math.cos(pose.yaw), pose.y + reach * math.sin(pose.yaw)


def corners(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a polyline's first point, its corners and its last point.

    Args:
        xy: points [m], float64 (n, 2); repeated ones count once.

    Returns:
        float64 (m, 2), m <= n.
    """
    if len(xy) == 0:
        return xy
    distinct = np.ones(len(xy), bool)
    distinct[1:] = (np.diff(xy, axis=0) != 0.0).any(axis=1)
    points = xy[distinct]
    if len(points) < 3:
        return points
    runs = np.diff(points, axis=0)
    lengths = np.hypot(runs[:, 0], runs[:, 1])
    runs /= lengths[:, np.newaxis]
    across = runs[:-1, 0] * runs[1:, 1] - runs[:-1, 1] * runs[1:, 0]
    along = (runs[:-1] * runs[1:]).sum(axis=1)
    bend = np.ones(len(points), bool)
    # A robot that steers through a bend misses it by the sine of the bend times the shorter run.
    shorter = np.minimum(lengths[:-1], lengths[1:])
    bend[1:-1] = (
        (np.abs(across) > STRAIGHT_RAD) | (along < 0.0) | (across**2 > (CUT_M / shorter) ** 2)
    )
    return points[bend]


def corners_to_end(
    path: NDArray[np.float64],
    track: NDArray[np.float64],
    is_clear: Callable[[Point, Point], bool],
    *,
    goes_back: bool = True,
) -> NDArray[np.float64] | None:
    """Return the corners to drive through from the track's last point to the path's end.

    The way leads straight to the first waypoint not yet driven through, or to the waypoint before
    it. If neither way is clear, a robot that ``goes_back`` first drives back along its track until
    one is. If none becomes clear, it drives straight to the nearest clear waypoint of the first
    metres.

    Args:
        path: waypoints [m], float64 (n, 2).
        track: last points of the robot's track [m], float64 (m, 2), m >= 1; the last of them is
            where the robot is, or can come to rest.
        is_clear: returns whether the robot can move straight between two points.

    Returns:
        float64 (k, 2); (0, 2) if nothing is left to drive; None if there is no way now.
    """
    passed = passed_waypoints(path, track)
    if passed == len(path):
        return path[:0]
    targets = [target for target in (passed, passed - 1) if target >= 0]
    if not goes_back:
        track = track[-1:]
    near_points = min(BACK_POINTS, len(track))
    back = [*range(1, near_points + 1), *range(near_points + BACK_STRIDE, len(track), BACK_STRIDE)]
    ways = [(gone_back, target) for gone_back in back for target in targets]
    way = np.cumsum(np.hypot(*np.diff(path, axis=0).T))
    head = path[: 1 + int(np.searchsorted(way, JOIN_WITHIN_M, side="right"))]
    nearest = np.argsort(np.hypot(*(head - track[-1]).T), kind="stable")
    ways += [(1, target) for target in nearest.tolist() if goes_back]
    for gone_back, target in ways:
        if is_clear(track[-gone_back].tolist(), path[target].tolist()):
            return corners(np.vstack((track[: -gone_back - 1 : -1], path[target:])))[1:]
    return None


def passed_waypoints(path: NDArray[np.float64], track: NDArray[np.float64]) -> int:
    """Return how many of the first waypoints the robot drove through in order.

    It counts from the latest visit to the first waypoint: earlier visits belong to earlier paths.
    """
    since = 0
    for index, waypoint in enumerate(path):
        offsets = track[since:] - waypoint
        near = np.flatnonzero(np.hypot(offsets[:, 0], offsets[:, 1]) <= PASSED_WITHIN_M)
        if len(near) == 0:
            return index
        since += int(near[-1 if index == 0 else 0])
    return len(path)


# Discharge while standing, as a share of driving; rate of charging, as a multiple of driving.
STANDING, CHARGING = 0.2, 4.0


@dataclass(slots=True)
class Battery:
    """A battery that lasts ``minutes`` [min] of driving.

    Attributes:
        level: its charge, from 0 to 1.
        is_charging: whether it was in its dock, standing, at the last tick.
        lowest: the least charge so far.
        charges: number of times that it was charged from below half.
    """

    minutes: float
    level: float = 1.0
    is_charging: bool = False
    lowest: float = 1.0
    charges: int = 0

    def tick(self, seconds: float, *, moves: bool, is_docked: bool) -> None:
        """Let some time pass [s]."""
        drain = seconds / (60.0 * self.minutes)
        was_charging, self.is_charging = self.is_charging, is_docked and not moves
        if not self.is_charging:
            drain *= 1.0 if moves else STANDING
        else:
            drain *= -CHARGING
            # Charging in passing, or before it starts to drive, does not count.
            self.charges += not was_charging and self.level < 0.5
        self.level = min(max(self.level - drain, 0.0), 1.0)
        self.lowest = min(self.lowest, self.level)
