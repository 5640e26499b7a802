"""Where a walk starts when nobody says."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fasaco_edge.errors import NothingToCover, StartBlocked
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.map_files import suggested_start
from fasaco_edge.kernels.lattice.reach import reachable_from


def start_cell(lattice: CoverageLattice, map_file: Path) -> Cell:
    """Return the start of a plan nobody gave a start for.

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
