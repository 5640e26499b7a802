"""A scanner that takes some cells for the opposite of what they are, until it is near.

A free cell drawn for it has a speck in its middle that no robot gets past; an obstacle is
clear as far as a robot needs it to be. Which cells these are is drawn before the mission;
what is once seen from near by is never misread again.

What the robot sees of a building: its own map, and what of it is news.

As a mapper publishes it: the whole map where it has grown or is placed anew, else an update
of what changed. Localisation is perfect, but for a loop closure (``place_anew``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import BLOCKED, CoverageLattice
from fasaco_edge.grid.lattice import UNKNOWN as UNKNOWN_CELL
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, MapPatch, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, disc_is_free, reveal_disc
from fasaco_edge.mission.core.events import MapReceived, PatchReceived
from fasaco_edge.simulation.noisy_mapper import MapperNoise, NoisyMapper
from fasaco_edge.simulation.robot import SimulationConfig
from tests.benchmarks.online.buildings import Building

# What is nearer than this is seen as it is [m].
SURE_M = 1.0

Part = tuple[slice, slice]


class Misreading:
    """What a robot believes of a building's pixels.

    Attributes:
        far: the truth as far as it is in reach so far, int8 (rows, cols).
        near: the truth that was seen from near by, int8 (rows, cols).
    """

    def __init__(self, building: Building, share: float, seed: int) -> None:
        truth = building.truth.cells
        self.far, self.near = np.full_like(truth, UNKNOWN), np.full_like(truth, UNKNOWN)
        self._wrong = truth.copy()
        lattice, geometry = building.lattice, building.truth.geometry
        cell_px = building.footprint.cell_m / geometry.resolution
        lane_px = 0.5 * cell_px + building.footprint.robot_radius_m / geometry.resolution
        drawn = Generator(PCG64(seed)).random(lattice.states.shape) < share
        corner = (lattice.window.row0, lattice.window.col0)
        cells = np.argwhere(drawn & (lattice.states != UNKNOWN_CELL))
        centres = lattice.centres((cells + corner).astype(np.int32))
        for (row, col), centre in zip(cells.tolist(), centres.tolist(), strict=True):
            x, y = geometry.to_pixels(*centre)
            if lattice.states[row, col] == BLOCKED:
                self._wrong[_square(x, y, lane_px)] = FREE
            else:
                self._wrong[_square(x, y, 0.5)] = OCCUPIED

    def believed(self, part: Part) -> NDArray[np.int8]:
        """Return what the robot takes a part of the building for, int8."""
        near = self.near[part]
        far = np.where(self.far[part] == UNKNOWN, UNKNOWN, self._wrong[part])
        believed: NDArray[np.int8] = np.where(near == UNKNOWN, far, near).astype(np.int8)
        return believed


def _square(x: float, y: float, reach: float) -> Part:
    """Return the pixels within ``reach`` of a point in both directions."""
    return (
        slice(max(math.floor(y - reach), 0), max(math.ceil(y + reach), 0)),
        slice(max(math.floor(x - reach), 0), max(math.ceil(x + reach), 0)),
    )


# The published map grows by blocks of about this size [m].
CHUNK_M = 1.0
# What the robot's disc is wider than its hull [pixels]: it may touch a wall.
SLACK_PX = 0.02

# A point in the building's pixels: column, row, not rounded.
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Senses:
    """What the robot can see.

    Attributes:
        range_m: reach of its scanner, which looks all around [m].
        misread: share of the cells that it misreads from afar, see ``online_misreading``.
        seed: draws which cells these are, and the noise.
        noise: of its mapper, so many times that of a scan matcher; 0 for none.
    """

    range_m: float
    misread: float = 0.0
    seed: int = 0
    noise: float = 0.0


class Sight:
    """A scanner in a building, and the robot's own map.

    Attributes:
        truth: what is there, int8 (rows, cols) pixels; may be changed while a robot drives.
        geometry: where the pixels lie in the robot's map frame.
    """

    def __init__(self, building: Building, senses: Senses) -> None:
        self.truth = building.truth.cells.copy()
        self.geometry = building.truth.geometry
        self._frame = building.truth.frame
        self._footprint = building.footprint
        resolution = self.geometry.resolution
        self._hull_px = building.footprint.robot_radius_m / resolution - SLACK_PX
        self._known = np.full_like(self.truth, UNKNOWN)
        misread = senses.misread
        self._misreading = Misreading(building, misread, senses.seed) if misread else None
        self._reach_px = senses.range_m / resolution
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
        if self._misreading is None:
            changed = self._scan(self._known, at, self._reach_px)
        else:
            far = self._scan(self._misreading.far, at, self._reach_px)
            near = self._scan(self._misreading.near, at, SURE_M / self.geometry.resolution)
            changed = Window.around(far, near)
            if changed is not None:
                here = changed.slices_in(Window(0, 0, *self._known.shape))
                self._known[here] = self._misreading.believed(here)
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

    def place_anew(self, origin: Pose2D) -> None:
        """Move the map as a whole: its mapper found out that it lies elsewhere."""
        self.geometry = replace(self.geometry, origin=origin)
        self._sent, self._changed = None, self._changed or self._extent

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

    def true_lattice(self) -> CoverageLattice:
        """Return the lattice over the building as it is and where the map frame has it now."""
        grid = OccupancyGrid(self.geometry, self.truth.copy(), self._frame)
        return CoverageLattice.from_map(grid, self._footprint)

    def _scan(self, known: NDArray[np.int8], at: Point, reach_px: float) -> Window | None:
        scanner = Scanner(*at, reach_px, self._footprint.free_at_most)
        seen = cast_rays(self.truth, known, scanner, self._rays)
        stood_on = reveal_disc(self.truth, known, *at, self._hull_px)
        return Window.around(Window(*map(int, seen)), Window(*map(int, stood_on)))


class NoisySight(Sight):
    """A scanner in a building, and the robot's own map by the simulation's noisy mapper."""

    def __init__(self, building: Building, senses: Senses) -> None:
        super().__init__(building, senses)
        footprint = building.footprint
        config = SimulationConfig(
            range_m=senses.range_m,
            robot_radius_m=footprint.robot_radius_m,
            free_at_most=footprint.free_at_most,
        )
        noise = replace(MapperNoise().times(senses.noise), seed=senses.seed)
        self._mapper = NoisyMapper(building.truth, config, noise)
        # Walls are nearer than on its map, by as much as a pixel: a robot touches them.
        self._hull_px -= 1.0

    def pose_of(self, at: Point, yaw: float) -> Pose2D:
        """Return the pose that the mapper has."""
        return self._mapper.believed(super().pose_of(at, yaw))

    def point_of(self, x: float, y: float) -> Point:
        """Return where a place on the robot's map is in truth [pixels]."""
        return super().point_of(*self._mapper.true_place(x, y))

    def look(self, at: Point) -> None:
        """Take in a scan from ``at``, if the mapper does."""
        pose = Pose2D(*self.geometry.to_map(*at))
        self._changed = Window.around(self._changed, self._mapper.scan(pose))

    def news(self) -> MapReceived | PatchReceived | None:
        """Return what the mapper would publish now; None where there is nothing new."""
        grid = self._mapper.snapshot(0) if self._changed is not None else None
        self._changed = None
        return None if grid is None else MapReceived(grid)


def sight_of(building: Building, senses: Senses) -> Sight:
    """Return the sight of a robot in a building."""
    return NoisySight(building, senses) if senses.noise else Sight(building, senses)


def _rays(reach_px: float) -> NDArray[np.float64]:
    """Return the directions of a scan's rays, unit vectors, float64 (n, 2).

    Neighbouring ones are at most a pixel apart where they end, so that no pixel in sight is
    missed.
    """
    rays = max(math.ceil(2.0 * math.pi * reach_px), 4)
    angles = np.arange(rays) * (2.0 * math.pi / rays)
    return np.column_stack((np.cos(angles), np.sin(angles)))
