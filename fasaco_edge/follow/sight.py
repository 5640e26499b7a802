"""Sight: obstacles that the lidar sees and the map does not show, and the speed that they allow.

Beams become points in the robot's frame: x ahead, y to the left of its centre [m].

Standing things that the map shows are ignored: the path keeps clear of them, along walls by as
little as a centimetre, less than the noise of ranges. Things that may move count even where the map
shows something, as people leave marks on a map where they walked. The robot keeps a margin from all
things that count. A thing is standing once it has been in its place for a while.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.supervision import FollowerState, Reason
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.motion import stopping_rate
from fasaco_edge.wire.messages.base import LaserScan, decode_scan
from fasaco_edge.wire.messages.grids import GridOctets, read_grid, with_update

# Points farther than this from the sensor are ignored [m].
REACH_M = 3.0
# Number of sectors; in each only the shortest beam counts.
SECTORS = 360
# Least share of valid beams; with fewer valid beams, the sensor is covered or broken.
LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Mount:
    """Pose of the lidar on the robot.

    Attributes:
        x, y: distances ahead of the robot's centre, and to its left [m].
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
# ASIDE_M [m].
MARGIN_M, ASIDE_M = 0.03, 0.005
# The robot stops this far before the margin [m].
STOP_M = 0.03
# Assumed speed of approaching things, which must not reach the robot before it stands [m/s];
# reaction time of the robot [s]; things at a larger angle to its heading do not count [rad].
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


def speed_beside(
    things: Iterable[Thing], pose: Pose2D, radius: float, acceleration: float
) -> tuple[float, Thing | None]:
    """Return the highest speed from which the robot can stop before a moving thing touches it
    [m/s], and that thing; infinity and None without such a thing.

    The gap must be at least the distance that the robot drives until it has reacted and braked,
    plus the distance of the thing in the same time: v late + v^2 / 2a + walk (late + v / a).
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


# The path is checked this far ahead [m].
AHEAD_M = 1.5
# Edge of the squares in which things are tracked [m]; time in a square, or in one beside it, after
# which a thing is standing [s]; time out of sight after which a thing is forgotten [s].
PLACE_M, STANDS_S, FORGET_S = 0.1, 1.5, 1.0
# Points nearer to the robot's centre than this share of its radius are the robot itself.
OWN_SHARE = 0.7
# The report of an obstacle contains the points within this distance of it [m].
AROUND_M = 0.5
UNKNOWN = 255
# A speed below this counts as 0 [m/s].
LEAST_M_S = 0.02


@dataclass(frozen=True, slots=True)
class Limit:
    """The speed that the sight allows.

    Attributes:
        speed: the highest speed [m/s]; infinite without a limit.
        why: reason of the limit, in words.
        around: the points seen around the limiting thing [m], the nearest first.
    """

    speed: float
    why: str = ""
    around: tuple[Point, ...] = ()


NO_LIMIT = Limit(math.inf)


class Sight:
    """Keeps the newest scan, without obstacles of the map.

    Args:
        mount: pose of the lidar.
        radius: radius of the robot's disc [m].
        lost_s: time without a scan after which the robot must stand [s].
        free_at_most: occupancy up to which a pixel of the map is free [percent].

    Attributes:
        things: the things that the scan shows and that count, in the map frame.
    """

    def __init__(
        self, mount: Mount, radius: float, lost_s: float = 1.0, free_at_most: int = 25
    ) -> None:
        self.things: list[Thing] = []
        self._mount, self._radius, self._lost_s = mount, radius, lost_s
        # Values of pixels that are no obstacle: free and unknown.
        self._free = bytes([*range(free_at_most + 1), UNKNOWN])
        self._grid: GridOctets | None = None
        self._scan_at: float | None = None
        self._stamp_ns = 0
        self._fault: Reason | None = None
        self._is_first = True
        # Occupied squares: when they were first and last seen [s].
        self._seen: dict[tuple[int, int], tuple[float, float]] = {}

    def take_map(self, payload: bytes, *, is_update: bool = False) -> None:
        """Take in a map, or an update of it; malformed messages are ignored, as by the daemon."""
        with suppress(MalformedMessage):
            if not is_update:
                self._grid = read_grid(payload)
            elif self._grid is not None:
                self._grid = with_update(self._grid, payload)

    def take_scan(self, payload: bytes, pose: Pose2D, now: float) -> None:
        """Take in a scan made at ``pose``; a scan with the previous stamp is ignored."""
        try:
            scan = decode_scan(payload)
        except MalformedMessage as error:
            self._fault = FollowerState.BAD_SCAN, str(error)
            return
        if scan.stamp_ns and scan.stamp_ns == self._stamp_ns:
            return
        self._stamp_ns = scan.stamp_ns
        points = points_of(scan, self._mount)
        if points is None:
            self._fault = FollowerState.BAD_SCAN, "it sees nothing: is the lidar covered?"
            return
        self._fault, self._scan_at = None, now
        self._look(points, pose, now)

    def trouble(self, frame: str, now: float) -> Reason | None:
        """Return why the robot must stand, with figures; None if scan and map are usable."""
        if self._fault is not None:
            return self._fault
        if self._grid is None:
            return FollowerState.NO_SCAN, "no map to compare scans with"
        if self._grid.frame != frame:
            return FollowerState.NO_SCAN, f"map in {self._grid.frame!r}, path in {frame!r}"
        if self._scan_at is None:
            return FollowerState.NO_SCAN, "none has come"
        if (age_s := now - self._scan_at) > self._lost_s:
            return FollowerState.NO_SCAN, f"for {age_s:.1f} s"
        return None

    def limit(
        self, pose: Pose2D, line: Sequence[Point], acceleration: float, period: float
    ) -> Limit:
        """Return the limit that the scan sets along a line.

        Args:
            pose: the robot's pose.
            line: the path from there, ``AHEAD_M`` long, or shorter if it ends.
            acceleration: largest acceleration of the base [m/s^2].
            period: time from one command to the next [s].
        """
        radius, why = self._radius, "something moves"
        speed, thing = speed_beside(self.things, pose, radius, acceleration)
        way, met = first_met(self.things, line, radius)
        ahead = stopping_rate(max(way - STOP_M, 0.0), acceleration, period)
        if met is not None and ahead < speed:
            speed, thing, why = ahead, met, "something stands"
        if thing is None or speed >= LEAST_M_S:
            return Limit(speed)
        far = max(math.dist((pose.x, pose.y), thing[:2]) - radius, 0.0)
        apart = sorted((math.dist(thing[:2], other[:2]), other[:2]) for other in self.things)
        around = tuple(place for off, place in apart if off <= AROUND_M)
        return Limit(0.0, f"{why} {far:.2f} m away", around)

    def _look(self, points: list[Point], pose: Pose2D, now: float) -> None:
        """Keep the points that count, and separate standing things from things that may move."""
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        own = OWN_SHARE * self._radius
        places: dict[tuple[int, int], list[Point]] = {}
        for x, y in points:
            if math.hypot(x, y) < own:
                continue
            there = pose.x + cos * x - sin * y, pose.y + sin * x + cos * y
            square = math.floor(there[0] / PLACE_M), math.floor(there[1] / PLACE_M)
            places.setdefault(square, []).append(there)
        known = {at: times for at, times in self._seen.items() if now - times[1] <= FORGET_S}
        # Things in the first scan count as standing.
        begun = -math.inf if self._is_first else now
        self._is_first = False
        self.things = []
        for square, found in places.items():
            moves = now - self._since(known, square, begun) < STANDS_S
            self.things += [Thing(x, y, moves) for x, y in found if moves or not self._shows(x, y)]
        self._seen = known | {at: (known[at][0] if at in known else begun, now) for at in places}

    def _shows(self, x: float, y: float) -> bool:
        return self._grid is not None and shows(self._grid, self._free, x, y)

    @staticmethod
    def _since(
        known: Mapping[tuple[int, int], tuple[float, float]], square: tuple[int, int], now: float
    ) -> float:
        """Return when a thing was first seen in a square, or in one beside it [s]."""
        col, row = square
        around = ((col + right, row + up) for right in (-1, 0, 1) for up in (-1, 0, 1))
        return min((known[at][0] for at in around if at in known), default=now)
