"""Scanner of the simulated robot, and the map that it makes of the building while it drives."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, Window
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, disc_is_free, reveal_disc
from fasaco_edge.simulation.robot import SimulationConfig

# Spacing of the checks whether the hull fits along a straight line [m]: between two checks, a
# corner reaches less than a millimetre into the hull.
SPACING_M = 0.025


def rays_for(reach_px: float) -> int:
    """Return the number of rays of a scan that misses no visible pixel, for a reach [pixels].

    A pixel at a distance d <= reach contains a disc of diameter 1, whose angular width is
    2 asin(1 / 2d) >= 1 / reach: at least one ray crosses it. For 3.5 m at 5 cm this takes 440 rays,
    more than the LDS-01's 360.
    """
    return max(math.ceil(math.tau * reach_px), 4)


class Mapper:
    """A scanner in a ground-truth map, and the robot's own map.

    Localisation is perfect: both maps share the frame and the pixel raster. As from SLAM, the
    published map is only as large as its known part: its origin and size change while the robot
    explores.
    """

    def __init__(self, truth: OccupancyGrid, config: SimulationConfig) -> None:
        resolution = truth.geometry.resolution
        self._truth = truth
        # Raster of the robot's own map.
        self._geometry = truth.geometry
        self._known: NDArray[np.int8] = np.full(truth.cells.shape, UNKNOWN, np.int8)
        self._extent: Window | None = None
        self._hull_px = config.hull_radius_m / resolution
        self._reach_px = config.range_m / resolution
        self._free_at_most = config.free_at_most
        self._chunk_px = max(1, round(config.map_chunk_m / resolution))
        rays = rays_for(self._reach_px)
        self._angles = np.arange(rays) * (math.tau / rays)

    def estimated(self, pose: Pose2D) -> Pose2D:
        """Return the estimated pose of a robot at ``pose``: the same pose, as there is no error."""
        return pose

    def true_place(self, x: float, y: float) -> Point:
        """Return the true position of a point of the robot's map [m]: the same point."""
        return x, y

    def scan(self, pose: Pose2D) -> Window | None:
        """Add a scan, and the ground under the robot, to the map; return the window of the pixels
        that may have changed, or None."""
        geometry = self._truth.geometry
        x, y = geometry.to_pixels(pose.x, pose.y)
        # The rays turn with the robot.
        angles = self._angles + (pose.yaw - geometry.origin.yaw)
        directions = np.column_stack((np.cos(angles), np.sin(angles)))
        truth, known = self._truth.cells, self._known
        scanner = Scanner(x, y, self._reach_px, self._free_at_most)
        seen = cast_rays(truth, known, scanner, directions)
        stood_on = reveal_disc(truth, known, x, y, self._hull_px)
        changed = Window.around(Window(*map(int, seen)), Window(*map(int, stood_on)))
        self._extent = Window.around(self._extent, changed)
        return changed

    def is_clear(self, start: Point, end: Point, margin_m: float = 0.0) -> bool:
        """Return whether the hull can move straight between two points [m], by the robot's own map.

        Unknown pixels are not clear. Checks are half a pixel, or SPACING_M, apart: an obstacle
        thinner than the padding may fit between two checks, and stop the robot. A margin around the
        hull [m] excludes such obstacles.
        """
        x0, y0 = self._geometry.to_pixels(*start)
        x1, y1 = self._geometry.to_pixels(*end)
        spacing = min(0.5, SPACING_M / self._geometry.resolution)
        steps = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / spacing))
        return all(
            disc_is_free(
                self._known,
                x0 + (x1 - x0) * step / steps,
                y0 + (y1 - y0) * step / steps,
                self._hull_px + margin_m / self._geometry.resolution,
                self._free_at_most,
            )
            for step in range(steps + 1)
        )

    def is_clear_at(self, point: Point) -> bool:
        """Return whether the hull fits at a point [m] of the robot's map; not on unknown pixels."""
        x, y = self._geometry.to_pixels(*point)
        return bool(disc_is_free(self._known, x, y, self._hull_px, self._free_at_most))

    def snapshot(self, stamp_ns: int) -> OccupancyGrid | None:
        """Return the robot's own map, cropped to its known part; None before anything is known.

        The crop is rounded outward to whole chunks, within the raster.
        """
        if self._extent is None:
            return None
        window = self._extent.in_chunks(self._chunk_px, *self._known.shape)
        geometry = self._geometry
        origin = Pose2D(*geometry.to_map(window.col0, window.row0), geometry.origin.yaw)
        cells = self._known[window.row0 : window.row1, window.col0 : window.col1].copy()
        placed = GridGeometry(window.rows, window.cols, geometry.resolution, origin)
        return OccupancyGrid(placed, cells, self._truth.frame, stamp_ns)
