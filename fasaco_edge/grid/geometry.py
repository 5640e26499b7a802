"""Geometry: poses, the placement of grids in the map frame, and windows of cells.

The module does not import numpy at run time, so that programs that only need poses stay small.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    _Value = TypeVar("_Value", np.uint8, np.uint16, np.bool_)
    _Coordinate = TypeVar("_Coordinate", float, NDArray[np.float64])
    _Pixel = TypeVar("_Pixel", bound=np.generic)

# A raster's corner is rounded to 1 / RASTER_STEPS of a pixel. So a map that grows by whole pixels
# stays on its raster, even if its origin is rounded to float32.
RASTER_STEPS = 2048

# Largest distance of a map, a pose or a path from the frame's origin [m]; UTM northings go up to
# 10,000 km. ``protocol/limits.yaml`` has the same number.
FARTHEST_M = 2e7
# Limit on the indices of a lattice's cells, so that sums of two of them are int32, too.
MOST_INDEX = 2**30

# Default limit of a lattice.
MAX_LATTICE_CELLS = 4_000_000

# Limits of the edge of a pixel [m]; in ``protocol/limits.yaml``, too.
MIN_RESOLUTION_M, MAX_RESOLUTION_M = 1e-4, 100.0


Bounds = tuple[float, float, float, float]
"""An axis-aligned rectangle in the map frame: x_min, y_min, x_max, y_max [m]."""


@dataclass(frozen=True, slots=True)
class Pose2D:
    """A pose in a plane: x [m], y [m], yaw [rad]."""

    x: float
    y: float
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Window:
    """A half-open rectangle of cells: rows row0..row1 - 1, columns col0..col1 - 1."""

    row0: int
    col0: int
    row1: int
    col1: int

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.row1 - self.row0

    @property
    def cols(self) -> int:
        """Number of columns."""
        return self.col1 - self.col0

    def intersection(self, other: Window) -> Window | None:
        """Return the common rectangle; None for none."""
        row0, col0 = max(self.row0, other.row0), max(self.col0, other.col0)
        row1, col1 = min(self.row1, other.row1), min(self.col1, other.col1)
        return Window(row0, col0, row1, col1) if row0 < row1 and col0 < col1 else None

    @classmethod
    def of(cls, mask: NDArray[np.bool_]) -> Window | None:
        """Return the smallest rectangle around the marked cells, bool (n, m); None without any."""
        (rows,) = mask.max(axis=1, initial=False).nonzero()
        (cols,) = mask.max(axis=0, initial=False).nonzero()
        if not len(rows):
            return None
        return cls(int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1)

    @classmethod
    def around(cls, *windows: Window | None) -> Window | None:
        """Return the smallest rectangle around all non-empty windows; None without any."""
        held = [window for window in windows if window and window.rows > 0 and window.cols > 0]
        if not held:
            return None
        return cls(
            min(window.row0 for window in held),
            min(window.col0 for window in held),
            max(window.row1 for window in held),
            max(window.col1 for window in held),
        )

    def in_chunks(self, chunk: int, rows: int, cols: int) -> Window:
        """Return the window rounded outward to chunks of a grid of ``rows`` x ``cols`` cells."""
        whole = self.rounded_out(chunk)
        return Window(whole.row0, whole.col0, min(whole.row1, rows), min(whole.col1, cols))

    def rounded_out(self, chunk: int) -> Window:
        """Return the window rounded outward to whole chunks of an unbounded grid."""
        return Window(
            self.row0 // chunk * chunk,
            self.col0 // chunk * chunk,
            -(-self.row1 // chunk) * chunk,
            -(-self.col1 // chunk) * chunk,
        )

    def strips(self, most: int) -> Iterator[Window]:
        """Yield windows of whole rows that together are this one, of about ``most`` cells each."""
        rows = max(most // max(self.cols, 1), 1)
        for row in range(self.row0, self.row1, rows):
            yield Window(row, self.col0, min(row + rows, self.row1), self.col1)

    def contains(self, other: Window) -> bool:
        """Return whether another rectangle, not empty, lies inside."""
        return self.intersection(other) == other

    def moved(self, rows: int, cols: int) -> Window:
        """Return the rectangle moved by ``rows`` and ``cols``."""
        return Window(self.row0 + rows, self.col0 + cols, self.row1 + rows, self.col1 + cols)

    def without(self, hole: Window) -> tuple[Window, ...]:
        """Return up to four rectangles that together are this window minus ``hole``."""
        common = self.intersection(hole)
        if common is None:
            return (self,) if self.rows > 0 and self.cols > 0 else ()
        parts = (
            Window(self.row0, self.col0, common.row0, self.col1),
            Window(common.row0, self.col0, common.row1, common.col0),
            Window(common.row0, common.col1, common.row1, self.col1),
            Window(common.row1, self.col0, self.row1, self.col1),
        )
        return tuple(part for part in parts if part.rows > 0 and part.cols > 0)

    def values_at(
        self, values: NDArray[_Value], cells: NDArray[np.int32], beyond: int
    ) -> NDArray[_Value]:
        """Return the values, (rows, cols) on this window, at cells (row, col), (n, 2).

        Cells outside have the value ``beyond``.
        """
        rows, cols = cells[:, 0] - self.row0, cells[:, 1] - self.col0
        if not len(rows) or (
            rows.min() >= 0
            and rows.max() < self.rows
            and cols.min() >= 0
            and cols.max() < self.cols
        ):
            # The usual case, fast for paths of tens of thousands of cells.
            return values.ravel().take(rows.astype(int) * self.cols + cols)
        inside = (rows >= 0) & (rows < self.rows) & (cols >= 0) & (cols < self.cols)
        found = rows.astype(values.dtype)
        found.fill(beyond)
        found[inside] = values[rows[inside], cols[inside]]
        return found

    def slices_in(self, outer: Window) -> tuple[slice, slice]:
        """Return the index of this window in an array that spans ``outer``."""
        return (
            slice(self.row0 - outer.row0, self.row1 - outer.row0),
            slice(self.col0 - outer.col0, self.col1 - outer.col0),
        )


@dataclass(frozen=True, slots=True)
class Raster:
    """An unbounded raster of pixels; a map shows a window of it.

    Attributes:
        resolution: edge of a pixel [m].
        yaw: yaw of the raster in the map frame [rad].
        right, up: corner of pixel (0, 0), relative to the map frame's origin, along the raster's
            axes [pixels]; in [0, 1), multiples of 1 / ``RASTER_STEPS``.
    """

    resolution: float
    yaw: float
    right: float
    up: float


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """The placement of a grid of square pixels in the map frame.

    Attributes:
        rows, cols: size in pixels; row 0 is the row with the smallest y, as in ROS.
        resolution: edge of a pixel [m].
        origin: pose of the outer corner of pixel (0, 0) in the map frame.
    """

    rows: int
    cols: int
    resolution: float
    origin: Pose2D

    @classmethod
    def of_cells(cls, window: Window, cell_m: float) -> GridGeometry:
        """Return the placement of a window of the coverage lattice, cells ``cell_m`` [m] wide.

        The placement is in the lattice's own frame, which may be rotated (``grid.rotation``).
        """
        corner = Pose2D(window.col0 * cell_m, window.row0 * cell_m)
        return cls(window.rows, window.cols, cell_m, corner)

    @property
    def window(self) -> Window:
        """The window of all pixels."""
        return Window(0, 0, self.rows, self.cols)

    @property
    def extent(self) -> str:
        """From where to where the map reaches, in words."""
        ends = [self.to_map(col, row) for col in (0, self.cols) for row in (0, self.rows)]
        (left, low), (right, high) = (map(of, zip(*ends, strict=True)) for of in (min, max))
        return f"which reaches from ({left:.2f}, {low:.2f}) to ({right:.2f}, {high:.2f}) m"

    def to_pixels(self, x: _Coordinate, y: _Coordinate) -> tuple[_Coordinate, _Coordinate]:
        """Return the pixel coordinates (column, row), not rounded, of one or many points [m]."""
        dx, dy = x - self.origin.x, y - self.origin.y
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        return (cos * dx + sin * dy) / self.resolution, (cos * dy - sin * dx) / self.resolution

    def to_map(self, col: _Coordinate, row: _Coordinate) -> tuple[_Coordinate, _Coordinate]:
        """Return one or many points (x, y) [m] at pixel coordinates (column, row)."""
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        u, v = col * self.resolution, row * self.resolution
        return self.origin.x + cos * u - sin * v, self.origin.y + sin * u + cos * v

    def values_at(
        self, values: NDArray[_Pixel], xy: NDArray[np.float64], beyond: int = 0
    ) -> NDArray[_Pixel]:
        """Return the values of the pixels at points (x, y) [m], float64 (n, 2).

        ``values``: (rows, cols), any dtype. The result, (n,), has the same dtype, and the value
        ``beyond`` outside the grid.
        """
        col, row = self.to_pixels(xy[:, 0], xy[:, 1])
        # Methods of the arrays, as this module does not import numpy.
        cols, rows = (col // 1).astype(int), (row // 1).astype(int)
        inside = (rows >= 0) & (cols >= 0) & (rows < self.rows) & (cols < self.cols)
        found = cols.astype(values.dtype)
        found.fill(beyond)
        found[inside] = values[rows[inside], cols[inside]]
        return found

    def on_raster(self) -> tuple[Raster, Window]:
        """Return the raster of this grid, and the grid's window on it.

        Two grids lie on one raster if they differ by whole pixels. The raster may be off the grid
        by up to half a step, 1 / 4096 of a pixel, along each axis.
        """
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        x, y = self.origin.x / self.resolution, self.origin.y / self.resolution
        col, right = divmod(round((cos * x + sin * y) * RASTER_STEPS), RASTER_STEPS)
        row, up = divmod(round((cos * y - sin * x) * RASTER_STEPS), RASTER_STEPS)
        window = Window(row, col, row + self.rows, col + self.cols)
        raster = Raster(self.resolution, self.origin.yaw, right / RASTER_STEPS, up / RASTER_STEPS)
        return raster, window

    def snapped(self, chunk: int = 1) -> GridGeometry:
        """Return this grid moved exactly onto its raster, see ``on_raster``.

        So grids on the same pixels become equal, also if a transform or float32 has rounded one of
        their origins. The grid is extended to whole chunks of ``chunk`` pixels of the raster.
        """
        raster, window = self.on_raster()
        window = window.rounded_out(chunk)
        cos, sin = math.cos(raster.yaw), math.sin(raster.yaw)
        u = (window.col0 + raster.right) * raster.resolution
        v = (window.row0 + raster.up) * raster.resolution
        origin = Pose2D(cos * u - sin * v, sin * u + cos * v, raster.yaw)
        return GridGeometry(window.rows, window.cols, raster.resolution, origin)

    def corner_of(self, other: GridGeometry) -> tuple[int, int]:
        """Return the pixel (row, col) whose corner is the corner of another grid."""
        col, row = self.to_pixels(other.origin.x, other.origin.y)
        return round(row), round(col)

    def bounds(self, window: Window | None = None) -> Bounds:
        """Return the bounds of the grid, or of a window of its pixels, in the map frame."""
        part = window or Window(0, 0, self.rows, self.cols)
        cols, rows = (part.col0, part.col1), (part.row0, part.row1)
        xs, ys = zip(*(self.to_map(col, row) for col in cols for row in rows), strict=True)
        return min(xs), min(ys), max(xs), max(ys)


def union_bounds(*parts: Bounds | None) -> Bounds | None:
    """Return the bounds around all parts; None without any."""
    held = [part for part in parts if part is not None]
    if not held:
        return None
    x0, y0, x1, y1 = zip(*held, strict=True)
    return min(x0), min(y0), max(x1), max(y1)


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose as received.

    Attributes:
        pose: the robot's pose in ``frame``.
        frame: name of the frame the pose is given in.
        stamp_ns: time of the pose [ns], by its publisher's clock.
    """

    pose: Pose2D
    frame: str = "map"
    stamp_ns: int = 0


Point = tuple[float, float]
Polygon = tuple[Point, ...]


def polygon_bounds(polygon: Polygon) -> tuple[float, float, float, float]:
    """Return (x_min, y_min, x_max, y_max) [m]."""
    xs, ys = zip(*polygon, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
