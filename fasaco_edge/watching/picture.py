"""What each pixel of the picture shows: ground, coverage, path and robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.watching.frame import Frame
from fasaco_edge.wire import coverage as covering

# Where several things meet in one character without colours, the larger number is shown.
UNKNOWN, FLOOR, TO_COVER, COVERED, RECOVERED, WALL, AHEAD, NEXT, ROBOT = range(9)
HEADING = 16
"""The character of the robot's centre: this plus its heading in eighths of a turn."""

# By the defaults of the daemon's configuration; only the picture depends on them.
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65
# A thin wall must not vanish between samples; larger maps than this resolves are seldom.
MOST_SAMPLES = 12
# The path the robot takes next is drawn over this much of it [m].
NEXT_M = 3.0
# Where lanes are closer than so many pixels, the path beyond this [m] would hide the ground.
RESOLVED_PIXELS, NEAR_M = 2.0, 15.0

Kinds = NDArray[np.uint8]


def ground(frame: Frame, grid: OccupancyGrid | None, coverage: OccupancyGrid | None) -> Kinds:
    """Return the kinds of all pixels, uint8 (2 * lines, columns), without path and robot.

    A pixel with anything occupied in it is wall. Without a map, blocked cells are.
    """
    cells = None if coverage is None else _coverage(frame, coverage, blocked=grid is None)
    if grid is None:
        return np.full(frame.shape, UNKNOWN, np.uint8) if cells is None else cells
    finer = math.ceil(frame.pixel_m / grid.geometry.resolution)
    samples = min(max(finer, 1), MOST_SAMPLES)
    sampled = _MAP_KINDS[frame.sampled(grid, samples, -1).view(np.uint8)]
    rows, cols = frame.shape
    kinds: Kinds = sampled.reshape(rows, samples, cols, samples).max(axis=(1, 3))
    if cells is not None:
        tinted = (kinds == FLOOR) & (cells != UNKNOWN)
        kinds[tinted] = cells[tinted]
    return kinds


def draw_path(kinds: Kinds, frame: Frame, xy: NDArray[np.float64]) -> bool:
    """Draw the path ahead, float64 (n, 2) [m], into ``kinds``; what comes next stands out.

    Where its lanes would run together only the first ``NEAR_M``; returns whether it is whole.
    """
    if len(xy) < 2:
        return True
    lengths = np.hypot(*np.diff(xy, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    resolved = float(np.median(lengths)) >= RESOLVED_PIXELS * frame.pixel_m
    drawn_m = way[-1] if resolved else min(way[-1], NEAR_M)
    at = np.append(np.arange(0.0, drawn_m, frame.pixel_m / 2), drawn_m)
    points = np.stack([np.interp(at, way, xy[:, axis]) for axis in (0, 1)], axis=-1)
    # The nearest last: where the path crosses itself, that is what is seen.
    for kind, some in ((AHEAD, points[at > NEXT_M]), (NEXT, points[at <= NEXT_M])):
        _put(kinds, frame.pixels(some), kind)
    return bool(drawn_m == way[-1])


def draw_robot(kinds: Kinds, frame: Frame, pose: Pose2D, radius_m: float) -> None:
    """Draw the robot's disc, and its heading as the character its centre lies in."""
    rows, cols = frame.shape
    x = frame.left + (np.arange(cols) + 0.5) * frame.pixel_m - pose.x
    y = frame.top - (np.arange(rows) + 0.5) * frame.pixel_m - pose.y
    kinds[np.hypot(x[None, :], y[:, None]) <= radius_m] = ROBOT
    row, col = frame.pixels(np.array([[pose.x, pose.y]]))[0]
    upper = int(row) // 2 * 2
    eighth = round(pose.yaw / (math.pi / 4)) % 8
    _put(kinds, np.array([[upper, col], [upper + 1, col]]), HEADING + eighth)


def _coverage(frame: Frame, coverage: OccupancyGrid, *, blocked: bool) -> Kinds:
    table = _COVERAGE_AND_BLOCKED_KINDS if blocked else _COVERAGE_KINDS
    kinds: Kinds = table[frame.sampled(coverage, 1, covering.UNKNOWN).view(np.uint8)]
    return kinds


def _put(kinds: Kinds, pixels: NDArray[np.int64], kind: int) -> None:
    rows, cols = kinds.shape
    row, col = pixels.T
    seen = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    kinds[row[seen], col[seen]] = kind


def _map_kinds() -> Kinds:
    kinds = np.full(256, UNKNOWN, np.uint8)
    kinds[: FREE_AT_MOST + 1] = FLOOR
    kinds[OCCUPIED_AT_LEAST : 100 + 1] = WALL
    return kinds


def _coverage_kinds(blocked: int) -> Kinds:
    kinds = np.full(256, UNKNOWN, np.uint8)
    kinds[covering.TO_COVER] = TO_COVER
    kinds[covering.COVERED] = COVERED
    kinds[covering.RECOVERED] = RECOVERED
    kinds[covering.BLOCKED] = blocked
    return kinds


_MAP_KINDS = _map_kinds()
_COVERAGE_KINDS = _coverage_kinds(UNKNOWN)
_COVERAGE_AND_BLOCKED_KINDS = _coverage_kinds(WALL)
