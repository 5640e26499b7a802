"""Coverage lattice: the planning grid, anchored to the map frame.

Cells are as wide as the tool. Cell (row, col) is the square ``[col * cell_m, (col + 1) * cell_m) x
[row * cell_m, (row + 1) * cell_m)`` of the map frame, independent of origin, size and yaw of the
map message, so that a cell keeps its index during the whole mission. Indices may be negative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapTooFar, MapTooLarge
from fasaco_edge.grid.geometry import (
    FARTHEST_M,
    MAX_LATTICE_CELLS,
    MOST_INDEX,
    GridGeometry,
    Raster,
    Window,
)
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels import BLOCKED, COVERABLE, EAST, NORTH, SOUTH, UNKNOWN, WEST
from fasaco_edge.kernels.lattice.classification import Cells, classify_cells
from fasaco_edge.kernels.lattice.footprint import Pixels, Placement, Thresholds, reach_of

__all__ = ["BLOCKED", "COVERABLE", "UNKNOWN", "Cell", "CoverageLattice", "Footprint"]

Cell = tuple[int, int]

# A map that extends into a cell by less than this does so by rounding [cells].
ROUNDING = 1e-6

# Limit on the pixels that robot and tool may span. With more, the tables of
# ``kernels.lattice.classification`` take more memory than the map.
MOST_REACH_PX = 400

# Tolerance for float32 rounding of resolutions: a robot exactly as wide as a corridor fits.
TOUCH_TOLERANCE_PX = 1e-3


@dataclass(frozen=True, slots=True)
class Footprint:
    """Tool, robot and thresholds of a lattice.

    Attributes:
        cell_m: edge of a lattice cell, the width of the tool [m].
        robot_radius_m: radius of the robot's disc [m].
        free_at_most: largest occupancy of free pixels [percent].
        occupied_at_least: least occupancy of occupied pixels [percent]; values between the two
            count as unknown.
    """

    cell_m: float
    robot_radius_m: float
    free_at_most: int = 25
    occupied_at_least: int = 65

    @property
    def thresholds(self) -> Thresholds:
        """Thresholds of free and occupied."""
        return Thresholds(self.free_at_most, self.occupied_at_least)


@dataclass(frozen=True, slots=True, eq=False)
class CoverageLattice:
    """Coverable cells, and the steps between them.

    Attributes:
        window: window of the unbounded lattice that the arrays span.
        cell_m: edge of a cell [m].
        states: uint8 (rows, cols), read-only: UNKNOWN, BLOCKED or COVERABLE. A cell
            is coverable if the robot's disc fits at its centre and all it covers is
            known free.
        steps: uint8 (rows, cols), read-only: bit ``1 << direction`` where the robot
            can drive to the neighbour in that direction; only between coverable cells.
    """

    window: Window
    cell_m: float
    states: NDArray[np.uint8]
    steps: NDArray[np.uint8]

    def __post_init__(self) -> None:
        for array in (self.states, self.steps):
            array.flags.writeable = False

    @classmethod
    def from_map(
        cls, grid: OccupancyGrid, footprint: Footprint, max_cells: int = MAX_LATTICE_CELLS
    ) -> CoverageLattice:
        """Return the lattice over all of ``grid``.

        Raises:
            MapTooLarge: it would have more than ``max_cells`` cells, or the pixels are too small.
            MapTooFar: it would reach too far from the origin, see ``lattice_window``.
        """
        window = lattice_window(grid.geometry, footprint.cell_m, max_cells)
        placement = placement_of(grid.geometry, footprint)
        shape = window.rows, window.cols
        states, steps = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
        cells = Cells(states, steps, np.ones(shape, np.bool_), window.row0, window.col0)
        classify_cells(pixels_of(grid), placement, footprint.thresholds, cells)
        return cls(window, footprint.cell_m, states, steps)

    @classmethod
    def from_free(cls, free: NDArray[np.bool_], cell_m: float = 1.0) -> CoverageLattice:
        """Return a lattice from a coverage grid, bool (rows, cols), True = coverable."""
        rows, cols = free.shape
        steps = np.zeros((rows, cols), np.uint8)
        east, north = free[:, :-1] & free[:, 1:], free[:-1] & free[1:]
        steps[:, :-1] |= east.astype(np.uint8) << EAST
        steps[:, 1:] |= east.astype(np.uint8) << WEST
        steps[:-1] |= north.astype(np.uint8) << NORTH
        steps[1:] |= north.astype(np.uint8) << SOUTH
        states = np.where(free, COVERABLE, BLOCKED).astype(np.uint8)
        return cls(Window(0, 0, rows, cols), cell_m, states, steps)

    @property
    def coverable(self) -> NDArray[np.bool_]:
        """Which cells are coverable, bool (rows, cols)."""
        mask: NDArray[np.bool_] = self.states == COVERABLE
        return mask

    def contains(self, cell: Cell) -> bool:
        """Return whether the arrays span ``cell``."""
        row, col = cell
        window = self.window
        return window.row0 <= row < window.row1 and window.col0 <= col < window.col1

    def is_coverable(self, cell: Cell) -> bool:
        """Return whether ``cell`` is coverable."""
        return self.contains(cell) and bool(self.states[self.local(cell)] == COVERABLE)

    def local(self, cell: Cell) -> Cell:
        """Return the index of ``cell`` in the arrays."""
        return cell[0] - self.window.row0, cell[1] - self.window.col0

    def cell_at(self, x: float, y: float) -> Cell:
        """Return the cell that contains the point (x, y) [m], inside the arrays or not."""
        return math.floor(y / self.cell_m), math.floor(x / self.cell_m)

    def centres(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the centres (x, y) [m], float64 (n, 2), of cells (row, col), (n, 2)."""
        return (cells[:, ::-1].astype(np.float64) + 0.5) * self.cell_m


def lattice_window(geometry: GridGeometry, cell_m: float, max_cells: int) -> Window:
    """Return the window of the unbounded lattice, cells ``cell_m`` [m] wide, that a map spans.

    Cells have int32 indices, and lie within ``FARTHEST_M`` of the origin.

    Raises:
        MapTooLarge: it has more than ``max_cells`` cells.
        MapTooFar: it reaches too far from the origin.
    """
    x0, y0, x1, y1 = geometry.bounds()
    rows, cols = (y1 - y0) / cell_m + 2, (x1 - x0) / cell_m + 2
    # A negated comparison, so that NaN is caught too.
    if not rows * cols <= max_cells:
        raise MapTooLarge(
            f"a lattice of {rows:.6g} x {cols:.6g} cells of {cell_m} m over a map of "
            f"{x1 - x0:.0f} x {y1 - y0:.0f} m exceeds {max_cells} cells",
            hint="check the map's resolution; larger cells or map.max_lattice_cells may help",
        )
    x0, y0, x1, y1 = geometry.snapped().bounds()
    window = Window(
        math.floor(y0 / cell_m + ROUNDING),
        math.floor(x0 / cell_m + ROUNDING),
        math.ceil(y1 / cell_m - ROUNDING),
        math.ceil(x1 / cell_m - ROUNDING),
    )
    farthest = min(FARTHEST_M, MOST_INDEX * cell_m)
    edges = [index * cell_m for index in (window.col0, window.row0, window.col1, window.row1)]
    if max(abs(edge) for edge in edges) > farthest:
        west, south, east, north = edges
        raise MapTooFar(
            f"a lattice from ({west:.2f}, {south:.2f}) to ({east:.2f}, {north:.2f}) m, of cells of "
            f"{cell_m} m, reaches beyond {farthest:.0f} m from 0"
        )
    return window


def mask_of(cells: Iterable[Cell], window: Window) -> NDArray[np.bool_]:
    """Return which cells of a window are among ``cells``, bool (rows, cols)."""
    found = np.zeros((window.rows, window.cols), np.bool_)
    for row, col in cells:
        if window.row0 <= row < window.row1 and window.col0 <= col < window.col1:
            found[row - window.row0, col - window.col0] = True
    return found


def beside(cells: NDArray[np.bool_], *, beyond: bool = False) -> NDArray[np.bool_]:
    """Return which cells share an edge with a marked cell, bool (rows, cols).

    ``beyond``: whether cells beyond the border count as marked.
    """
    around = np.pad(cells, 1, constant_values=beyond)
    found: NDArray[np.bool_] = around[:-2, 1:-1] | around[2:, 1:-1]
    found |= around[1:-1, :-2]
    found |= around[1:-1, 2:]
    return found


def pixels_of(grid: OccupancyGrid) -> Pixels:
    """Return a map as a window of its raster, in the memory layout of the kernels."""
    cells = np.ascontiguousarray(grid.cells)
    cells.flags.writeable = False
    _, shown = grid.geometry.on_raster()
    return Pixels(cells, shown.row0, shown.col0)


def placement_of(geometry: GridGeometry, footprint: Footprint) -> Placement:
    """Return the placement of the lattice's cells, and of a robot, on a map's raster.

    Raises:
        MapTooLarge: the pixels are too small for a robot of this size.
    """
    raster, _ = geometry.on_raster()
    placement = placement_on(raster, footprint.cell_m, footprint.robot_radius_m)
    reach = reach_of(placement)
    # A negated comparison, so that NaN is caught too.
    if not reach <= MOST_REACH_PX:
        finest = geometry.resolution * reach / MOST_REACH_PX
        raise MapTooLarge(
            f"a map of pixels of {geometry.resolution:g} m: tool and robot reach over {reach:.0f} "
            f"of them, more than {MOST_REACH_PX}; they must be {1.01 * finest:.2g} m or larger",
            hint="check the map's resolution; save or publish the map with larger pixels",
        )
    return placement


def placement_on(raster: Raster, cell_m: float, robot_radius_m: float = 0.0) -> Placement:
    """Return the placement of the lattice's cells, ``cell_m`` [m] wide, on a raster."""
    scale = cell_m / raster.resolution
    # The lattice's x axis, seen from the raster, is rotated by -yaw.
    ux, uy = scale * math.cos(raster.yaw), -scale * math.sin(raster.yaw)
    radius = robot_radius_m / raster.resolution - TOUCH_TOLERANCE_PX
    return Placement(-raster.right, -raster.up, ux, uy, max(radius, TOUCH_TOLERANCE_PX))
