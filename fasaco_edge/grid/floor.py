"""Floor: where on a fine raster of a map a robot may be, and what its tool reaches from there.

The reachable floor is all that the tool's disc touches at places where the robot's disc can come
to from where it stands. The lattice over it has a cell wherever the robot has a place: it stands
at the one nearest to the cell's middle, and may go round a corner between two cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapTooLarge, StartBlocked, StartOutsideMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, CoverageLattice, lattice_window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.places import (
    choose_stands,
    connected,
    find_places,
    link_stands,
    within,
)
from fasaco_edge.kernels.lattice.footprint import Placement

# Pixels are divided until they are about so fine: what a tool leaves at a wall is a few of them.
FINE_M = 0.025
# The most fine pixels, int8 and int32 arrays of which are held.
MOST_PIXELS = 100_000_000


@dataclass(frozen=True, slots=True)
class RobotDiscs:
    """The robot and its tool, as discs around one point, and what counts as free.

    Attributes:
        radius_m: of the robot [m].
        tool_m: width of the tool [m].
        free_at_most: occupancy values up to this are free [percent].
    """

    radius_m: float
    tool_m: float
    free_at_most: int = 25


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """The floor that a robot reaches from one place.

    Attributes:
        geometry: of the fine raster, with a frame around the map.
        discs: robot and tool.
        blocked: int32 (rows, cols + 1): how many of a row's first pixels are not known free.
        places: bool (rows, cols): pixels at whose centre the robot may be, and can come to.
        reachable: bool (rows, cols): pixels whose centre the tool reaches from these.
        start: y, x of the place nearest to where the robot stands [pixels].
    """

    geometry: GridGeometry
    discs: RobotDiscs
    blocked: NDArray[np.int32]
    places: NDArray[np.bool_]
    reachable: NDArray[np.bool_]
    start: tuple[int, int]

    @classmethod
    def around(cls, grid: OccupancyGrid, discs: RobotDiscs, start: tuple[float, float]) -> Floor:
        """Return the floor that is reached from the place nearest to ``start``, x, y [m].

        Raises:
            StartOutsideMap: the start is not on the map.
            StartBlocked: the robot fits nowhere within its radius of the start.
            MapTooLarge: the fine raster would have more than ``MOST_PIXELS``.
        """
        geometry, free = _refined(grid, discs)
        blocked = np.zeros((geometry.rows, geometry.cols + 1), np.int32)
        np.cumsum(~free, axis=1, out=blocked[:, 1:])
        places = np.zeros(free.shape, np.bool_)
        radius = discs.radius_m / geometry.resolution
        find_places(blocked, radius, places)
        at = _nearest_place(geometry, places, start, radius)
        places = connected(places, *at)
        reachable = within(places, discs.tool_m / 2 / geometry.resolution)
        return cls(geometry, discs, blocked, places, reachable, at)

    @property
    def reachable_m2(self) -> float:
        """How much floor the tool reaches [m2]."""
        return int(np.count_nonzero(self.reachable)) * self.geometry.resolution**2

    def to_map(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points y, x [pixels], float64 (n, 2), as x, y [m] in the map frame."""
        origin, unit = self.geometry.origin, self.geometry.resolution
        u, v = (pixels[:, 1] + 0.5) * unit, (pixels[:, 0] + 0.5) * unit
        cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
        return np.stack([origin.x + cos * u - sin * v, origin.y + sin * u + cos * v], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class StandLattice:
    """A lattice in whose cells the robot stands where it can, not only in their middles.

    Attributes:
        lattice: its cells are coverable where they have a place.
        stands: float64 (rows, cols, 2): y, x of the place [pixels]; NaN where there is none.
        bends: float64 (rows, cols, 2, 2): y, x of the bend on the step to the east, and to the
            north [pixels]; NaN for a straight step.
    """

    lattice: CoverageLattice
    stands: NDArray[np.float64]
    bends: NDArray[np.float64]

    @classmethod
    def over(cls, floor: Floor, cell_m: float, max_cells: int = 4_000_000) -> StandLattice:
        """Return the lattice of cells ``cell_m`` wide [m] over a floor.

        Raises:
            MapTooLarge: it would have more than ``max_cells``.
            MapTooFar: it would reach too far from 0.
        """
        geometry = floor.geometry
        window = lattice_window(geometry, cell_m, max_cells)
        placement = _placement(geometry, cell_m, floor.discs.radius_m)
        shape = window.rows, window.cols
        stands = np.empty((*shape, 2))
        blocked, places = floor.blocked, floor.places
        distances = np.empty(shape)
        choose_stands(blocked, places, placement, window.row0, window.col0, stands, distances)
        steps = np.empty(shape, np.uint8)
        bends = np.empty((*shape, 2, 2))
        cell = cell_m / geometry.resolution
        link_stands(blocked, places, stands, cell, placement.radius, steps, bends)
        states = np.where(np.isnan(stands[..., 0]), BLOCKED, COVERABLE).astype(np.uint8)
        return cls(CoverageLattice(window, cell_m, states, steps), stands, bends)

    def start_cell(self, floor: Floor) -> tuple[int, int]:
        """Return the cell whose stand is nearest to where the robot is."""
        squares = ((self.stands - np.array(floor.start)) ** 2).sum(axis=2)
        row, col = divmod(int(np.nanargmin(squares)), squares.shape[1])
        return row + self.lattice.window.row0, col + self.lattice.window.col0

    def points(self, walk: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the line along a walk, cells (row, col), int32 (n, 2): float64 (m, 2), y, x.

        Where it goes straight on it has no points between.
        """
        window: Window = self.lattice.window
        cells = walk - np.array((window.row0, window.col0), np.int32)
        at = self.stands[cells[:, 0], cells[:, 1]]
        moves = np.diff(cells, axis=0)
        # A step's bend is kept at its western or southern cell.
        lower = np.minimum(cells[:-1], cells[1:])
        bends = self.bends[lower[:, 0], lower[:, 1], (moves[:, 0] != 0).astype(np.intp)]
        line = np.concatenate([np.stack([at[:-1], bends], axis=1).reshape(-1, 2), at[-1:]])
        return straightened(line[~np.isnan(line[:, 0])])


def straightened(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a line, float64 (n, 2), without points that repeat, or lie on the straight way."""
    line = line[np.concatenate([[True], (np.abs(np.diff(line, axis=0)) > 1e-9).any(axis=1)])]
    if len(line) < 3:
        return line
    before, behind = np.diff(line[:-1], axis=0), np.diff(line[1:], axis=0)
    across = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0]
    turns = (np.abs(across) > 1e-9) | ((before * behind).sum(axis=1) < 0.0)
    straight: NDArray[np.float64] = line[np.concatenate([[True], turns, [True]])]
    return straight


def _refined(grid: OccupancyGrid, discs: RobotDiscs) -> tuple[GridGeometry, NDArray[np.bool_]]:
    """Return a fine raster of a map with a frame around it, and which pixels are free."""
    coarse = grid.geometry
    parts = max(1, round(coarse.resolution / FINE_M))
    unit = coarse.resolution / parts
    frame = math.ceil(max(discs.tool_m / 2, discs.radius_m) / unit) + 2
    rows, cols = coarse.rows * parts + 2 * frame, coarse.cols * parts + 2 * frame
    if rows * cols > MOST_PIXELS:
        raise MapTooLarge(
            f"a raster of {rows} x {cols} pixels of {unit:g} m exceeds {MOST_PIXELS} pixels"
        )
    free = np.zeros((rows, cols), np.bool_)
    known = (grid.cells >= 0) & (grid.cells <= discs.free_at_most)
    inner = np.repeat(np.repeat(known, parts, axis=0), parts, axis=1)
    free[frame : rows - frame, frame : cols - frame] = inner
    x, y = coarse.to_map(-frame / parts, -frame / parts)
    return GridGeometry(rows, cols, unit, Pose2D(x, y, coarse.origin.yaw)), free


def _nearest_place(
    geometry: GridGeometry, places: NDArray[np.bool_], start: tuple[float, float], reach: float
) -> tuple[int, int]:
    col, row = geometry.to_pixels(*start)
    if not (0 <= row < geometry.rows and 0 <= col < geometry.cols):
        raise StartOutsideMap(f"the start ({start[0]:g}, {start[1]:g}) m is outside the map")
    found = np.argwhere(places)
    squares = ((found + 0.5 - np.array((row, col))) ** 2).sum(axis=1)
    if not len(found) or squares.min() > max(reach, 1.0) ** 2 + 1:
        raise StartBlocked(
            f"the robot does not fit at ({start[0]:g}, {start[1]:g}) m, nor within its radius of it"
        )
    i, j = found[np.argmin(squares)].tolist()
    return i, j


def _placement(geometry: GridGeometry, cell_m: float, radius_m: float) -> Placement:
    """Return where the lattice's cells lie, seen from the centre of the raster's first pixel."""
    unit, yaw = geometry.resolution, geometry.origin.yaw
    x0, y0 = geometry.to_pixels(0.0, 0.0)
    scale = cell_m / unit
    ux, uy = scale * math.cos(yaw), -scale * math.sin(yaw)
    return Placement(x0 - 0.5, y0 - 0.5, ux, uy if abs(uy) > 1e-9 * scale else 0.0, radius_m / unit)
