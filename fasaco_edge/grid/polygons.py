"""Polygons in the map frame: checks of validity, and areas."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point, Polygon

# A polygon with a smaller area is a mistake [m2].
LEAST_AREA_M2 = 1e-4
# Pairs of edges compared at once; larger blocks take more memory without being faster.
MOST_PAIRS = 65536


def polygon_flaw(polygon: Polygon) -> str:
    """Return why ``polygon`` has no well-defined interior; "" if it has.

    Its points must be finite; an edge joins the last point to the first.
    """
    if len(polygon) < 3:
        return f"must have at least 3 points, got {len(polygon)}"
    if polygon[0] == polygon[-1]:
        return "must not repeat its first point at the end"
    for index, (here, there) in enumerate(_edges(polygon)):
        if here == there:
            return f"has point {index} twice in a row"
    if crossing := _crossing(polygon):
        return "crosses or touches itself: edges from points {} and {}".format(*crossing)
    area = area_m2(polygon)
    if area < LEAST_AREA_M2:
        return f"must have an area of at least {LEAST_AREA_M2:g} m2, got {area:.3g}"
    return ""


def is_near(polygon: Polygon, point: Point, reach_m: float) -> bool:
    """Return whether a point (x, y) [m] lies in a polygon, or within ``reach_m`` [m] of it."""
    x, y = point
    is_inside = False
    for (ax, ay), (bx, by) in _edges(polygon):
        dx, dy = bx - ax, by - ay
        along = min(max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        if math.hypot(ax + along * dx - x, ay + along * dy - y) < reach_m:
            return True
        if (ay > y) != (by > y) and x < ax + (y - ay) * dx / dy:
            is_inside = not is_inside
    return is_inside


def _edges(polygon: Polygon) -> Iterator[tuple[Point, Point]]:
    return zip(polygon, (*polygon[1:], polygon[0]), strict=True)


def area_m2(polygon: Polygon) -> float:
    """Return the area of a polygon, of points (x, y) [m]."""
    # Relative to a corner: far from the origin, rounding would exceed the differences.
    x0, y0 = polygon[0]
    twice = math.fsum(
        (ax - x0) * (by - y0) - (bx - x0) * (ay - y0) for (ax, ay), (bx, by) in _edges(polygon)
    )
    return 0.5 * abs(twice)


def _crossing(polygon: Polygon) -> tuple[int, int] | None:
    """Return two edges that cross or touch, by the indices of their first points; None for none.

    Blocks of edges are compared with all edges; the exact test runs only where their boxes overlap.
    """
    start = np.array(polygon)
    end = np.roll(start, -1, axis=0)
    low, high = np.minimum(start, end), np.maximum(start, end)
    count = len(polygon)
    for first in range(0, count - 1, block := max(MOST_PAIRS // count, 1)):
        here, there = np.ogrid[first : min(first + block, count - 1), :count]
        overlap = there > here
        for axis in (0, 1):
            overlap &= low[here, axis] <= high[there, axis]
            overlap &= high[here, axis] >= low[there, axis]
        one, other = np.nonzero(overlap)
        one += first
        meet = _meet(start[one], end[one], start[other], end[other])
        # Neighbours share only a corner; they overlap if one turns back onto the other.
        next_to = other == one + 1
        after, before = other[next_to], one[next_to]
        meet[next_to] = _turns_back(start[before], end[before], end[after])
        closing = (one == 0) & (other == count - 1)
        meet[closing] = _turns_back(start[-1], end[-1], end[0])
        if meet.any():
            found = int(np.argmax(meet))
            return int(one[found]), int(other[found])
    return None


def _meet(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which segments c-d have a point in common with a-b; all points are float64 (n, 2)."""
    of_c, of_d = _side(a, b, c), _side(a, b, d)
    of_a, of_b = _side(c, d, a), _side(c, d, b)
    crossing = (of_c * of_d <= 0) & (of_a * of_b <= 0)
    # Collinear segments meet if their boxes overlap; for all others this test changes nothing.
    overlap = (np.minimum(c, d) <= np.maximum(a, b)) & (np.maximum(c, d) >= np.minimum(a, b))
    meet: NDArray[np.bool_] = crossing & overlap.all(axis=1)
    return meet


def _side(
    a: NDArray[np.float64], b: NDArray[np.float64], point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return on which side of the line a-b each point lies: -1, 0 or 1."""
    ahead, off = b - a, point - a
    side: NDArray[np.float64] = np.sign(ahead[..., 0] * off[..., 1] - ahead[..., 1] * off[..., 0])
    return side


def _turns_back(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether the path a-b-c turns back onto itself at b."""
    ahead, on = b - a, c - b
    back: NDArray[np.bool_] = (_side(a, b, c) == 0) & ((ahead * on).sum(axis=-1) < 0)
    return back
