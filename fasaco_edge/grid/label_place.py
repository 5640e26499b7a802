"""Label place: the middle of the widest part of a polygon.

The module does not import numpy, so that small programs stay small.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from fasaco_edge.grid.geometry import Point, Polygon

# Number of horizontal lines tried, and ratio of a label's width to its height.
LINES, ASPECT = 16, 3.0


class LabelPlace(NamedTuple):
    """A place for a label: its middle x, y [m], and the polygon's width there [m]."""

    x: float
    y: float
    width_m: float


def label_place(polygon: Polygon) -> LabelPlace | None:
    """Return the place for a label in a polygon, corners (x, y) [m]; None if it has no area."""
    corners = list(polygon)
    turned = [(y, x) for x, y in corners]
    found, best = None, 0.0
    low, high = min((y for _, y in corners), default=0.0), max((y for _, y in corners), default=0.0)
    for index in range(LINES):
        y = low + (index + 0.5) / LINES * (high - low)
        for x0, x1 in _chords(corners, y):
            x = (x0 + x1) / 2
            # A label needs room above and below the middle of the line, too.
            y0, y1 = next(((a, b) for a, b in _chords(turned, x) if a <= y <= b), (y, y))
            tall = 2 * min(y - y0, y1 - y)
            fits = min(x1 - x0, ASPECT * tall) + tall / 2
            # Of lines that differ only by rounding, the first is kept.
            if fits > best + 1e-6:
                best, found = fits, LabelPlace(x, y, x1 - x0)
    return found


def _chords(corners: list[Point], y: float) -> Iterator[Point]:
    """Yield the intervals (x, x) [m] of a horizontal line inside a polygon."""
    ends = sorted(
        ax + (y - ay) / (by - ay) * (bx - ax)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
        if (ay > y) != (by > y)
    )
    return zip(ends[::2], ends[1::2], strict=False)
