"""Buildings for missions without a map: the true map, its lattice, and starts.

Missions need pixels. Each cell of a coverage grid becomes 2 x 2 pixels, and the robot is a little
narrower than a cell, so that the lattice over the pixels equals the coverage grid.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid
from fasaco_edge.planners.grids import MAP_FOOTPRINT, NamedGrid, read_grid
from tests.benchmarks.buildings import building
from tests.benchmarks.harness import check_names, grid_name
from tests.benchmarks.judge import reachable

PIXELS_PER_CELL = 2
# Of a cell's width. The disc stays within the cell's own pixels.
RADIUS_SHARE = 0.45


@dataclass(frozen=True, slots=True, eq=False)
class Building:
    """A building that a mission is to find out about.

    Attributes:
        name: what it is called in results.
        truth: what is there, in pixels. What is not free, unknown too, is an obstacle.
        footprint: of the robot.
        lattice: the lattice over all of it.
        start: the cell (row, col) the robot starts in.
    """

    name: str
    truth: OccupancyGrid
    footprint: Footprint
    lattice: CoverageLattice
    start: Cell

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Cells that a robot can come to from the start, bool (rows, cols) of the lattice."""
        return reachable(self.lattice.steps, self.lattice.local(self.start))

    def started_at(self, number: int) -> Building:
        """Return the building with its own start (0), or with one drawn for each other number."""
        if number == 0:
            return self
        window = self.lattice.window
        cells = np.argwhere(self.reachable) + np.array((window.row0, window.col0))
        row, col = Generator(PCG64((number, len(cells)))).choice(cells).tolist()
        return replace(self, start=(row, col))


@dataclass(frozen=True, slots=True)
class BuildingChoice:
    """Which buildings to send robots into.

    Attributes:
        grids: names or files of maps and coverage grids.
        generated: number of synthetic buildings, of ``cells`` cells each.
    """

    grids: tuple[str, ...]
    generated: int
    cells: int

    def buildings(self) -> Iterator[Building]:
        """Yield them.

        Raises:
            FasacoError: a file cannot be read, or has no free cell; two have one name.
        """
        check_names(self.grids)
        for name in self.grids:
            yield _read_building(name)
        for seed in range(self.generated):
            yield of_grid(building(self.cells, seed), MAP_FOOTPRINT.cell_m)


def of_grid(grid: NamedGrid, cell_m: float, pixels_per_cell: int = PIXELS_PER_CELL) -> Building:
    """Return a coverage grid of cells of ``cell_m`` [m] as a building of pixels."""
    free = grid.lattice.coverable
    pixels = np.where(free, FREE, OCCUPIED).astype(np.int8)
    pixels = pixels.repeat(pixels_per_cell, axis=0).repeat(pixels_per_cell, axis=1)
    rows, cols = pixels.shape
    geometry = GridGeometry(rows, cols, cell_m / pixels_per_cell, Pose2D(0.0, 0.0))
    return Building(
        name=grid_name(grid.name),
        truth=OccupancyGrid(geometry, pixels),
        footprint=Footprint(cell_m, RADIUS_SHARE * cell_m),
        lattice=CoverageLattice.from_free(free, cell_m),
        start=grid.start,
    )


def _read_building(name: str) -> Building:
    file = find_map(name)
    grid = read_grid(name)
    if file.suffix == ".npy":
        return of_grid(grid, _cell_beside(file.with_suffix(".json")))
    return Building(grid_name(name), read_map(file), MAP_FOOTPRINT, grid.lattice, grid.start)


def _cell_beside(file: Path) -> float:
    """Return ``cell_m`` of the file beside a coverage grid, or that of the maps."""
    if not file.is_file():
        return MAP_FOOTPRINT.cell_m
    try:
        cell_m = float(json.loads(file.read_text(encoding="utf-8")).get("cell_m", 0.3))
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise MapFileError(f"{file}: expected an object, cell_m a number") from error
    if not 0.01 <= cell_m <= 100.0:
        raise MapFileError(f"{file}: cell_m must be in 0.01..100 m, got {cell_m}")
    return cell_m
