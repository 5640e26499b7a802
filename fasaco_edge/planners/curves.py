"""Curve along a line, for a robot that cannot turn on the spot.

The curve follows the lanes of the line. Between two places on lanes, arcs and straights on free
floor replace the line, see ``kernels.floor.words``. Lanes are shortened, and short lanes left out,
if their floor is worth less than the saved time (``kernels.floor.curves``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import RobotDiscs, map_to_raster, raster_to_map
from fasaco_edge.grid.floor import corners
from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.kernels.floor import curves as kernel
from fasaco_edge.kernels.floor.bits import Bits
from fasaco_edge.kernels.floor.places import disc_rows, places_of
from fasaco_edge.kernels.floor.words import MOST_WORDS, PIECES
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.line import NEAR_SHARE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
# Radius of the arcs [tightest radii]: larger, so that the follower can steer back onto them.
MARGIN = 1.1
# Distance of the places on a lane where arcs may begin and end [radii].
SPACING = 0.2
# Length of the line that a word may replace, without and with reversing [radii]; twice the tool's
# width is added. Factors on this length while no word fits.
AHEAD_WINDOW, BOTH_WINDOW, WIDER = 6.0, 4.5, (2.0, 4.0, 8.0)
# Cost of a turn on the spot [s]: a robot with a turning radius cannot drive it.
SPOT_S = 1000.0
# Factor on the seconds of driving backward.
BACKWARD_FACTOR = 2.0
# Least distance along the line after which a pixel counts as swept again [tool's widths].
SWEPT_AGAIN = 2.5
# Number of start directions of a robot whose heading is not known.
HEADINGS = 8
# Largest distance between neighbouring points of an arc [m].
STEP_M = 0.05
# Largest bend between two lanes that the robot steers; a larger bend becomes an arc or, at worst, a
# turn on the spot [rad].
STEERED_RAD = 0.02
# Largest difference of the headings along a straight [rad].
TURNED_RAD = 1e-9
# Poses of a curve are at least this far apart [m].
LEAST_M = 1e-3
# Decimals of points [m] and headings [rad]; so rounded, they are equal on all computers.
DECIMALS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A curve to drive.

    Attributes:
        poses: float64 (n, 3), n >= 1: x, y [m] in the map frame, and the robot's heading [rad];
            straight segments join them.
        is_backward: bool (n - 1,): whether each segment is driven backward.
        legs: int64 (n,): for a pose on a straight of the line, the index of the line's point before
            it; below 0 for poses beside the line.
        spots: number of turns that no arcs can replace: they stay turns on the spot.
    """

    poses: Floats
    is_backward: NDArray[np.bool_]
    legs: Ints
    spots: int

    @property
    def xy(self) -> Floats:
        """The points, float64 (n, 2): x, y [m]."""
        return self.poses[:, :2]

    @property
    def reversals(self) -> int:
        """Number of changes between forward and backward."""
        return int(np.count_nonzero(np.diff(self.is_backward)))

    @property
    def backward_m(self) -> float:
        """Length driven backward [m]."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T)[self.is_backward].sum())


class FreePlaces(Protocol):
    """Places where the robot's disc fits: a part of ``Floor``."""

    @property
    def geometry(self) -> GridGeometry: ...
    @property
    def discs(self) -> RobotDiscs: ...
    @property
    def blocked(self) -> Bits: ...
    @property
    def places(self) -> Bits: ...


def curve_along(
    line_xy: Floats,
    ground: FreePlaces,
    to_sweep: NDArray[np.bool_],
    config: CurveConfig,
    *,
    start_yaw: float | None = None,
    is_end_fixed: bool = False,
) -> Curve:
    """Return the curve along a line.

    Args:
        line_xy: float64 (n, 2), n >= 1: x, y in the map frame [m], at places of the ground.
        ground: where the robot can be.
        to_sweep: bool (rows, cols) of the ground's raster: the floor to sweep.
        config: the robot.
        start_yaw: its heading at the line's first point [rad]; None for any.
        is_end_fixed: whether the curve must end where the line does.
    """
    return _Search(line_xy, ground, to_sweep, config, start_yaw, is_end_fixed).curve()


class _Search:
    """The search for a curve; points are x (column), y (row) of the floor's raster [pixels]."""

    def __init__(
        self,
        line_xy: Floats,
        floor: FreePlaces,
        to_sweep: NDArray[np.bool_],
        config: CurveConfig,
        start_yaw: float | None,
        is_end_fixed: bool,
    ) -> None:
        self._floor, self._to_sweep, self._config = floor, to_sweep, config
        self._is_end_fixed = is_end_fixed
        unit, discs = floor.geometry.resolution, floor.discs
        self._radius = MARGIN * config.radius_m / unit
        self._window = (BOTH_WINDOW if config.reverses else AHEAD_WINDOW) * self._radius
        self._window += 2.0 * discs.tool_m / unit
        near_s = NEAR_SHARE * config.price_s_m2 * discs.tool_m * unit if discs.clearance_m else 0.0
        self._base = kernel.Base(
            radius=self._radius,
            reverses=config.reverses,
            straight_s=unit / config.speed_m_s,
            arc_s=unit / config.arc_m_s,
            back=BACKWARD_FACTOR,
            stop_s=config.stop_s,
            steered=STEERED_RAD,
            spot_s=SPOT_S,
            near_s=near_s,
            width=discs.tool_m / unit,
        )
        self._clear = floor.places
        if discs.clearance_m:
            self._clear = places_of(floor.blocked, disc_rows(discs.clear_m / unit))
        rows, cols = map_to_raster(floor.geometry, *line_xy.T)
        points = np.column_stack([cols, rows])
        self._first = points[0]
        # Headings in the frame of the raster.
        self._yaw = floor.geometry.origin.yaw
        if start_yaw is None:
            headings = np.linspace(0.0, 2.0 * np.pi, HEADINGS, endpoint=False)
        else:
            headings = np.array([start_yaw - self._yaw])
        self._starts = len(headings)
        self._corners = corners(points)
        self._line = self._places(points[self._corners], headings)
        self._is_free_to_start = start_yaw is None

    def curve(self) -> Curve:
        """Return the cheapest curve."""
        if len(self._line.way) == self._starts:
            heading = float(self._line.poses[0, 2])
            pose, none = np.array([(*self._first, heading)]), np.zeros(0, np.bool_)
            return self._as_curve(pose, none, np.zeros(1, np.int64), 0)
        ways = self._ways()
        for wider in WIDER:
            states = self._states(ways)
            spots = self._spots(states, ways)
            if not len(spots):
                break
            window = wider * self._window
            away = np.abs(self._line.way[:, None] - self._line.way[spots]).min(axis=1)
            self._line.window[away <= window] = window
            ways = self._ways()
        return self._drawn(self._states(ways), ways)

    def _places(self, points: Floats, headings: Floats) -> kernel.LinePlaces:
        """Return the places to start from, and the places along a line without repeated points."""
        legs = np.diff(points, axis=0)
        lengths = np.hypot(*legs.T)
        parts = np.maximum(np.ceil(lengths / (SPACING * self._radius)), 1).astype(np.int64)
        leg = np.repeat(np.arange(len(legs)), parts + 1)
        begins = np.cumsum(parts + 1) - (parts + 1)
        share = (np.arange(len(leg)) - begins[leg]) / parts[leg]
        along = np.concatenate([[0.0], np.cumsum(lengths)])[leg] + share * lengths[leg]
        yaw = np.arctan2(legs[:, 1], legs[:, 0])[leg]
        poses = np.column_stack([points[leg] + share[:, None] * legs[leg], yaw])
        starts = np.column_stack([np.repeat(points[:1], len(headings), axis=0), headings])
        none = np.zeros(len(headings))
        way = np.concatenate([none, along])
        return kernel.LinePlaces(
            poses=np.concatenate([starts, poses]),
            way=way,
            leg=np.concatenate([np.full(len(headings), -1), leg]),
            worth_s=np.concatenate([none, self._worth_s(poses[:, :2], along)]),
            window=np.full(len(way), self._window),
        )

    def _worth_s(self, points: Floats, way: Floats) -> Floats:
        """Return the price of the floor that the line sweeps from each point to the next [s]."""
        if not len(points):
            return np.zeros(0)
        width, unit = self._base.width, self._floor.geometry.resolution
        middles = np.concatenate([(points[:-1] + points[1:]) / 2, points[-1:]])
        (col0, row0), (col1, row1) = middles.min(axis=0) - width, middles.max(axis=0) + width
        box = Window(int(row0), int(col0), int(row1) + 1, int(col1) + 1)
        rows, cols = self._to_sweep.shape
        seen = box.intersection(Window(0, 0, rows, cols))
        assert seen is not None
        part = np.ascontiguousarray(self._to_sweep[seen.slices_in(Window(0, 0, rows, cols))])
        corner = np.array([seen.col0, seen.row0], np.float64)
        counts = kernel.count_swept(middles - corner, way, part, width / 2.0, SWEPT_AGAIN * width)
        return counts.astype(np.float64) * (0.5 * self._config.price_s_m2 * unit * unit)

    def _ways(self) -> kernel.Ways:
        count = 2 * len(self._line.way)
        ways = kernel.Ways(
            np.full(count, np.inf),
            np.full(count, kernel.NONE),
            np.zeros((count, PIECES), np.int8),
            np.zeros((count, PIECES)),
        )
        ways.cost_s[: 2 * self._starts : 2] = 0.0
        if self._is_free_to_start:
            ways.cost_s[2 * self._starts] = 0.0
        memory = kernel.WordMemory(
            np.zeros((MOST_WORDS, PIECES), np.int8),
            np.zeros((MOST_WORDS, PIECES)),
            np.zeros(MOST_WORDS),
            np.zeros((kernel.MOST_POINTS, 2)),
        )
        kernel.find_ways(self._line, self._base, self._floor.places, self._clear, ways, memory)
        return ways

    def _states(self, ways: kernel.Ways) -> list[int]:
        """Return the states of the cheapest way, which may end shortly before the line."""
        way, worth_s = self._line.way, self._line.worth_s
        left_s = np.append(np.cumsum(worth_s[:0:-1])[::-1], 0.0)
        left_s[way < way[-1] - (0.0 if self._is_end_fixed else self._window)] = np.inf
        states = [int(np.argmin(np.round(ways.cost_s + np.repeat(left_s, 2), DECIMALS)))]
        while (before := int(ways.previous[states[-1]])) != kernel.NONE:
            states.append(before)
        return states[::-1]

    def _spots(self, states: list[int], ways: kernel.Ways) -> list[int]:
        """Return the places where the robot would turn on the spot."""
        found = []
        for before, state in pairwise(states):
            turn = self._pose(state)[2] - self._pose(before)[2]
            is_turn = abs(math.remainder(turn, math.tau)) > STEERED_RAD
            is_start = self._is_free_to_start and self._line.leg[before >> 1] < 0
            if is_turn and not ways.lengths[state].any() and not is_start:
                found.append(state >> 1)
        return found

    def _pose(self, state: int) -> tuple[float, float, float]:
        """Return the robot's pose in a state."""
        x, y, yaw = self._line.poses[state >> 1].tolist()
        return x, y, yaw + math.pi * (state & 1)

    def _drawn(self, states: list[int], ways: kernel.Ways) -> Curve:
        poses, backward, legs = [self._pose(states[0])], [], [int(self._line.leg[states[0] >> 1])]
        for before, state in pairwise(states):
            at = self._pose(before)
            word = zip(ways.sides[state].tolist(), ways.lengths[state].tolist(), strict=True)
            for side, length in word:
                if length:
                    points = self._along(at, side, length)
                    backward += [length < 0.0] * len(points)
                    poses += points
                    legs += [-1] * len(points)
                    at = points[-1]
            # The exact pose, with the heading after a turn on the spot.
            poses[-1], legs[-1] = self._pose(state), int(self._line.leg[state >> 1])
        drawn, is_backward = np.array(poses), np.array(backward, np.bool_)
        kept = _needed(drawn, is_backward, LEAST_M / self._floor.geometry.resolution)
        # If poses were dropped, a segment takes the direction of its last part.
        spots = len(self._spots(states, ways))
        return self._as_curve(drawn[kept], is_backward[kept[1:] - 1], np.array(legs)[kept], spots)

    def _along(
        self, at: tuple[float, float, float], side: int, length: float
    ) -> list[tuple[float, float, float]]:
        """Return the poses along an arc, or the end of a straight; ``length`` in [radii]."""
        x, y, yaw = at
        step = STEP_M / self._floor.geometry.resolution
        parts = math.ceil(abs(length) * self._radius / step) if side else 1
        half = 0.5 * side * length / parts
        chord = self._radius * length / parts * (math.sin(half) / half if side else 1.0)
        poses = []
        for part in range(parts):
            along = yaw + (2 * part + 1) * half
            x, y = x + chord * math.cos(along), y + chord * math.sin(along)
            poses.append((x, y, yaw + 2 * (part + 1) * half))
        return poses

    def _as_curve(
        self, poses: Floats, is_backward: NDArray[np.bool_], legs: Ints, spots: int
    ) -> Curve:
        xy, last = raster_to_map(self._floor.geometry, poses[:, 1::-1]), len(self._corners) - 1
        yaw = np.remainder(poses[:, 2] + self._yaw + np.pi, 2.0 * np.pi) - np.pi
        # A straight may continue over further points of the line.
        legs = np.where(legs < 0, legs, self._corners[np.minimum(legs + 1, last)] - 1)
        placed: Floats = np.column_stack([xy, yaw]).round(DECIMALS)
        return Curve(placed, is_backward, legs, spots)


def _needed(poses: Floats, is_backward: NDArray[np.bool_], least: float) -> Ints:
    """Return the indices of poses that a curve needs, int64 (m,).

    It needs no poses within a straight, and none closer than ``least`` to the previous pose.
    """
    turned = np.abs(np.remainder(np.diff(poses[:, 2]) + np.pi, 2.0 * np.pi) - np.pi) > TURNED_RAD
    is_bend = turned[:-1] | turned[1:] | (is_backward[:-1] != is_backward[1:])
    bends = np.flatnonzero(np.concatenate([[True], is_bend, [True]][: len(poses)]))
    kept = [0]
    for number in bends.tolist():
        if math.dist(poses[number, :2], poses[kept[-1], :2]) >= least:
            kept.append(number)
    return np.array(kept)
