"""Grids for planners, by name or file; start cells of walks and of simulated robots."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fasaco_edge.errors import MapFileError, NothingToCover, StartBlocked
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map, suggested_start
from fasaco_edge.grid.occupancy import FREE, UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.text import percent


def start_cell(lattice: CoverageLattice, map_file: Path, grid: OccupancyGrid | None = None) -> Cell:
    """Return the default start of a plan.

    A built-in map has its own start; otherwise it is in the largest connected area, at the cell
    nearest to the map frame's origin. ``grid``: the map of the lattice; None for a coverage grid.

    Raises:
        NothingToCover: no cell is coverable, because of the map or of the robot.
        StartBlocked: a built-in map's own start is not on the lattice.
    """
    suggested = suggested_start(map_file)
    if suggested is not None:
        cell = lattice.cell_at(*suggested)
        if not lattice.contains(cell):
            raise StartBlocked(
                f"the map's suggested start {suggested} m is outside the lattice",
                hint="choose a start, or smaller cells",
            )
        return cell
    left = lattice.coverable
    largest = np.zeros_like(left)
    while np.count_nonzero(left) > np.count_nonzero(largest):
        row, col = np.argwhere(left)[0]
        area = reachable_from(lattice.steps, int(row), int(col)).astype(bool)
        left &= ~area
        if np.count_nonzero(area) > np.count_nonzero(largest):
            largest = area
    if not largest.any():
        raise _nowhere(grid)
    window = lattice.window
    cells = np.argwhere(largest) + np.array((window.row0, window.col0))
    row, col = cells[np.argmin(((cells + 0.5) ** 2).sum(axis=1))]
    return int(row), int(col)


def _nowhere(grid: OccupancyGrid | None) -> NothingToCover:
    """Return the error for a lattice without a coverable cell."""
    if grid is None:
        return NothingToCover(
            "no cell of the map is coverable", hint="give a grid with True in the free cells"
        )
    cells = grid.cells
    free = np.count_nonzero((cells >= FREE) & (cells <= MAP_FOOTPRINT.free_at_most)) / cells.size
    if free:
        return NothingToCover(
            f"no cell of the map is coverable: {100 * free:.2g} % of its pixels are free, but "
            "the robot fits nowhere",
            hint="check cell size and robot radius against the map, and resolution and negate of "
            "its YAML file",
        )
    unknown = np.count_nonzero(cells == UNKNOWN) / cells.size
    return NothingToCover(
        f"no pixel of the map is free, {percent(unknown, 0)} are unknown",
        hint="check image, negate, mode and free_thresh of the map's YAML file: free pixels are "
        "white" + ("; `plan --unknown-free` takes unknown pixels for free" if unknown else ""),
    )


def start_point(map_file: Path, truth: OccupancyGrid, radius_m: float) -> tuple[float, float]:
    """Return a built-in map's start (x, y) [m], or the map frame's origin for any other map.

    If the robot does not fit there, as in a corner of the building, or if the origin is not on the
    map, as in UTM, the nearest place in the largest area is returned.

    Raises:
        NothingToCover: a robot of this radius [m] fits nowhere.
    """
    suggested = suggested_start(map_file)
    if suggested is not None:
        return suggested
    if _is_free_around(truth, (0.0, 0.0), radius_m):
        return 0.0, 0.0
    lattice = CoverageLattice.from_map(truth, Footprint(2.0 * radius_m, radius_m))
    row, col = start_cell(lattice, map_file, truth)
    return (col + 0.5) * lattice.cell_m, (row + 0.5) * lattice.cell_m


def _is_free_around(grid: OccupancyGrid, point: tuple[float, float], radius_m: float) -> bool:
    """Return whether all pixels within a radius, of one pixel at least, are free."""
    geometry = grid.geometry
    col, row = geometry.to_pixels(*point)
    if not (0 <= col < geometry.cols and 0 <= row < geometry.rows):
        return False
    radius = max(radius_m / geometry.resolution, 1.0)
    row0, col0 = max(math.floor(row - radius), 0), max(math.floor(col - radius), 0)
    part = grid.cells[row0 : math.ceil(row + radius) + 1, col0 : math.ceil(col + radius) + 1]
    rows, cols = np.ogrid[: part.shape[0], : part.shape[1]]
    around = part[np.hypot(rows + row0 + 0.5 - row, cols + col0 + 0.5 - col) <= radius]
    return bool(((around >= FREE) & (around <= MAP_FOOTPRINT.free_at_most)).all())


# Footprint of the robot that the built-in maps were drawn for.
MAP_FOOTPRINT = Footprint(cell_m=0.3, robot_radius_m=0.18)


@dataclass(frozen=True, slots=True)
class NamedGrid:
    """A lattice, its start cell, and the requested name or file."""

    name: str
    lattice: CoverageLattice
    start: Cell


def read_grid(name_or_path: str | Path) -> NamedGrid:
    """Read a coverage grid (.npy), a map_server YAML or a built-in map.

    Beside ``grid.npy`` a file ``grid.json`` may give the start: ``{"start": [row, col]}``. Maps
    become lattices of 0.3 m for a robot of 0.18 m radius.

    Raises:
        MapFileError: the file is missing, or has another format.
        NothingToCover: the grid has no free cell.
    """
    file, grid = find_map(name_or_path), None
    if file.suffix == ".npy":
        lattice = CoverageLattice.from_free(read_coverage_grid(file))
    else:
        grid = read_map(file)
        lattice = CoverageLattice.from_map(grid, MAP_FOOTPRINT)
    start = _start_beside(file.with_suffix(".json")) if file.suffix == ".npy" else None
    return NamedGrid(str(name_or_path), lattice, start or start_cell(lattice, file, grid))


def _start_beside(file: Path) -> Cell | None:
    if not file.is_file():
        return None
    try:
        row, col = json.loads(file.read_text(encoding="utf-8"))["start"]
        return int(row), int(col)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MapFileError(
            f"{file}: expected an object with start: [row, col]",
            hint='write {"start": [0, 0]} with a free cell, or remove the file',
        ) from error
