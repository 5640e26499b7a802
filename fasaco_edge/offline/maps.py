"""Input maps of plans: a map_server file, a built-in map, or a coverage grid of True and False."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.grid.map_files import (
    GRID_HINT,
    find_map,
    read_bare_image,
    read_coverage_grid,
    read_map,
)
from fasaco_edge.grid.occupancy import FREE, UNKNOWN, OccupancyGrid
from fasaco_edge.planners.grids import start_cell
from fasaco_edge.text import shown


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Map:
    """Input map of a plan.

    Attributes:
        name: file name, or the name given to the array.
        grid: the occupancy grid; None for a coverage grid.
        free: bool (rows, cols), True = coverable, row 0 first; None for an occupancy grid.
        file: source file; None for an array.
    """

    name: str
    grid: OccupancyGrid | None = None
    free: NDArray[np.bool_] | None = None
    file: Path | None = None

    def __repr__(self) -> str:
        """Return the map in one line, without its pixels."""
        if self.grid is not None:
            rows, cols = self.grid.cells.shape
            return f"<Map {self.name}: {rows} x {cols} pixels of {self.grid.geometry.resolution} m>"
        assert self.free is not None
        rows, cols = self.free.shape
        return f"<Map {self.name}: {rows} x {cols} cells>"

    def lattice(self, robot: RobotConfig) -> CoverageLattice:
        """Return the lattice of cells as wide as the robot's tool.

        Raises:
            MapTooLarge, MapTooFar: it has too many cells, or reaches too far from the origin.
        """
        if self.grid is not None:
            footprint = Footprint(robot.tool_width_m, robot.radius_m)
            return CoverageLattice.from_map(self.grid, footprint)
        assert self.free is not None
        return CoverageLattice.from_free(self.free, robot.tool_width_m)

    def start(self, lattice: CoverageLattice) -> Cell:
        """Return the default start, see ``planners.grids.start_cell``."""
        return start_cell(lattice, self.file or Path(self.name), self.grid)


def load_map(
    source: str | Path | NDArray[np.bool_],
    *,
    resolution_m: float | None = None,
    unknown_free: bool = False,
) -> Map:
    """Return a map.

    Args:
        source: a map_server YAML file, the name of a built-in map (``fasaco-edge maps``), an image
            without a YAML file, or a coverage grid: a .npy file or an array, bool (rows, cols),
            True = coverable.
        resolution_m: edge of a pixel of an image without a YAML file [m]; None otherwise.
        unknown_free: whether unknown pixels count as free.

    Raises:
        MapFileError: ``source`` is none of these or cannot be read; or an option does not apply.
    """
    if isinstance(source, np.ndarray):
        _without_pixels("the array", resolution_m, unknown_free)
        if source.dtype != np.bool_ or source.ndim != 2 or not source.size:
            raise MapFileError(
                f"a coverage grid is bool (rows, cols), got {source.dtype} {source.shape}",
                hint=GRID_HINT,
            )
        free = source.copy()
        free.setflags(write=False)
        return Map("array", free=free)
    if not isinstance(source, str | Path):
        raise MapFileError(
            f"a map is a file, the name of a built-in map or a NumPy array, got {shown(source)}",
            hint="give a str, a Path or a bool array (rows, cols)",
        )
    file = find_map(source)
    if file.suffix == ".npy":
        _without_pixels(str(file), resolution_m, unknown_free)
        return Map(file.name, free=read_coverage_grid(file), file=file)
    grid = read_map(file) if resolution_m is None else read_bare_image(file, resolution_m)
    if unknown_free:
        grid = replace(grid, cells=np.where(grid.cells == UNKNOWN, FREE, grid.cells))
    return Map(file.name, grid, file=file)


def _without_pixels(name: str, resolution_m: float | None, unknown_free: bool) -> None:
    """Raise MapFileError if an option for pixels is given with a coverage grid."""
    if resolution_m is not None or unknown_free:
        option = "--unknown-free" if resolution_m is None else "--resolution"
        raise MapFileError(
            f"{name}: {option} is for maps of pixels; a coverage grid has cells, free or not",
            hint=f"leave {option} out; --cell is the width of a cell",
        )
