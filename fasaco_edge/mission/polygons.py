"""Polygons in the map frame, and the cells of the lattice they hold or touch."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window

Point = tuple[float, float]
Polygon = tuple[Point, ...]

# Less than a postage stamp is a slip of the hand [m2].
LEAST_AREA_M2 = 1e-4

# A polygon drawn along the border of a cell does not touch it; rounding must not decide [m].
TOUCH_TOLERANCE_M = 1e-6


def flaw(polygon: Polygon) -> str:
    """Return what keeps ``polygon`` from having a clear inside, "" if nothing does.

    Its points are finite; the last is joined to the first.
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
    area = abs(_signed_area(polygon))
    if area < LEAST_AREA_M2:
        return f"must have an area of at least {LEAST_AREA_M2:g} m2, got {area:.3g}"
    return ""


def bounds(polygon: Polygon) -> tuple[float, float, float, float]:
    """Return (x_min, y_min, x_max, y_max) [m]."""
    xs, ys = zip(*polygon, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def cells_inside(polygon: Polygon, window: Window, cell_m: float) -> NDArray[np.bool_]:
    """Return which cells of ``window`` have their centre inside, bool (rows, cols).

    By the even-odd rule: each edge that a row's line of centres crosses turns all
    centres beyond it over.
    """
    turns = np.zeros((window.rows, window.cols + 1), np.uint8)
    for (x0, y0), (x1, y1) in _edges(polygon):
        # Half-open, so that a corner on the line counts once.
        low, high = (min(y0, y1) / cell_m - 0.5, max(y0, y1) / cell_m - 0.5)
        first, last = _clip(math.ceil(low), math.ceil(high), window.row0, window.row1)
        if first >= last:
            continue
        rows = np.arange(first, last)
        x = x0 + ((rows + 0.5) * cell_m - y0) * ((x1 - x0) / (y1 - y0))
        cols = np.ceil(x / cell_m - 0.5).clip(window.col0, window.col1).astype(np.intp)
        np.add.at(turns, (rows - window.row0, cols - window.col0), 1)
    inside: NDArray[np.bool_] = (np.cumsum(turns, axis=1, dtype=np.uint32)[:, :-1] & 1).astype(bool)
    return inside


def cells_near(
    polygon: Polygon, window: Window, cell_m: float, reach_m: float
) -> NDArray[np.bool_]:
    """Return which cells of ``window`` the polygon comes near, bool (rows, cols).

    Near is where it touches the square around the cell's centre that reaches ``reach_m`` [m] to
    each side. With half a cell or more, a disc of that radius can drive from centre to centre
    of the other cells, and touches no polygon.
    """
    starts = np.zeros((window.rows, window.cols + 1), np.int32)
    reach_m -= TOUCH_TOLERANCE_M
    for (x0, y0), (x1, y1) in _edges(polygon):
        low, high = (min(y0, y1) - reach_m) / cell_m, (max(y0, y1) + reach_m) / cell_m
        rows = np.arange(
            *_clip(math.ceil(low - 0.5), math.floor(high - 0.5) + 1, window.row0, window.row1)
        )
        # The part of the edge beside each row's squares; of a level edge all of it.
        y = (rows + 0.5) * cell_m
        ends = np.stack((y - reach_m, y + reach_m)).clip(min(y0, y1), max(y0, y1))
        x = x0 + (ends - y0) * ((x1 - x0) / (y1 - y0)) if y0 != y1 else np.array([[x0], [x1]])
        left, right = (x.min(axis=0) - reach_m) / cell_m, (x.max(axis=0) + reach_m) / cell_m
        first = np.ceil(left - 0.5).clip(window.col0, window.col1).astype(np.intp)
        last = (np.floor(right - 0.5) + 1).clip(window.col0, window.col1).astype(np.intp)
        np.add.at(starts, (rows - window.row0, first - window.col0), 1)
        np.add.at(starts, (rows - window.row0, np.maximum(first, last) - window.col0), -1)
    near: NDArray[np.bool_] = np.cumsum(starts, axis=1)[:, :-1] > 0
    return near | cells_inside(polygon, window, cell_m)


def _edges(polygon: Polygon) -> Iterator[tuple[Point, Point]]:
    return zip(polygon, (*polygon[1:], polygon[0]), strict=True)


def _clip(first: int, last: int, low: int, high: int) -> tuple[int, int]:
    return max(first, low), min(last, high)


def _signed_area(polygon: Polygon) -> float:
    # From a corner of its own, else a polygon far from the origin has none to speak of.
    x0, y0 = polygon[0]
    return 0.5 * math.fsum(
        (ax - x0) * (by - y0) - (bx - x0) * (ay - y0) for (ax, ay), (bx, by) in _edges(polygon)
    )


def _crossing(polygon: Polygon) -> tuple[int, int] | None:
    """Return two edges, by the number of their first points, that meet where they must not."""
    start = np.array(polygon)
    end = np.roll(start, -1, axis=0)
    for index in range(len(polygon) - 1):
        meet = _meet(start[index], end[index], start[index + 1 :], end[index + 1 :])
        # Neighbours share a corner, and no more: they meet if one turns back onto the other.
        meet[0] = _turns_back(start[index], end[index], end[index + 1])
        if index == 0:
            meet[-1] = _turns_back(start[-1], end[-1], end[0])
        if meet.any():
            return index, index + 1 + int(np.argmax(meet))
    return None


def _meet(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell which segments c-d, float64 (n, 2), have a point in common with a-b."""
    of_c, of_d = _side(a, b, c), _side(a, b, d)
    of_a, of_b = _side(c, d, a), _side(c, d, b)
    crossing = (of_c * of_d <= 0) & (of_a * of_b <= 0)
    # On one line they meet only where their boxes do; else the boxes do anyway.
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


def _turns_back(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> bool:
    """Tell whether the way a-b-c turns back onto itself at b."""
    return bool(_side(a, b, c) == 0 and np.dot(b - a, c - b) < 0)
