"""Legs of a path: straight parts, and the speed at which a robot can turn from one to the next.

While driving, the robot turns as fast as on the spot, and begins early enough to have done half of
the turn when it passes the corner. The turn takes the same time at any speed, so the distance from
the corner is proportional to the speed: the allowed distance determines the speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

from fasaco_edge.follow.estimate import BaseLimits
from fasaco_edge.grid.geometry import Point, Pose2D

# Least length of a leg [m].
LEAST_LEG_M = 1e-3
# Cosine of the angle up to which two legs lead in the same direction.
SAME_DIRECTION = math.cos(0.1)
# Largest distance from a rounded corner [m], below the map's resolution and the noise of poses.
ROUNDED_M = 0.02
# At sharper corners the robot turns on the spot [rad].
SHARP_RAD = math.radians(135.0)
# Number of time steps for half a turn.
STEPS = 32


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight part of the path.

    Attributes:
        start, end: its ends (x, y) [m].
        ux, uy: its direction, of length 1.
        length: its length [m].
        most: greatest speed at its end [m/s]: 0 if the robot has to come to rest, infinity if it
            only steers.
        early_s: time before its end at which the robot begins to turn, if it rounds a corner [s].
        is_back: whether it is driven backward.
    """

    start: Point
    end: Point
    ux: float
    uy: float
    length: float
    most: float = 0.0
    early_s: float = 0.0
    is_back: bool = False

    @property
    def stops(self) -> bool:
        """Whether the robot has to come to rest at its end."""
        return self.most == 0.0

    @property
    def bends(self) -> bool:
        """Whether the robot only steers at its end."""
        return self.most == math.inf

    def along_and_left(self, point: Point) -> tuple[float, float]:
        """Return a point's distance along the leg's line, and to its left [m]."""
        dx, dy = point[0] - self.start[0], point[1] - self.start[1]
        return dx * self.ux + dy * self.uy, self.ux * dy - self.uy * dx

    def distance(self, point: Point) -> float:
        """Return a point's distance from the leg [m]."""
        along, aside = self.along_and_left(point)
        beyond = max(-along, along - self.length, 0.0)
        return math.hypot(beyond, aside)

    def leads_as(self, other: Leg | None) -> bool:
        """Return whether another leg leads in the same direction."""
        return other is not None and self.ux * other.ux + self.uy * other.uy >= SAME_DIRECTION

    def at(self, along: float) -> Point:
        """Return the point at a distance along its line [m]."""
        return self.start[0] + along * self.ux, self.start[1] + along * self.uy


def apart(poses: Iterable[Pose2D], least: float) -> Iterator[Pose2D]:
    """Yield the poses that are at least ``least`` [m] from the last yielded pose."""
    last = None
    for pose in poses:
        if last is None or math.hypot(pose.x - last.x, pose.y - last.y) >= least:
            yield pose
            last = pose


def leg_between(start: Point, end: Point) -> Leg:
    """Return the leg from one point to another."""
    length = math.dist(start, end)
    return Leg(start, end, (end[0] - start[0]) / length, (end[1] - start[1]) / length, length)


@lru_cache(maxsize=1024)
def times(turn: float, turn_rate: float, turn_acceleration: float) -> tuple[float, float]:
    """Return how long before a corner the turn begins [s], and the distance at which the robot
    passes the corner, divided by its speed [s].

    Args:
        turn: angle of the corner, above 0 and below pi [rad].
        turn_rate, turn_acceleration: limits of the base [rad/s, rad/s^2].
    """
    ramp_s = min(math.sqrt(turn / turn_acceleration), turn_rate / turn_acceleration)
    half_s = 0.5 * ramp_s + 0.5 * turn / (turn_acceleration * ramp_s)
    step_s = half_s / STEPS
    along = aside = 0.0
    for step in range(STEPS):
        now = (step + 0.5) * step_s
        turned = 0.5 * turn_acceleration * min(now, ramp_s) ** 2
        turned += turn_acceleration * ramp_s * max(now - ramp_s, 0.0)
        along += step_s * math.cos(turned)
        aside += step_s * math.sin(turned)
    # The robot has done half of the turn on the bisector of the corner.
    return along + aside * math.tan(0.5 * turn), aside / math.cos(0.5 * turn)


def rounding(turn: float, room: float, limits: BaseLimits) -> tuple[float, float]:
    """Return the greatest speed in a corner [m/s], and how long before it the turn begins [s].

    Args:
        turn: angle of the corner, 0 or more [rad].
        room: distance before and after the corner that the turn may take [m].
        limits: limits of the base.

    Returns:
        a speed of 0 if the robot has to turn on the spot, infinity if it only steers.
    """
    if turn <= limits.steered:
        return math.inf, 0.0
    if turn > SHARP_RAD:
        return 0.0, 0.0
    early_s, aside_s = times(turn, limits.turn_rate, limits.turn_acceleration)
    return min(ROUNDED_M / aside_s, room / early_s, limits.speed), early_s
