"""Zones on the lattice: cells inside zones, and cells blocked by keep-out zones."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Window, polygon_bounds
from fasaco_edge.grid.lattice import BLOCKED, CoverageLattice
from fasaco_edge.grid.occupancy import OCCUPIED, OccupancyGrid
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.lattice.polygons import add_near, count_in, turn_inside
from fasaco_edge.mission.orders.order import Zone

# Tolerance [m]: rounding must not let a polygon along a cell's border touch the cell.
TOUCH_TOLERANCE_M = 1e-6


def in_zones(zones: tuple[Zone, ...], window: Window, cell_m: float) -> NDArray[np.bool_]:
    """Return which cells of ``window`` lie in one of the zones, bool (rows, cols), read-only."""
    if [zone for zone in zones if zone.holes or zone.without]:
        return _with_holes(zones, window, cell_m)
    if any(zone.polygon is None for zone in zones):
        return _everything(window)
    return _inside_any(tuple(zone.polygon for zone in zones if zone.polygon), window, cell_m)


@lru_cache(maxsize=4)
def _with_holes(zones: tuple[Zone, ...], window: Window, cell_m: float) -> NDArray[np.bool_]:
    cells = np.zeros((window.rows, window.cols), bool)
    for zone in zones:
        if zone.polygon:
            cells |= cells_of(zone.polygon, zone.holes, window, cell_m)
        elif zone.polygon is None:
            own = np.ones_like(cells)
            for room in zone.without:
                own &= ~cells_of(room.outline, room.holes, window, cell_m)
            cells |= own
    cells.flags.writeable = False
    return cells


def cells_of(
    outline: Polygon, holes: tuple[Polygon, ...], window: Window, cell_m: float
) -> NDArray[np.bool_]:
    """Return which cells of ``window`` lie in an outline, and in no hole, bool (rows, cols)."""
    found = _inside_any((outline,), window, cell_m)
    return found & ~_inside_any(holes, window, cell_m) if holes else found


def counts_in(
    polygons: tuple[Polygon, ...], window: Window, cell_m: float, cells: NDArray[np.bool_]
) -> list[int]:
    """Return how many of ``cells``, bool (rows, cols) of ``window``, lie in each polygon."""
    if not polygons:
        return []
    counts: list[int] = count_in(_planes(polygons, window, cell_m), np.packbits(cells)).tolist()
    return counts


@lru_cache(maxsize=2)
def kept_out(
    polygons: tuple[Polygon, ...], window: Window, cell_m: float, robot_radius_m: float
) -> NDArray[np.bool_]:
    """Return which cells of ``window`` the robot must keep out of, bool (rows, cols), read-only.

    These are the cells that a polygon touches, or in which the robot would touch one.
    """
    cells = near_polygons(polygons, window, cell_m, max(0.5 * cell_m, robot_radius_m))
    cells.flags.writeable = False
    return cells


def cells_inside(polygon: Polygon, window: Window, cell_m: float) -> NDArray[np.bool_]:
    """Return which cells of ``window`` have their centre inside, bool (rows, cols)."""
    cells = np.zeros((window.rows, window.cols), bool)
    _add_inside(polygon, window, cell_m, cells)
    return cells


def _add_inside(polygon: Polygon, window: Window, cell_m: float, cells: NDArray[np.bool_]) -> None:
    """Mark the cells with their centre inside, in place; the cost depends on the polygon's size."""
    x0, y0, x1, y1 = (value / cell_m for value in polygon_bounds(polygon))
    around = Window(math.floor(y0), math.floor(x0), math.ceil(y1), math.ceil(x1))
    if box := around.intersection(window):
        inside = np.zeros((box.rows, box.cols), bool)
        turn_inside(np.array(polygon, np.float64), box.row0, box.col0, cell_m, inside)
        cells[box.slices_in(window)] |= inside


def without(lattice: CoverageLattice, cells: NDArray[np.bool_]) -> CoverageLattice:
    """Return ``lattice`` with more cells, bool (rows, cols), blocked."""
    if not cells.any():
        return lattice
    states, steps = lattice.states.copy(), lattice.steps.copy()
    states[cells] = BLOCKED
    steps[cells] = 0
    steps[:, :-1][cells[:, 1:]] &= ~np.uint8(1 << EAST)
    steps[:, 1:][cells[:, :-1]] &= ~np.uint8(1 << WEST)
    steps[:-1][cells[1:]] &= ~np.uint8(1 << NORTH)
    steps[1:][cells[:-1]] &= ~np.uint8(1 << SOUTH)
    return CoverageLattice(lattice.window, lattice.cell_m, states, steps)


# The window seldom changes, and zones and passes query the same cells repeatedly.
@lru_cache(maxsize=1)
def _everything(window: Window) -> NDArray[np.bool_]:
    cells = np.ones((window.rows, window.cols), bool)
    cells.flags.writeable = False
    return cells


@lru_cache(maxsize=4)
def _inside_any(polygons: tuple[Polygon, ...], window: Window, cell_m: float) -> NDArray[np.bool_]:
    cells = np.zeros((window.rows, window.cols), bool)
    for polygon in polygons:
        _add_inside(polygon, window, cell_m, cells)
    cells.flags.writeable = False
    return cells


# One bit per cell, to bound the memory of 100 zones. One entry for zones, one for rooms.
@lru_cache(maxsize=2)
def _planes(polygons: tuple[Polygon, ...], window: Window, cell_m: float) -> NDArray[np.uint8]:
    return np.stack([np.packbits(cells_inside(polygon, window, cell_m)) for polygon in polygons])


def near_polygons(
    polygons: tuple[Polygon, ...], window: Window, cell_m: float, reach_m: float
) -> NDArray[np.bool_]:
    """Return which cells of ``window`` are near a polygon, bool (rows, cols).

    A cell is near if a polygon touches the square of half-width ``reach_m`` [m] around its centre,
    or contains it. If ``reach_m`` is at least half a cell, a disc of that radius can drive between
    the centres of the other cells without touching a polygon.
    """
    starts = np.zeros((window.rows, window.cols + 1), np.int32)
    inside = np.zeros((window.rows, window.cols), bool)
    for polygon in polygons:
        corners = np.array(polygon, np.float64)
        add_near(corners, window.row0, window.col0, cell_m, reach_m - TOUCH_TOLERANCE_M, starts)
        _add_inside(polygon, window, cell_m, inside)
    cells: NDArray[np.bool_] = np.cumsum(starts, axis=1, out=starts)[:, :-1] > 0
    cells |= inside
    return cells


def with_kept_out(grid: OccupancyGrid, keep_out: tuple[Polygon, ...]) -> OccupancyGrid:
    """Return a map on which the pixels with their centre in a keep-out zone are occupied.

    ``kept_out`` is stricter: it includes the cells where the robot would touch a zone.
    """
    if not keep_out:
        return grid
    cells, whole = grid.cells.copy(), Window(0, 0, *grid.cells.shape)
    inside = np.zeros(cells.shape, bool)
    for polygon in keep_out:
        corners = tuple(grid.geometry.to_pixels(x, y) for x, y in polygon)
        _add_inside(corners, whole, 1.0, inside)
    cells[inside] = OCCUPIED
    return OccupancyGrid(grid.geometry, cells, grid.frame, grid.stamp_ns)
