"""Segments of the track: the floor that the tool certainly sweeps between consecutive places.

Between two places a robot turns at most once, and drives in the direction of its heading. So its
track stays within the triangle of the headings, and is no longer than its speed allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fasaco_edge.grid.geometry import Point, Window
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M, Mask
from fasaco_edge.mission.coverage.steady_track import Position

# Error of a heading [rad].
YAW_RAD = math.radians(1.0)
# Tolerance against rounding for pixels at the rim [m].
TOUCH_M = 1e-9
# Length up to which a right-angled track lies less than a pixel beside the segment [m].
SHORT_M = 2.0 * math.sqrt(2.0) * PIXEL_M
# Angle below which two headings count as parallel, as they meet beyond any room [rad].
LEAST_RAD = 1e-3


class Segment(NamedTuple):
    """A segment between places, and the radius certainly swept along it [m], 0 for none."""

    start: Position
    end: Position
    reach_m: float


def segments_between(start: Position, end: Position, tool_m: float) -> list[Segment]:
    """Return the sweeps between two places: along the segment, around its corner, or at its end.

    ``tool_m``: width of the tool [m].
    """
    reach_m = 0.5 * tool_m - beside_m(start, end)
    at_end = max(0.5 * tool_m - end.error_m, 0.25 * tool_m)
    if reach_m >= at_end:
        return [Segment(start, end, at_end)]
    turned = corner_between(start, end)
    if turned is not None:
        corner = Position(*turned, end.error_m)
        beside = max(math.dist(turned, start.point), math.dist(turned, end.point)) * YAW_RAD
        if at_end > beside:
            reach_m = at_end - beside
            round_it = Segment(start, corner, reach_m), Segment(corner, end, reach_m)
            return [*round_it, Segment(end, end, at_end)]
    way = [Segment(start, end, reach_m)] if reach_m > 0.0 else []
    return [*way, Segment(end, end, at_end)]


def beside_m(start: Position, end: Position) -> float:
    """Return how far beside the segment between two places the robot may have been [m].

    If the longest possible drive is unknown, the robot is taken to have driven straight.
    """
    length, farthest_m = math.dist(start.point, end.point), end.farthest_m
    if length <= SHORT_M or not farthest_m:
        return 0.0
    one, other = map(abs, _turns(start, end))
    height = math.inf
    if not one or not other:
        height = 0.0
    elif one + other < math.pi - LEAST_RAD:
        height = length * math.sin(one) * math.sin(other) / math.sin(one + other)
    return (
        height if length > farthest_m else min(height, 0.5 * math.sqrt(farthest_m**2 - length**2))
    )


def corner_between(start: Position, end: Position) -> Point | None:
    """Return where the robot turned between two places, x, y [m]; None if unknown."""
    one, other = _turns(start, end)
    if not one * other < 0.0 or abs(one) + abs(other) >= math.pi - LEAST_RAD:
        return None  # no single turn, or not driven along its heading
    one, other = abs(one), abs(other)
    length = math.dist(start.point, end.point)
    first_m = length * math.sin(other) / math.sin(one + other)
    if first_m + length * math.sin(one) / math.sin(one + other) > end.farthest_m:
        return None
    return start.x + first_m * math.cos(start.yaw), start.y + first_m * math.sin(start.yaw)


def _turns(start: Position, end: Position) -> tuple[float, float]:
    """Return the angles of the headings at two places to the segment between them [rad]."""
    way = math.atan2(end.y - start.y, end.x - start.x)
    return math.remainder(start.yaw - way, math.tau), math.remainder(end.yaw - way, math.tau)


def window_around(segment: Segment) -> Window:
    """Return a window around a segment's sweep; its columns are whole bytes."""
    start, end, reach = segment
    row0, row1 = span(start.y, end.y, reach, 1)
    col0, col1 = span(start.x, end.x, reach, 8)
    return Window(row0, col0, row1, col1)


def within(segments: Sequence[Segment], window: Window, most_m: float = math.inf) -> Mask:
    """Return which pixel centres of a window are swept along segments, bool (rows, cols).

    ``most_m``: upper limit on their radius [m].
    """
    values = []
    for start, end, reach_m in segments:
        # Coordinates are relative to each start: far from the origin, rounding would be too large.
        far_y, far_x = end.y - start.y, end.x - start.x
        length2 = far_x * far_x + far_y * far_y or 1.0
        reach2 = (min(reach_m, most_m) + TOUCH_M) ** 2
        values.append((start.y, start.x, far_y, far_x, length2, reach2))
    y, x, dy, dx, lengths2, reaches2 = np.array(values).reshape(-1, 6, 1, 1).swapaxes(0, 1)
    up = ((np.arange(window.row0, window.row1) + 0.5) * PIXEL_M)[:, np.newaxis] - y
    right = (np.arange(window.col0, window.col1) + 0.5) * PIXEL_M - x
    along = np.minimum(np.maximum((right * dx + up * dy) / lengths2, 0.0), 1.0)
    right, up = right - along * dx, up - along * dy
    under: Mask = (right * right + up * up <= reaches2).any(axis=0)
    return under


def span(one: float, other: float, reach: float, whole: int) -> tuple[int, int]:
    """Return the range of pixels within reach [m], rounded outward to multiples of ``whole``."""
    low = math.floor((min(one, other) - reach) / PIXEL_M)
    high = math.floor((max(one, other) + reach) / PIXEL_M) + 1
    return low // whole * whole, -(-high // whole) * whole
