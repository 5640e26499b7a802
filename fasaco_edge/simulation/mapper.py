"""The simulated robot's scanner, and the map that it makes of the building while it drives."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, Window
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, disc_is_free, reveal_disc
from fasaco_edge.simulation.robot import SimulationConfig

# Spacing of the checks whether the hull has room along a straight line [m]: between two checks a
# corner may reach less than a millimetre into the hull.
SPACING_M = 0.025


def rays_for(reach_px: float) -> int:
    """Return how many rays a scan needs so that it misses no pixel in sight.

    Neighbouring rays are at most a pixel apart where they end: 440 rays for 3.5 m at
    5 cm, where the LDS-01's 360 would not do. A pixel whose centre is d <= reach away
    holds a disc of diameter 1, which is 2 asin(1 / 2d) >= 1 / reach wide in angle, so
    at least one ray crosses it.
    """
    return max(math.ceil(math.tau * reach_px), 4)


class Mapper:
    """A scanner in a ground-truth map, and the robot's own map beside it.

    Localisation is perfect: both maps share the frame and the pixel raster. The robot's own map is
    published as SLAM would: only as large as what is known, so its origin and its size change while
    the robot explores.
    """

    def __init__(self, truth: OccupancyGrid, config: SimulationConfig) -> None:
        resolution = truth.geometry.resolution
        self._truth = truth
        # Raster of the own map.
        self._geometry = truth.geometry
        self._known: NDArray[np.int8] = np.full(truth.cells.shape, UNKNOWN, np.int8)
        self._extent: Window | None = None
        self._hull_px = config.hull_radius_m / resolution
        self._reach_px = config.range_m / resolution
        self._free_at_most = config.free_at_most
        self._chunk_px = max(1, round(config.map_chunk_m / resolution))
        rays = rays_for(self._reach_px)
        self._angles = np.arange(rays) * (math.tau / rays)

    def believed(self, pose: Pose2D) -> Pose2D:
        """Return the estimated pose of a robot at ``pose``: the same, without any error."""
        return pose

    def true_place(self, x: float, y: float) -> Point:
        """Return the true position of a place on its map [m]: equal to it."""
        return x, y

    def scan(self, pose: Pose2D) -> Window | None:
        """Add a scan, and the ground under the robot, to the map; return the window of the pixels
        that may have changed, or None."""
        geometry = self._truth.geometry
        x, y = geometry.to_pixels(pose.x, pose.y)
        # The scanner turns with the robot, so that turning on the spot sees a little more.
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
        """Return whether the hull can move straight between two points [m], by the own map.

        Unknown is not clear. Checked every half pixel, and every SPACING_M: an obstacle that fits
        between two discs is thinner than the padding, but can stop the robot. A margin [m] around
        the hull excludes such obstacles.
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
        """Return whether the hull has room at a point [m], by the own map; unknown is no room."""
        x, y = self._geometry.to_pixels(*point)
        return bool(disc_is_free(self._known, x, y, self._hull_px, self._free_at_most))

    def snapshot(self, stamp_ns: int) -> OccupancyGrid | None:
        """Return the own map, cropped to its known part; None before anything is known.

        The crop is rounded outward to whole chunks, and ends where its raster ends.
        """
        if self._extent is None:
            return None
        window = self._extent.in_chunks(self._chunk_px, *self._known.shape)
        geometry = self._geometry
        origin = Pose2D(*geometry.to_map(window.col0, window.row0), geometry.origin.yaw)
        cells = self._known[window.row0 : window.row1, window.col0 : window.col1].copy()
        placed = GridGeometry(window.rows, window.cols, geometry.resolution, origin)
        return OccupancyGrid(placed, cells, self._truth.frame, stamp_ns)
