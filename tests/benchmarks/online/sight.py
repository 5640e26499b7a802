"""Map that a robot has of a building, and its changes.

Like a mapper, it gives the whole map after it has grown, and otherwise an update of the changes.
Localisation is perfect.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import UNKNOWN, MapPatch, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, disc_is_free, reveal_disc
from fasaco_edge.mission.events import MapReceived, PatchReceived
from tests.benchmarks.online.buildings import Building

# The published map grows by blocks of about this size [m].
CHUNK_M = 1.0
# What the robot's disc is wider than its hull [pixels]: it may touch a wall.
SLACK_PX = 0.02

# A point in the building's pixels: column, row, not rounded.
Point = tuple[float, float]


class Sight:
    """A scanner in a building, and the robot's own map.

    Args:
        building: where it is.
        range_m: reach of the scanner, which looks all around [m].

    Attributes:
        truth: what is there, int8 (rows, cols) pixels; may be changed while a robot drives.
        geometry: where the pixels lie in the robot's map frame.
    """

    def __init__(self, building: Building, range_m: float) -> None:
        self.truth = building.truth.cells.copy()
        self.geometry = building.truth.geometry
        self._frame = building.truth.frame
        self._footprint = building.footprint
        resolution = self.geometry.resolution
        self._hull_px = building.footprint.robot_radius_m / resolution - SLACK_PX
        self._known = np.full_like(self.truth, UNKNOWN)
        self._reach_px = range_m / resolution
        self._rays = _rays(self._reach_px)
        self._chunk_px = max(1, round(CHUNK_M / resolution))
        self._extent: Window | None = None
        self._changed: Window | None = None
        self._sent: Window | None = None

    def pose_of(self, at: Point, yaw: float) -> Pose2D:
        """Return the pose on the robot's map, of a robot that looks along ``yaw`` [rad]."""
        yaw = math.remainder(yaw + self.geometry.origin.yaw, math.tau)
        return Pose2D(*self.geometry.to_map(*at), yaw)

    def point_of(self, x: float, y: float) -> Point:
        """Return where a place on the robot's map is in truth [pixels]."""
        return self.geometry.to_pixels(x, y)

    def look(self, at: Point) -> None:
        """Take in a scan from ``at``, and that the ground under the robot is as it is."""
        scanner = Scanner(*at, self._reach_px, self._footprint.free_at_most)
        seen = cast_rays(self.truth, self._known, scanner, self._rays)
        stood_on = reveal_disc(self.truth, self._known, *at, self._hull_px)
        changed = Window.around(Window(*map(int, seen)), Window(*map(int, stood_on)))
        self._extent = Window.around(self._extent, changed)
        self._changed = Window.around(self._changed, changed)

    def news(self) -> MapReceived | PatchReceived | None:
        """Return what a mapper would publish now; None where there is nothing new."""
        if self._changed is None or self._extent is None:
            return None
        changed, self._changed = self._changed, None
        extent = self._extent.in_chunks(self._chunk_px, *self._known.shape)
        if extent == self._sent:
            rows, cols = changed.slices_in(Window(0, 0, *self._known.shape))
            patch = self._known[rows, cols].copy()
            window = Window(
                changed.row0 - extent.row0, changed.col0 - extent.col0,
                changed.row1 - extent.row0, changed.col1 - extent.col0,
            )  # fmt: skip
            return PatchReceived(MapPatch(window, patch, self._frame))
        self._sent = extent
        rows, cols = extent.slices_in(Window(0, 0, *self._known.shape))
        x, y = self.geometry.to_map(extent.col0, extent.row0)
        geometry = GridGeometry(
            extent.rows, extent.cols, self.geometry.resolution,
            Pose2D(x, y, self.geometry.origin.yaw),
        )  # fmt: skip
        return MapReceived(OccupancyGrid(geometry, self._known[rows, cols].copy(), self._frame))

    def is_clear(self, start: Point, end: Point) -> bool:
        """Tell whether in truth the robot can move straight from ``start`` to ``end``."""
        steps = max(1, math.ceil(2.0 * math.dist(start, end)))
        (x, y), (to_x, to_y) = start, end
        return all(
            self.is_free(
                (x + (to_x - x) * step / steps, y + (to_y - y) * step / steps), self._hull_px
            )
            for step in range(steps + 1)
        )

    def is_free(self, at: Point, radius_px: float) -> bool:
        """Tell whether in truth a disc is free."""
        return bool(disc_is_free(self.truth, *at, radius_px, self._footprint.free_at_most))


def _rays(reach_px: float) -> NDArray[np.float64]:
    """Return the directions of a scan's rays, unit vectors, float64 (n, 2).

    Neighbouring ones are at most a pixel apart where they end, so that no pixel in sight is
    missed.
    """
    rays = max(math.ceil(2.0 * math.pi * reach_px), 4)
    angles = np.arange(rays) * (2.0 * math.pi / rays)
    return np.column_stack((np.cos(angles), np.sin(angles)))
