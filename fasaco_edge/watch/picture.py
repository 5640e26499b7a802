"""Which part of the map frame a picture of half blocks shows, and at what scale.

What each pixel of the picture shows: ground, coverage, path and robot.

The picture of what is known; ground and coverage are drawn anew only where they changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.watch.robot_view import RobotView
from fasaco_edge.wire import coverage as covering
from fasaco_edge.wire.status import known_settings

LEAST_PIXEL_M = 0.01
# Pictures grow by so much at once [m]: with every row of a growing map they would jump.
ROUNDED_TO_M = 0.5

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """A raster of square pixels over the map frame, y upwards: row 0 is its northern edge.

    Two pixels, one above the other, make a character.

    Attributes:
        left, top: map coordinates of the upper left corner [m].
        pixel_m: edge of a pixel [m].
        columns, lines: size in characters; there are ``2 * lines`` rows of pixels.
    """

    left: float
    top: float
    pixel_m: float
    columns: int
    lines: int

    @classmethod
    def over(cls, bounds: Bounds, columns: int, lines: int) -> Frame:
        """Return the largest frame of so many characters that shows all of ``bounds``.

        Args:
            bounds: x0, y0, x1, y1 [m].
            columns, lines: the room there is, each at least 1.
        """
        x0, y0 = (math.floor(low / ROUNDED_TO_M) * ROUNDED_TO_M for low in bounds[:2])
        x1, y1 = (math.ceil(high / ROUNDED_TO_M) * ROUNDED_TO_M for high in bounds[2:])
        pixel_m = max((x1 - x0) / columns, (y1 - y0) / (2 * lines), LEAST_PIXEL_M)
        left = (x0 + x1 - columns * pixel_m) / 2
        top = (y0 + y1 + 2 * lines * pixel_m) / 2
        return cls(left, top, pixel_m, columns, lines)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels."""
        return 2 * self.lines, self.columns

    def pixels(self, xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the pixels (row, col), (n, 2), that points (x, y) [m], (n, 2), lie in."""
        cols = np.floor((xy[:, 0] - self.left) / self.pixel_m)
        rows = np.floor((self.top - xy[:, 1]) / self.pixel_m)
        beyond = 2.0**31
        return np.stack([rows, cols], axis=-1).clip(-beyond, beyond).astype(np.int64)

    def sampled(self, grid: OccupancyGrid, per_pixel: int, beyond: int) -> NDArray[np.int8]:
        """Return a grid's values on this raster, int8 (rows * per_pixel, cols * per_pixel).

        Args:
            grid: a map or a coverage.
            per_pixel: samples per pixel and axis.
            beyond: value outside the grid.
        """
        rows, cols = (size * per_pixel for size in self.shape)
        step, origin = self.pixel_m / per_pixel, grid.geometry.origin
        scale = 1.0 / grid.geometry.resolution
        dx = (self.left + (np.arange(cols) + 0.5) * step - origin.x)[None, :] * scale
        dy = (self.top - (np.arange(rows) + 0.5) * step - origin.y)[:, None] * scale
        if origin.yaw == 0.0:
            # A row and a column of indices are enough.
            col, row = np.floor(dx).astype(np.int64), np.floor(dy).astype(np.int64)
        else:
            cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
            col = np.floor(cos * dx + sin * dy).astype(np.int64)
            row = np.floor(cos * dy - sin * dx).astype(np.int64)
        height, width = grid.cells.shape
        inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        values = grid.cells[row.clip(0, height - 1), col.clip(0, width - 1)]
        sampled: NDArray[np.int8] = np.where(inside, values, np.int8(beyond))
        return sampled


def known_bounds(grid: OccupancyGrid) -> Bounds | None:
    """Return the bounds (x0, y0, x1, y1) [m] of what a grid knows; None where it knows nothing."""
    known = grid.cells >= 0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return None
    corners = [
        grid.geometry.to_map(float(col), float(row))
        for col in (cols[0], cols[-1] + 1)
        for row in (rows[0], rows[-1] + 1)
    ]
    xs, ys = zip(*corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def joint_bounds(parts: list[Bounds]) -> Bounds | None:
    """Return the bounds around all parts; None without any."""
    if not parts:
        return None
    x0, y0, x1, y1 = zip(*parts, strict=True)
    return min(x0), min(y0), max(x1), max(y1)


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


class Picturing:
    """Keeps the ground of the last picture.

    Attributes:
        pixel_m: edge of a pixel of that picture [m]; None before the first.
        path_is_whole: whether all of the path was drawn.
    """

    def __init__(self) -> None:
        self.pixel_m: float | None = None
        self.path_is_whole = True
        self._key: tuple[object, ...] = ()
        self._bounds: Bounds | None = None
        self._frame: Frame | None = None
        self._ground: Kinds | None = None

    def kinds(self, view: RobotView, columns: int, lines: int) -> Kinds | None:
        """Return a picture, uint8 (2 * lines, columns); None as long as nothing is to be seen."""
        # Grids are values: a new one is another object.
        if (key := (view.map, view.coverage)) != self._key:
            self._key, self._frame = key, None
            grids = [grid for grid in key if grid is not None]
            self._bounds = joint_bounds([b for grid in grids if (b := known_bounds(grid))])
        bounds = self._with_robot(view)
        if bounds is None:
            return None
        frame = Frame.over(bounds, columns, lines)
        if frame != self._frame or self._ground is None:
            self._frame, self._ground = frame, ground(frame, view.map, view.coverage)
        kinds = self._ground.copy()
        self.pixel_m = frame.pixel_m
        self.path_is_whole = draw_path(kinds, frame, view.path_ahead)
        if view.pose is not None:
            settings = known_settings(view.status.config if view.status else {})
            draw_robot(kinds, frame, view.pose, settings.robot.radius_m)
        return kinds

    def _with_robot(self, view: RobotView) -> Bounds | None:
        pose, parts = view.pose, [self._bounds] if self._bounds else []
        # A robot alone is no picture.
        if pose is not None and parts:
            parts.append((pose.x, pose.y, pose.x, pose.y))
        return joint_bounds(parts)
