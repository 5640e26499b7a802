"""The grids that planners run on, by name or file; where a walk or a simulated robot starts."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fasaco_edge.errors import MapFileError, NothingToCover, StartBlocked
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map, suggested_start
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.lattice.reach import reachable_from


def start_cell(lattice: CoverageLattice, map_file: Path) -> Cell:
    """Return the start of a plan for which none is given.

    A built-in map names its own; else it is the cell nearest to the map frame's
    origin within the largest connected area.

    Raises:
        NothingToCover: no cell is coverable.
        StartBlocked: a built-in map's own start is not on the lattice.
    """
    suggested = suggested_start(map_file)
    if suggested is not None:
        cell = lattice.cell_at(*suggested)
        if not lattice.contains(cell):
            raise StartBlocked(f"the map's suggested start {suggested} m is outside the lattice")
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
        raise NothingToCover("no cell of the map is coverable")
    window = lattice.window
    cells = np.argwhere(largest) + np.array((window.row0, window.col0))
    row, col = cells[np.argmin(((cells + 0.5) ** 2).sum(axis=1))]
    return int(row), int(col)


def start_point(map_file: Path, truth: OccupancyGrid, radius_m: float) -> tuple[float, float]:
    """Return a built-in map's start (x, y) [m], and the map frame's origin for any other map.

    Where that is not on the map, as in UTM, it is the place in the largest area nearest to it.

    Raises:
        NothingToCover: a robot of this radius [m] fits nowhere.
    """
    suggested = suggested_start(map_file)
    if suggested is not None:
        return suggested
    col, row = truth.geometry.to_pixels(0.0, 0.0)
    if 0 <= col < truth.geometry.cols and 0 <= row < truth.geometry.rows:
        return 0.0, 0.0
    lattice = CoverageLattice.from_map(truth, Footprint(2.0 * radius_m, radius_m))
    row, col = start_cell(lattice, map_file)
    return (col + 0.5) * lattice.cell_m, (row + 0.5) * lattice.cell_m


# Of the robot the built-in maps were drawn for.
MAP_FOOTPRINT = Footprint(cell_m=0.3, robot_radius_m=0.18)


@dataclass(frozen=True, slots=True)
class NamedGrid:
    """A lattice with the cell to start in, and the name or file it was asked for by."""

    name: str
    lattice: CoverageLattice
    start: Cell


def read_grid(name_or_path: str | Path) -> NamedGrid:
    """Read a coverage grid (.npy), a map_server YAML or a built-in map by its name.

    Beside ``grid.npy`` a file ``grid.json`` may name the start: ``{"start": [row, col]}``.
    Maps become lattices of 0.3 m for a robot of 0.18 m radius.

    Raises:
        MapFileError: there is no such file, or it is none of these.
        NothingToCover: the grid has no free cell.
    """
    file = find_map(name_or_path)
    if file.suffix == ".npy":
        lattice = CoverageLattice.from_free(read_coverage_grid(file))
    else:
        lattice = CoverageLattice.from_map(read_map(file), MAP_FOOTPRINT)
    start = _start_beside(file.with_suffix(".json")) if file.suffix == ".npy" else None
    return NamedGrid(str(name_or_path), lattice, start or start_cell(lattice, file))


def _start_beside(file: Path) -> Cell | None:
    if not file.is_file():
        return None
    try:
        row, col = json.loads(file.read_text(encoding="utf-8"))["start"]
        return int(row), int(col)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MapFileError(f"{file}: expected an object with start: [row, col]") from error
