"""Poses, the placement of a grid in the map frame, and windows of cells."""

from __future__ import annotations

import math
from dataclasses import dataclass


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
        """Return the common rectangle, or None where there is none."""
        row0, col0 = max(self.row0, other.row0), max(self.col0, other.col0)
        row1, col1 = min(self.row1, other.row1), min(self.col1, other.col1)
        return Window(row0, col0, row1, col1) if row0 < row1 and col0 < col1 else None

    def slices_in(self, outer: Window) -> tuple[slice, slice]:
        """Return the index of this window in an array that spans ``outer``."""
        return (
            slice(self.row0 - outer.row0, self.row1 - outer.row0),
            slice(self.col0 - outer.col0, self.col1 - outer.col0),
        )


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

    def to_pixels(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel coordinates (column, row), not rounded, of a point [m]."""
        dx, dy = x - self.origin.x, y - self.origin.y
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        return (cos * dx + sin * dy) / self.resolution, (cos * dy - sin * dx) / self.resolution

    def to_map(self, col: float, row: float) -> tuple[float, float]:
        """Return the point (x, y) [m] at pixel coordinates (column, row)."""
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        u, v = col * self.resolution, row * self.resolution
        return self.origin.x + cos * u - sin * v, self.origin.y + sin * u + cos * v

    def bounds(self) -> tuple[float, float, float, float]:
        """Return (x_min, y_min, x_max, y_max) [m] of the grid in the map frame."""
        corners = [self.to_map(col, row) for col in (0, self.cols) for row in (0, self.rows)]
        xs, ys = zip(*corners, strict=True)
        return min(xs), min(ys), max(xs), max(ys)


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose as it came off the bus.

    Attributes:
        pose: the robot's pose in ``frame``.
        frame: name of the frame the pose is given in.
        stamp_ns: time of the pose [ns], by its publisher's clock.
    """

    pose: Pose2D
    frame: str = "map"
    stamp_ns: int = 0
