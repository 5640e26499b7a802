"""Driven line: its pieces on a raster, the pixels that it sweeps, and its driving time.

The robot comes to rest wherever it turns on the spot. Between two such places its speed over time
is a trapezoid, or a triangle on short ways; in a turn, so is its turn rate. A robot with a turning
radius comes to rest where it changes between forward and backward. Nothing here uses the planners'
assumptions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.judge.pixels import Mask

# Tolerance of distances [pixels]: rounding must not exclude a pixel at exactly the distance.
TOUCH_TOLERANCE_PX = 1e-3
# Number of rows of pixels evaluated at a time.
SWEPT_ROWS = 30_000
Points = NDArray[np.float64]
# Curves come as chords. Longest chord of an arc [m]; factor of tolerance for the bends between
# chords; a bend up to STEERED_DEG [deg] is steered, however short the chords are.
ARC_STEP_M, ARC_TOLERANCE, STEERED_DEG = 0.06, 1.05, 1.2


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Limits of a robot's motion, besides its speed.

    Attributes:
        acceleration_m_s2: acceleration and deceleration of driving [m/s^2].
        turn_deg_s, turn_deg_s2: turn rate on the spot [deg/s], and its acceleration [deg/s^2].
        steered_deg: bend up to which the robot steers without a stop [deg].
    """

    acceleration_m_s2: float
    turn_deg_s: float
    turn_deg_s2: float
    steered_deg: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ArcBends:
    """The bends of a line for a robot with a turning radius, both bool (n - 1,).

    Attributes:
        reverses: whether the robot changes between forward and backward, as the line turns back.
        spots: whether the bend is too sharp for an arc of that radius: the robot would have to turn
            on the spot.
    """

    reverses: Mask
    spots: Mask

    @classmethod
    def of(
        cls, ways_m: NDArray[np.float64], bends_deg: NDArray[np.float64], radius_m: float
    ) -> ArcBends:
        """Judge the bends of a line; ``ways_m`` and ``bends_deg`` as for ``drive_seconds``.

        The bend between two chords of a circle is half of the sum of their central angles.
        """
        spans_deg = np.degrees(np.minimum(ways_m, ARC_STEP_M) / radius_m)
        most_deg = 0.5 * ARC_TOLERANCE * (spans_deg[:-1] + spans_deg[1:])
        most_deg = np.maximum(most_deg, STEERED_DEG)
        reverses = 180.0 - bends_deg <= most_deg
        return cls(reverses, ~reverses & (bends_deg > most_deg))


def drive_seconds(
    ways_m: NDArray[np.float64],
    bends_deg: NDArray[np.float64],
    speed_m_s: float,
    by: DriveLimits,
    arcs: ArcBends | None = None,
) -> float:
    """Return the driving time of a line [s].

    Args:
        ways_m: lengths of its segments, float64 (n,) [m].
        bends_deg: bends between its segments, float64 (n - 1,), in [0, 180] [deg].
        speed_m_s: the robot's speed [m/s].
        by: the robot's other limits.
        arcs: the bends of a robot with a turning radius, whose turn rate limits its speed on arcs;
            else None.
    """
    if not len(ways_m):
        return 0.0
    if arcs is not None:
        return _seconds_of_arcs(ways_m, bends_deg, speed_m_s, by, arcs)
    is_stop = bends_deg > by.steered_deg
    runs_m = np.add.reduceat(ways_m, np.concatenate([[0], np.flatnonzero(is_stop) + 1]))
    runs_s = _from_rest_to_rest(runs_m, speed_m_s, by.acceleration_m_s2)
    turns_s = _from_rest_to_rest(bends_deg[is_stop], by.turn_deg_s, by.turn_deg_s2)
    return float(runs_s.sum() + turns_s.sum())


def _seconds_of_arcs(
    ways_m: NDArray[np.float64],
    bends_deg: NDArray[np.float64],
    speed_m_s: float,
    by: DriveLimits,
    arcs: ArcBends,
) -> float:
    is_stop = arcs.reverses | arcs.spots
    begins = np.concatenate([[0], np.flatnonzero(is_stop) + 1])
    runs_m = np.add.reduceat(ways_m, begins)
    runs_s = _from_rest_to_rest(runs_m, speed_m_s, by.acceleration_m_s2)
    turns_s = _from_rest_to_rest(bends_deg[arcs.spots], by.turn_deg_s, by.turn_deg_s2)
    # A bend is steered on half of both segments beside it.
    beside_s = (ways_m[:-1] + ways_m[1:])[~is_stop] / (2.0 * speed_m_s)
    late_s = np.maximum(bends_deg[~is_stop] / by.turn_deg_s - beside_s, 0.0)
    return float(runs_s.sum() + turns_s.sum() + late_s.sum())


def _from_rest_to_rest(
    ways: NDArray[np.float64], most_speed: float, acceleration: float
) -> NDArray[np.float64]:
    """Return the least times from rest to rest [s], for lengths or angles."""
    ramp = most_speed / acceleration
    return np.where(
        ways < most_speed * ramp, 2.0 * np.sqrt(ways / acceleration), ways / most_speed + ramp
    )


@dataclass(frozen=True, slots=True, eq=False)
class RasterLine:
    """A driven line on the raster of a floor.

    Attributes:
        starts, ends: ends of each segment, (column, row) [pixels], both (n, 2), n >= 1.
    """

    starts: Points
    ends: Points

    @classmethod
    def of(cls, line_xy: Points, geometry: GridGeometry, driven: Mask | None) -> RasterLine:
        origin, yaw = geometry.origin, geometry.origin.yaw
        turned = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        places = (line_xy - np.array([origin.x, origin.y])) @ turned / geometry.resolution
        starts, ends = places[:-1], places[1:]
        if driven is not None:
            starts, ends = starts[driven], ends[driven]
        if not len(starts):
            starts = ends = places[:1]
        return cls(starts, ends)

    @property
    def ways_and_bends(self) -> tuple[Points, Points]:
        """Lengths of the segments [pixels], (m,), and the bends between them [deg], (m - 1,)."""
        way = self.ends - self.starts
        lengths = np.hypot(*way.T)
        way = way[lengths > 0]
        turned = np.diff(np.degrees(np.arctan2(way[:, 1], way[:, 0])))
        return lengths[lengths > 0], np.abs((turned + 180.0) % 360.0 - 180.0)

    def pieces(self, most_px: float, together: int) -> Iterator[tuple[Points, Points]]:
        """Yield starts and ends of pieces of length ``most_px`` or less, both (k, 2) [pixels].

        ``together``: largest number of pieces yielded at a time.
        """
        way = self.ends - self.starts
        counts = np.maximum(np.ceil(np.hypot(*way.T) / most_px), 1).astype(np.int64)
        stops = np.cumsum(counts)
        begins = stops - counts
        for first in range(0, int(stops[-1]), together):
            number = np.arange(first, min(first + together, int(stops[-1])))
            segment = np.searchsorted(stops, number, side="right")
            part = number - begins[segment]
            start, along = self.starts[segment], way[segment]
            share = (np.stack([part, part + 1]) / counts[segment])[..., None]
            yield start + share[0] * along, start + share[1] * along

    def swept(self, half_px: float, shape: tuple[int, int]) -> Mask:
        """Return the pixels whose centre is within ``half_px`` of the line, bool ``shape``.

        In each row, the pixels near a piece are a run. A counter goes up where a run begins and
        down after its end.
        """
        rows, cols = shape
        reach = half_px + TOUCH_TOLERANCE_PX
        longest = max(half_px, 1.0)
        together = max(SWEPT_ROWS // math.ceil(2 * reach + longest + 1), 1)
        runs = np.zeros(rows * (cols + 1), np.int32)
        for starts, ends in self.pieces(longest, together):
            bottom = np.floor(np.minimum(starts[:, 1], ends[:, 1]) - reach).astype(np.int64)
            top = np.maximum(starts[:, 1], ends[:, 1]) + reach
            row = bottom[:, None] + np.arange(math.ceil((top - bottom).max()))
            left, right = _run_beside(starts, ends, row.astype(np.float64) + 0.5, reach)
            first = np.maximum(np.ceil(left - 0.5), 0.0)
            stop = np.minimum(np.floor(right - 0.5) + 1.0, float(cols))
            near = (first < stop) & (row >= 0) & (row < rows)
            before = row[near] * (cols + 1)
            np.add.at(runs, before + first[near].astype(np.int64), 1)
            np.add.at(runs, before + stop[near].astype(np.int64), -1)
        # One more column for the ends of runs that reach the last pixel of a row.
        beside = np.cumsum(runs, out=runs).reshape(rows, cols + 1) > 0
        return beside[:, :-1]


def _run_beside(starts: Points, ends: Points, y: Points, reach: float) -> tuple[Points, Points]:
    """Return the least and largest x of horizontal lines within ``reach`` of segments.

    A disc at the share ``t`` of a segment spans ``x(t) +- sqrt(reach^2 - (y - y(t))^2)`` on a line.
    Its right end is at a maximum where the line meets the common tangent of all discs, or else at
    the nearer end of the segment; likewise its left end.

    Args:
        starts, ends: ends of the segments, float64 (n, 2).
        y: y of the lines, float64 (n, m).
        reach: radius of the discs.

    Returns:
        both float64 (n, m); NaN where a line is farther than ``reach`` from a segment.
    """
    way = ends - starts
    dx, dy = way[:, :1], np.where(way[:, 1:] == 0.0, 1e-12, way[:, 1:])
    up = y - starts[:, 1:]
    tangent = reach * dx * np.sign(dy) / np.hypot(dx, dy)
    found = []
    for side in (-1.0, 1.0):
        share = np.clip((up + side * tangent) / dy, 0.0, 1.0)
        square = reach * reach - (up - share * dy) ** 2
        with np.errstate(invalid="ignore"):
            found.append(starts[:, :1] + share * dx + side * np.sqrt(square))
    return found[0], found[1]
