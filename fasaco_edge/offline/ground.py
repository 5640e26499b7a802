"""Ground of a plan: its cells, and the floor that a line along a walk sweeps.

A line is float64 (n, 2), n >= 1: points (x, y) [m] in the map frame, joined by straight segments.
It leads through the centres of a walk's cells, or over their stands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import EndBlocked, MapTooFar, MapTooLarge
from fasaco_edge.grid.fine_raster import RobotDiscs, map_to_raster, stand_placement
from fasaco_edge.grid.floor import Floor, StandLattice
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.grid.walls import wall_direction
from fasaco_edge.kernels.floor.bits import packed, unpacked
from fasaco_edge.kernels.floor.places import keep_in_cells
from fasaco_edge.offline.settings import AXES, HOME, WALLS
from fasaco_edge.planners.line import LINES, LineSearch

Line = NDArray[np.float64]
# Ratio of unswept floor by the judge to unswept floor on the line's raster. Measured: 1.2 to 1.5,
# and more if little floor is unswept.
LEFT_BY_JUDGE = 1.6


@dataclass(frozen=True, slots=True, eq=False)
class PlanGround:
    """The cells and floor of a plan.

    Attributes:
        lattice: the lattice of cells.
        grid: the map; None for a coverage grid.
        start: start cell (row, col).
        floor, stands: the floor and the stands in the cells; None for cell centres.
        lattice_deg: angle of the cells' rows to the x axis of the map frame [deg].
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
    ) -> PlanGround:
        """Return the ground of a line over the floor reachable from a point.

        Args:
            grid: the map.
            robot: size of the robot, and overlap of its lanes.
            start_xy: start of the robot [m].
            align: direction of the rows of cells: walls, axes, or an angle [deg].

        Raises:
            StartOutsideMap, StartBlocked: the robot cannot stand there.
            MapTooLarge, MapTooFar: see ``Floor.around``, ``StandLattice.over``.
        """
        discs = RobotDiscs(robot.radius_m, robot.tool_width_m, clearance_m=robot.clearance_m)
        floor = Floor.around(grid, discs, start_xy)
        cell_m = robot.lane_m
        lattice_deg = _lattice_deg(align, grid)
        try:
            stands = _stands(floor, cell_m, lattice_deg)
        except (MapTooFar, MapTooLarge):
            # A rotated lattice spans up to twice the cells, and may lie farther from the origin.
            if align != WALLS or not lattice_deg:
                raise
            lattice_deg = 0.0
            stands = _stands(floor, cell_m, lattice_deg)
        return cls(stands.lattice, grid, stands.start_cell(floor), floor, stands, lattice_deg)

    def end(self, end: str | Cell, tool_m: float) -> Cell | None:
        """Return the end cell; None for anywhere.

        Args:
            end: ANYWHERE, HOME, or a cell of a lattice of the tool's width, aligned with the map
                frame.
            tool_m: width of the tool [m].

        Raises:
            EndBlocked: the robot has no place in that cell.
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

    def only(self, cells: NDArray[np.bool_], *, beyond: bool) -> PlanGround:
        """Return this ground; only the floor in some cells has to be swept.

        Args:
            cells: bool (rows, cols) of the lattice.
            beyond: whether to include floor in cells without a stand, such as along walls.
        """
        if self.floor is None:
            return self
        floor, window = self.floor, self.lattice.window
        below = rotated_geometry(floor.geometry, -self.lattice_deg)
        placement = stand_placement(below, self.lattice.cell_m, floor.discs.radius_m)
        kept = packed(floor.reachable, beyond=False)
        chosen = cells | ~self.lattice.coverable if beyond else cells
        keep_in_cells(kept, placement, chosen, (window.row0, window.col0), (0, 0))
        reachable = unpacked(kept, floor.geometry.cols)
        return replace(self, floor=replace(floor, reachable=reachable))

    def line_search(
        self,
        walk: NDArray[np.int32],
        name: str,
        robot: RobotConfig,
        *,
        ends: bool,
        swept: float | None,
    ) -> LineSearch:
        """Return the search for a line over the floor, along a walk.

        Args:
            walk: int32 (n, 2), n >= 1.
            name: a name in ``planners.line.LINES``.
            robot: its driving parameters.
            ends: whether the line must end where the walk does.
            swept: share of the floor to sweep, by the judge; None for floor worth its time.
        """
        assert self.floor is not None
        assert self.stands is not None
        aim = None if swept is None else 1.0 - (1.0 - swept) / LEFT_BY_JUDGE
        config = replace(LINES[name], speed_m_s=robot.speed_m_s, turning=robot.turning(), swept=aim)
        return LineSearch(walk, self.stands, self.floor, config, is_end_fixed=ends)


def _lattice_deg(align: str | float, grid: OccupancyGrid) -> float:
    """Return the requested angle, or the angle of the walls [deg]."""
    if align == WALLS:
        walls = wall_direction(grid)
        return walls.rotation_deg if walls else 0.0
    return 0.0 if align == AXES else float(align)


def _stands(floor: Floor, cell_m: float, lattice_deg: float) -> StandLattice:
    """Return the stands in cells whose rows are at an angle to the map frame's x axis."""
    # The map is rotated instead of the lattice; stands are pixels of the map.
    below = replace(floor, geometry=rotated_geometry(floor.geometry, -lattice_deg))
    return StandLattice.over(below, cell_m)


def line_through(lattice: CoverageLattice, cells: NDArray[np.int32]) -> Line:
    """Return the line through the centres of a walk's cells, int32 (n, 2), n >= 1.

    Straight runs have no points in between.
    """
    moves = np.diff(cells, axis=0)
    kept = np.ones(len(cells), np.bool_)
    kept[1:-1] = (moves[1:] != moves[:-1]).any(axis=1)
    return lattice.centres(cells[kept])
