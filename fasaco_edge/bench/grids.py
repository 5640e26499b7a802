"""The grids that planners are measured on."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map
from fasaco_edge.planners.start import start_cell

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
