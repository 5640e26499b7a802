"""A differential drive that follows a polyline: straight runs, turns on the spot.

The drive is ideal (no slip, no delay), so that what a run shows is the path's
doing. It comes to rest at every corner, which is what makes turns cost time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.simulation.config import SimulationConfig

# Closer than this the robot is at a corner [m].
ARRIVED_M = 1e-3
# A run begins within this heading error, so that it ends within ARRIVED_M of its corner
# after 10 m; under way a larger one is steered out, and from MISALIGNED on turned out at
# rest [rad].
ALIGNED_RAD = 1e-4
MISALIGNED_RAD = 0.05
# A bend below this is none: it is steered, not stopped for [rad].
STRAIGHT_RAD = 0.02


@dataclass(frozen=True, slots=True)
class DriveState:
    """Where the robot is and how it moves.

    Attributes:
        pose: in the map frame.
        speed: forward [m/s], never negative.
        turn_rate: counter-clockwise [rad/s].
    """

    pose: Pose2D
    speed: float = 0.0
    turn_rate: float = 0.0

    @property
    def moving(self) -> bool:
        """Tell whether any wheel turns."""
        return self.speed != 0.0 or self.turn_rate != 0.0


def driven(
    state: DriveState, goal: tuple[float, float] | None, config: SimulationConfig
) -> DriveState:
    """Return the state a tick later, on the way to ``goal`` [m] and to rest there.

    Without a goal the robot brakes. It drives only while it points at the goal, and
    turns only at rest, but for corrections below MISALIGNED_RAD.
    """
    dt = config.tick_s
    pose = state.pose
    speed_goal = turn_goal = 0.0
    if goal is not None:
        ahead_x, ahead_y = goal[0] - pose.x, goal[1] - pose.y
        error = wrapped(math.atan2(ahead_y, ahead_x) - pose.yaw)
        if abs(error) <= (MISALIGNED_RAD if state.speed > 0.0 else ALIGNED_RAD):
            distance = math.hypot(ahead_x, ahead_y)
            speed_goal = _stopping_rate(distance, config.acceleration_m_s2, dt)
        if state.speed == 0.0 or speed_goal > 0.0:
            rate = _stopping_rate(abs(error), config.turn_acceleration_rad_s2, dt)
            turn_goal = math.copysign(min(rate, config.turn_rad_s), error)
    speed = _limited(state.speed, min(speed_goal, config.speed_m_s), config.acceleration_m_s2 * dt)
    turn_rate = _limited(state.turn_rate, turn_goal, config.turn_acceleration_rad_s2 * dt)
    yaw = wrapped(pose.yaw + turn_rate * dt)
    moved = Pose2D(pose.x + speed * dt * math.cos(yaw), pose.y + speed * dt * math.sin(yaw), yaw)
    return DriveState(moved, speed, turn_rate)


def stopping_point(state: DriveState, config: SimulationConfig) -> tuple[float, float]:
    """Return where (x, y) [m] the robot would come to rest if it braked now."""
    # (v - a dt) dt, (v - 2 a dt) dt, ... add up to v^2 / 2a - v dt / 2.
    reach = max(
        state.speed**2 / (2.0 * config.acceleration_m_s2) - 0.5 * state.speed * config.tick_s, 0.0
    )
    pose = state.pose
    return pose.x + reach * math.cos(pose.yaw), pose.y + reach * math.sin(pose.yaw)


def wrapped(angle: float) -> float:
    """Return ``angle`` [rad] in [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)


def corners(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a polyline's first point, its corners and its last point.

    Args:
        xy: points [m], float64 (n, 2); repeated ones count once.

    Returns:
        float64 (m, 2), m <= n: the same line, without the points it runs straight through.
    """
    if len(xy) == 0:
        return xy
    distinct = np.ones(len(xy), bool)
    distinct[1:] = (np.diff(xy, axis=0) != 0.0).any(axis=1)
    points = xy[distinct]
    if len(points) < 3:
        return points
    runs = np.diff(points, axis=0)
    runs /= np.hypot(runs[:, 0], runs[:, 1])[:, np.newaxis]
    across = runs[:-1, 0] * runs[1:, 1] - runs[:-1, 1] * runs[1:, 0]
    along = (runs[:-1] * runs[1:]).sum(axis=1)
    bend = np.ones(len(points), bool)
    bend[1:-1] = (np.abs(across) > STRAIGHT_RAD) | (along < 0.0)
    return points[bend]


def _stopping_rate(remaining: float, acceleration: float, dt: float) -> float:
    """Return the highest rate from which equal steps down come to rest within ``remaining``.

    The sum of v dt, (v - a dt) dt, ... is v^2 / 2a + v dt / 2; below one step, v dt is all.
    """
    half_step = 0.5 * acceleration * dt
    braking = math.sqrt(half_step**2 + 2.0 * acceleration * remaining) - half_step
    return min(braking, remaining / dt)


def _limited(rate: float, goal: float, step: float) -> float:
    return min(max(goal, rate - step), rate + step)
