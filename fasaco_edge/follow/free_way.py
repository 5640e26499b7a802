"""How far the robot's disc can go along a line between things, and how fast it may go."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.motion import stopping_rate

# Distance kept from things [m]. If one is already nearer, the robot drives on as long as it
# approaches no thing by more than the second [m].
MARGIN_M, ASIDE_M = 0.03, 0.005
# The robot stops this far before the margin [m].
STOP_M = 0.03
# Moving things may approach at this speed [m/s], and the robot must stand before they arrive; it
# reacts this long after it has seen them [s]. Things behind the robot do not count: those beyond
# this angle of its heading [rad].
WALK_M_S, LATE_S, AHEAD_RAD = 0.5, 0.25, math.radians(120.0)


class Thing(NamedTuple):
    """Something that the map does not show: its place [m], and whether it may move."""

    x: float
    y: float
    moves: bool


class Met(NamedTuple):
    """A thing on the line, and how far the disc can go before it comes too near to it [m]."""

    thing: Thing
    way: float


def first_met(things: Iterable[Thing], line: Sequence[Point], radius: float) -> Met | None:
    """Return the first thing that a disc meets along a line; None for none.

    Args:
        things: where the disc may not go.
        line: from the disc's place on; two points at least, or it does not move.
        radius: of the disc [m]; it keeps ``MARGIN_M`` from things.
    """
    first: Met | None = None
    apart = [(thing, math.dist(line[0], thing[:2]) - ASIDE_M) for thing in things]
    keeps = max(min((far for _, far in apart), default=math.inf), radius)
    keeps = min(keeps, radius + MARGIN_M)
    for thing, far in apart:
        near = min(keeps, far)
        way = _way_to(thing, line, near) if near > 0.0 else None
        if way is not None and (first is None or way < first.way):
            first = Met(thing, way)
    return first


def _way_to(thing: Thing, line: Sequence[Point], radius: float) -> float | None:
    """Return the way along a line to where a thing is within ``radius`` [m]; None if nowhere."""
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
    return None


def speed_before(way: float, acceleration: float, period: float) -> float:
    """Return the highest speed [m/s] that lets it stop ``STOP_M`` before the end of a way."""
    return stopping_rate(max(way - STOP_M, 0.0), acceleration, period)


def speed_beside(
    things: Iterable[Thing], pose: Pose2D, radius: float, acceleration: float
) -> tuple[float, Thing | None]:
    """Return the highest speed from which the robot stands before a moving thing touches it [m/s].

    And the thing that limits it; infinity and None without one.

    The gap must cover the robot's way until it reacts and while it brakes, and the thing's way
    meanwhile: v late + v^2 / 2a + walk (late + v / a).
    """
    nearest, decides = math.inf, None
    for thing in things:
        if not thing.moves:
            continue
        dx, dy = thing.x - pose.x, thing.y - pose.y
        gap = math.hypot(dx, dy) - radius
        toward = math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau)
        if gap < nearest and abs(toward) <= AHEAD_RAD:
            nearest, decides = gap, thing
    if decides is None:
        return math.inf, None
    half = LATE_S + WALK_M_S / acceleration
    left = half * half + 2.0 * (nearest - WALK_M_S * LATE_S) / acceleration
    speed = acceleration * (math.sqrt(max(left, 0.0)) - half)
    return max(speed, 0.0), decides
