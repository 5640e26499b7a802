"""Bends: how far a robot may have driven beside the straight segment between two places.

Between two places the robot turns once at most: its track stays within the triangle of the
direction in which it came to the first and that in which it left the second. These are known by the
places before and after, or by its headings: bases drive where they head. It also drives no farther
than its speed allows.
"""

from __future__ import annotations

import math

from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M

Point = tuple[float, float]

# Up to this length [m] a right angle between two places lies less than a pixel beside the segment.
SHORT_M = 2.0 * math.sqrt(2.0) * PIXEL_M
NO_YAWS = math.nan, math.nan
# Sides this near to parallel do not meet within any room.
LEAST_RAD = 1e-3


def beside_m(
    start: Point,
    end: Point,
    before: Point | None,
    after: Point | None,
    farthest_m: float,
    yaws: tuple[float, float] = NO_YAWS,
) -> float:
    """Return how far from the segment between two places the robot may have been [m].

    Args:
        start, end: the places, x, y [m].
        before, after: the places before and after them; None where none is known.
        farthest_m: how far it can have driven from one to the other [m]; 0 if that is not known:
            then it is taken to have driven straight.
        yaws: its headings at the two places [rad]; NaN if not known.
    """
    length = math.dist(start, end)
    if length <= SHORT_M or not farthest_m:
        return 0.0
    by_turn = length * _height(_bend(before, start, end), _bend(start, end, after))
    if not any(map(math.isnan, yaws)):
        by_turn = min(by_turn, length * _height(*_turns(start, end, yaws)))
    if length > farthest_m:
        return by_turn
    return min(by_turn, 0.5 * math.sqrt(farthest_m**2 - length**2))


def corner_between(
    start: Point, end: Point, yaws: tuple[float, float], farthest_m: float
) -> Point | None:
    """Return where the robot turned between two places, by its headings there; None if not known.

    See ``beside_m`` for the arguments.
    """
    way = math.atan2(end[1] - start[1], end[0] - start[0])
    one, other = (math.remainder(yaw - way, math.tau) for yaw in yaws)
    if not one * other < 0.0 or abs(one) + abs(other) >= math.pi - LEAST_RAD:
        return None  # it did not turn once, or did not drive where it heads
    one, other = abs(one), abs(other)
    length = math.dist(start, end)
    first_m = length * math.sin(other) / math.sin(one + other)
    if first_m + length * math.sin(one) / math.sin(one + other) > farthest_m:
        return None
    return start[0] + first_m * math.cos(yaws[0]), start[1] + first_m * math.sin(yaws[0])


def _turns(start: Point, end: Point, yaws: tuple[float, float]) -> tuple[float, float]:
    """Return the angles between the segment and the headings at its ends [rad]."""
    way = math.atan2(end[1] - start[1], end[0] - start[0])
    one, other = (abs(math.remainder(yaw - way, math.tau)) for yaw in yaws)
    return one, other


def _height(one: float | None, other: float | None) -> float:
    """Return the height of a triangle over a base of 1 with these angles [rad].

    An angle that is not known is taken for a right one, two of them for none.
    """
    if one is None and other is None:
        return 0.0
    one, other = (0.5 * math.pi if angle is None else angle for angle in (one, other))
    if not one or not other:
        return 0.0
    if one + other >= math.pi - LEAST_RAD:
        return math.inf
    return math.sin(one) * math.sin(other) / math.sin(one + other)


def _bend(first: Point | None, middle: Point, last: Point | None) -> float | None:
    """Return the angle between the ways to and from a place [rad]; None if one is not known."""
    if first is None or last is None or middle in (first, last):
        return None
    ax, ay, bx, by = (
        *(middle[0] - first[0], middle[1] - first[1]),
        *(last[0] - middle[0], last[1] - middle[1]),
    )
    return abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
