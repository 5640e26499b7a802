"""Where a robot starts when nobody says."""

from __future__ import annotations

from pathlib import Path

from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import suggested_start
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.start import start_cell


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
