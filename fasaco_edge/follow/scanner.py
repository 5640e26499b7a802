"""Lidar's view: beams as points, points that the map shows, and the free distance along a line.

Points of a scan are in the robot's frame: x ahead, y to the left of its centre [m]. Without numpy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.motion import stopping_rate
from fasaco_edge.wire.messages.grids import GridOctets
from fasaco_edge.wire.messages.scans import LaserScan

# Largest distance of points from the sensor; others are ignored [m].
REACH_M = 3.0
# Number of sectors; in each only the shortest beam counts.
SECTORS = 360
# Least share of valid beams; with fewer the sensor is covered or broken.
LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Mount:
    """Pose of the lidar on the robot.

    Attributes:
        x, y: ahead of the robot's centre, and to its left [m].
        yaw: direction of the lidar's angle 0, counter-clockwise from ahead [rad].
        upside_down: whether its angles grow clockwise.
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    upside_down: bool = False


def points_of(scan: LaserScan, mount: Mount) -> list[Point] | None:
    """Return the points of a scan within ``REACH_M``, at most ``SECTORS``.

    None if less than ``LEAST_SHARE`` of its beams are valid.
    """
    shortest: dict[int, tuple[float, float]] = {}
    measured_beams = 0
    turn = -1.0 if mount.upside_down else 1.0
    for index, measured in enumerate(scan.ranges):
        # NaN, and ranges beyond the sensor's limits, are invalid; minus infinity means too near to
        # measure.
        length = scan.least_m if measured == -math.inf else measured
        if not length >= scan.least_m:
            continue
        measured_beams += 1
        if length > REACH_M or length > scan.most_m:
            continue
        angle = turn * (scan.first_rad + index * scan.step_rad) + mount.yaw
        sector = round(angle * SECTORS / math.tau) % SECTORS
        if sector not in shortest or length < shortest[sector][0]:
            shortest[sector] = length, angle
    if measured_beams < LEAST_SHARE * len(scan.ranges):
        return None
    return [
        (mount.x + length * math.cos(angle), mount.y + length * math.sin(angle))
        for length, angle in shortest.values()
    ]


# Distance kept from things [m]; if a thing is already nearer, the robot may come nearer to it by
# the second value [m].
MARGIN_M, ASIDE_M = 0.03, 0.005
# The robot stops this far before the margin [m].
STOP_M = 0.03
# Largest speed of things that approach, which must not reach the robot before it stands [m/s]; time
# in which the robot reacts [s]; angle to its heading beyond which things are behind it and do not
# count [rad].
WALK_M_S, LATE_S, AHEAD_RAD = 0.5, 0.25, math.radians(120.0)


class Thing(NamedTuple):
    """Something that the map does not show: its place [m], and whether it may move."""

    x: float
    y: float
    moves: bool


# Result of a search that finds no thing.
NOTHING: Final[tuple[float, Thing | None]] = (math.inf, None)


def first_met(
    things: Iterable[Thing], line: Sequence[Point], radius: float
) -> tuple[float, Thing | None]:
    """Return how far a disc can go along a line [m], and the first thing that it meets there.

    Args:
        things: the things that the disc must not meet.
        line: polyline from the disc's centre [m].
        radius: radius of the disc [m]; it keeps ``MARGIN_M`` from things.

    Returns:
        infinity and None if it meets nothing.
    """
    gaps = [(thing, math.dist(line[0], thing[:2]) - ASIDE_M) for thing in things]
    keeps = max(min((gap for _, gap in gaps), default=math.inf), radius)
    keeps = min(keeps, radius + MARGIN_M)
    ways = [(_way_to(thing, line, min(keeps, gap)), thing) for thing, gap in gaps]
    return min(ways, key=lambda met: met[0], default=NOTHING)


def _way_to(thing: Thing, line: Sequence[Point], radius: float) -> float:
    """Return the distance along a line to where a thing is within ``radius`` [m], or infinity."""
    before = 0.0
    for (x0, y0), (x1, y1) in pairwise(line):
        length = math.hypot(x1 - x0, y1 - y0)
        if length <= 0.0:
            continue
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        dx, dy = thing.x - x0, thing.y - y0
        along, aside = dx * ux + dy * uy, ux * dy - uy * dx
        if abs(aside) < radius and along > 0.0:
            way = max(along - math.sqrt(radius * radius - aside * aside), 0.0)
            if way <= length:
                return before + way
        before += length
    return math.inf


def speed_before(way: float, acceleration: float, period: float) -> float:
    """Return the highest speed that allows a stop ``STOP_M`` before the end of ``way`` [m/s]."""
    return stopping_rate(max(way - STOP_M, 0.0), acceleration, period)


def speed_beside(
    things: Iterable[Thing], pose: Pose2D, radius: float, acceleration: float
) -> tuple[float, Thing | None]:
    """Return the highest speed from which the robot can stop before a moving thing touches it
    [m/s], and that thing; infinity and None without such a thing.

    The gap must be at least the distance of the robot until it has reacted and braked, plus that of
    the thing in the same time: v late + v^2 / 2a + walk (late + v / a).
    """
    nearest, decides = NOTHING
    for thing in things:
        dx, dy = thing.x - pose.x, thing.y - pose.y
        gap = math.hypot(dx, dy) - radius
        toward = math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau)
        if thing.moves and gap < nearest and abs(toward) <= AHEAD_RAD:
            nearest, decides = gap, thing
    if decides is None:
        return NOTHING
    half = LATE_S + WALK_M_S / acceleration
    left = half * half + 2.0 * (nearest - WALK_M_S * LATE_S) / acceleration
    return max(acceleration * (math.sqrt(max(left, 0.0)) - half), 0.0), decides


# Distance within which a point of a scan belongs to an obstacle of the map [m]: ranges are noisy,
# and the pose is off by some centimetres.
KNOWN_M = 0.15


def shows(grid: GridOctets, free: bytes, x: float, y: float) -> bool:
    """Return whether an obstacle of a map is within about ``KNOWN_M`` of a point [m].

    ``free``: the values of pixels that are no obstacle.
    """
    size = grid.geometry
    far = KNOWN_M / size.resolution
    col, row = size.to_pixels(x, y)
    left, right = max(math.floor(col - far), 0), min(math.floor(col + far) + 1, size.cols)
    rows = range(max(math.floor(row - far), 0), min(math.floor(row + far) + 1, size.rows))
    starts = (line * size.cols for line in rows if left < right)
    return any(
        bytes(grid.octets[start + left : start + right]).translate(None, free) for start in starts
    )
