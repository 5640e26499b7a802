"""The ground of a plan: cells to walk over, and the floor that a line along the walk sweeps.

A line is float64 (n, 2), n >= 1: points (x, y) [m] in the map frame, to be driven straight from
one to the next: the centres of a walk's cells, or a line over the floor that they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import EndBlocked, MapTooFar, MapTooLarge
from fasaco_edge.grid.fine_raster import RobotDiscs, map_to_raster
from fasaco_edge.grid.floor import Floor, StandLattice
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.turning import turned_geometry
from fasaco_edge.grid.walls import wall_direction
from fasaco_edge.offline.settings import AXES, HOME, WALLS
from fasaco_edge.planners.line import LINES, line_over

Line = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What a walk is planned on.

    Attributes:
        lattice: its cells.
        grid: the map; None for a coverage grid.
        start: the cell (row, col) it begins in.
        floor, stands: where the robot stands in the cells; None for their centres.
        lattice_deg: the angle of the cells' rows to the x axis of the map frame [deg].
    """

    lattice: CoverageLattice
    grid: OccupancyGrid | None
    start: Cell
    floor: Floor | None = None
    stands: StandLattice | None = None
    lattice_deg: float = 0.0

    @classmethod
    def of_floor(
        cls,
        grid: OccupancyGrid,
        robot: RobotConfig,
        start_xy: tuple[float, float],
        align: str | float,
    ) -> Ground:
        """Return the ground of a line over the floor that is reached from a point.

        Args:
            grid: the map.
            robot: its size, and the overlap of its lanes.
            start_xy: where it stands [m].
            align: what the rows of cells lie along: walls, axes, or an angle [deg].

        Raises:
            StartOutsideMap, StartBlocked: the robot cannot stand there.
            MapTooLarge, MapTooFar: see ``Floor.around``, ``StandLattice.over``.
        """

        floor = Floor.around(grid, RobotDiscs(robot.radius_m, robot.tool_width_m), start_xy)
        cell_m = robot.tool_width_m * (1.0 - robot.overlap)
        lattice_deg = _lattice_deg(align, grid)
        try:
            stands = _stands(floor, cell_m, lattice_deg)
        except (MapTooFar, MapTooLarge):
            # Askew, a lattice spans up to twice the cells, and may lie farther from 0.
            if align != WALLS or not lattice_deg:
                raise
            lattice_deg = 0.0
            stands = _stands(floor, cell_m, lattice_deg)
        return cls(stands.lattice, grid, stands.start_cell(floor), floor, stands, lattice_deg)

    def end(self, end: str | Cell, tool_m: float) -> Cell | None:
        """Return the cell to end in, None for anywhere.

        Args:
            end: ANYWHERE, HOME, or a cell as wide as the tool along the axes of the map frame.
            tool_m: width of the tool [m].

        Raises:
            EndBlocked: the robot has no place in the cell that is asked for.
        """
        if isinstance(end, str):
            return self.start if end == HOME else None
        if self.floor is None or self.stands is None:
            return end

        middle = ((index + 0.5) * tool_m for index in reversed(end))
        place = np.array(map_to_raster(self.floor.geometry, *middle))
        away = np.hypot(*np.moveaxis(self.stands.stands - place, 2, 0))
        row, col = divmod(int(np.nanargmin(away)), away.shape[1])
        if away[row, col] * self.floor.geometry.resolution > tool_m:
            raise EndBlocked(f"end cell {end} is out of reach, or the robot does not fit there")
        window = self.stands.lattice.window
        return row + window.row0, col + window.col0

    def line(self, walk: NDArray[np.int32], name: str, robot: RobotConfig, *, ends: bool) -> Line:
        """Return the line along a walk.

        Args:
            walk: int32 (n, 2), n >= 1.
            name: CELLS, or of ``planners.line.LINES``.
            robot: how it drives and turns.
            ends: whether it has to end where the walk does.
        """

        if self.floor is None or self.stands is None:
            return line_through(self.lattice, walk)
        config = replace(LINES[name], speed_m_s=robot.speed_m_s, turning=robot.turning())
        return line_over(walk, self.stands, self.floor, config, is_end_fixed=ends).xy


def _lattice_deg(align: str | float, grid: OccupancyGrid) -> float:
    """Return the angle that is asked for, or that of the walls [deg]."""

    if align == WALLS:
        walls = wall_direction(grid)
        return walls.turn_deg if walls else 0.0
    return 0.0 if align == AXES else float(align)


def _stands(floor: Floor, cell_m: float, lattice_deg: float) -> StandLattice:
    """Return the stands in cells whose rows lie at an angle to the map frame's x axis."""
    # To lay cells askew over a map is to turn the map below them. Stands are pixels of it.
    below = replace(floor, geometry=turned_geometry(floor.geometry, -lattice_deg))
    return StandLattice.over(below, cell_m)


def line_through(lattice: CoverageLattice, cells: NDArray[np.int32]) -> Line:
    """Return the line through the centres of a walk's cells, int32 (n, 2), n >= 1.

    Where the walk goes straight on no point is left.
    """
    moves = np.diff(cells, axis=0)
    kept = np.ones(len(cells), np.bool_)
    kept[1:-1] = (moves[1:] != moves[:-1]).any(axis=1)
    return lattice.centres(cells[kept])
