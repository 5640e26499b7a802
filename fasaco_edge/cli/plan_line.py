"""The line of a plan: where its points are, its file, and how much floor it sweeps.

A line is float64 (n, 2), n >= 1: points (x, y) [m] in the map frame, to be driven straight from
one to the next: the centres of a walk's cells, or a line over the floor that they stand for.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.drive_time import DriveLimits
from fasaco_edge.bench.floor import (
    FloorFigures,
    JudgedFloor,
    SweepingRobot,
    judge_floor,
    swept_words,
)
from fasaco_edge.cli.plan_options import ANYWHERE, AXES, HOME, WALLS
from fasaco_edge.cli.plan_turning import turning
from fasaco_edge.errors import EndBlocked, MapTooFar, MapTooLarge

if TYPE_CHECKING:
    from fasaco_edge.grid.floor import Floor, StandLattice
    from fasaco_edge.grid.lattice import Cell, CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid

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
        cls, args: argparse.Namespace, grid: OccupancyGrid, cells: CoverageLattice, start: Cell
    ) -> Ground:
        """Return the ground of a line over the floor that is reached from a cell's centre.

        Args:
            args: of the command.
            grid: the map.
            cells: the lattice of cells as wide as the tool.
            start: one of these.

        Raises:
            StartOutsideMap, StartBlocked: the robot cannot stand there.
            MapTooLarge, MapTooFar: see ``Floor.around``, ``StandLattice.over``.
        """
        from fasaco_edge.grid.fine_raster import RobotDiscs
        from fasaco_edge.grid.floor import Floor

        (xy,) = cells.centres(np.array([start], np.int32)).tolist()
        if args.start_xy is not None:
            xy = args.start_xy
        floor = Floor.around(grid, RobotDiscs(args.robot_radius, args.cell), tuple(xy))
        cell_m = args.cell * (1.0 - args.overlap)
        lattice_deg = _lattice_deg(args, grid)
        try:
            stands = _stands(floor, cell_m, lattice_deg)
        except (MapTooFar, MapTooLarge):
            # Askew, a lattice spans up to twice the cells, and may lie farther from 0.
            if args.align != WALLS or not lattice_deg:
                raise
            lattice_deg = 0.0
            stands = _stands(floor, cell_m, lattice_deg)
        return cls(stands.lattice, grid, stands.start_cell(floor), floor, stands, lattice_deg)

    def end(self, args: argparse.Namespace) -> Cell | None:
        """Return the cell to end in, None for anywhere.

        Raises:
            EndBlocked: the robot has no place in the cell that is asked for.
        """
        if args.end == ANYWHERE:
            return None
        if args.end == HOME:
            return self.start
        cell: Cell = args.end
        if self.floor is None or self.stands is None:
            return cell
        from fasaco_edge.grid.fine_raster import map_to_raster

        # Named is a cell as wide as the tool, along the axes of the map frame, as for the start.
        middle = ((index + 0.5) * args.cell for index in reversed(cell))
        place = np.array(map_to_raster(self.floor.geometry, *middle))
        away = np.hypot(*np.moveaxis(self.stands.stands - place, 2, 0))
        row, col = divmod(int(np.nanargmin(away)), away.shape[1])
        if away[row, col] * self.floor.geometry.resolution > args.cell:
            raise EndBlocked(f"end cell {cell} is out of reach, or the robot does not fit there")
        window = self.stands.lattice.window
        return row + window.row0, col + window.col0

    def line(self, args: argparse.Namespace, walk: NDArray[np.int32], *, ends: bool) -> Line:
        """Return the line along a walk, int32 (n, 2), n >= 1; ``ends`` where it ends there."""
        from fasaco_edge.planners.line import LINES, line_over

        if self.floor is None or self.stands is None:
            return line_through(self.lattice, walk)
        config = replace(LINES[args.line], speed_m_s=args.speed_m_s, turning=turning(args))
        return line_over(walk, self.stands, self.floor, config, is_end_fixed=ends).xy


def read_lattice(
    args: argparse.Namespace, file: Path
) -> tuple[OccupancyGrid | None, CoverageLattice]:
    """Return the map in a file, None for a coverage grid, and the lattice of cells over it."""
    from fasaco_edge.grid.lattice import CoverageLattice, Footprint
    from fasaco_edge.grid.map_files import read_coverage_grid, read_map

    if file.suffix == ".npy":
        return None, CoverageLattice.from_free(read_coverage_grid(file), args.cell)
    grid = read_map(file)
    return grid, CoverageLattice.from_map(grid, Footprint(args.cell, args.robot_radius))


def _lattice_deg(args: argparse.Namespace, grid: OccupancyGrid) -> float:
    """Return the angle that is asked for, or that of the walls [deg]."""
    from fasaco_edge.grid.walls import wall_direction

    if args.align == WALLS:
        walls = wall_direction(grid)
        return walls.turn_deg if walls else 0.0
    return 0.0 if args.align == AXES else float(args.align)


def _stands(floor: Floor, cell_m: float, lattice_deg: float) -> StandLattice:
    """Return the stands in cells whose rows lie at an angle to the map frame's x axis."""
    from fasaco_edge.grid.floor import StandLattice
    from fasaco_edge.grid.walls import turned_geometry

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


def write_line(file: Path, line_xy: Line) -> None:
    """Write a line as CSV, to the micrometre."""
    np.savetxt(file, line_xy, "%.6f", ",", header="x_m,y_m", comments="")


def judged_floor(
    args: argparse.Namespace, grid: OccupancyGrid | None, line_xy: Line
) -> JudgedFloor | None:
    """Return what a line does to the floor of a map; None for a coverage grid, which has none.

    The tool is as wide as a cell.
    """
    if grid is None:
        return None
    limits = None
    if args.turn_deg_s is not None:
        limits = DriveLimits(
            args.acceleration_m_s2, args.turn_deg_s, args.turn_deg_s2, args.steered_deg
        )
    robot = SweepingRobot(args.cell, args.robot_radius, args.speed_m_s, args.turn_s, limits=limits)
    return judge_floor(grid, line_xy, robot)


@dataclass(frozen=True, slots=True)
class PlannedFloor:
    """The floor that a plan sweeps, as ``--json`` has it; ``FloorFigures`` says what each is."""

    reachable_m2: float
    swept_share: float | None
    seconds_per_m2: float | None
    patches_over_4_dm2: int
    largest_patch_m2: float
    illegal_share: float

    def __str__(self) -> str:
        """What a table and a picture say of it."""
        if self.swept_share is None:
            return "none is reachable"
        swept_m2 = self.swept_share * self.reachable_m2
        words = f"{swept_words(swept_m2, self.reachable_m2)} swept"
        if count := self.patches_over_4_dm2:
            patches = "1 patch" if count == 1 else f"{count} patches"
            words += f", {patches} over 4 dm2 left, the largest {self.largest_patch_m2:,.2f} m2"
        if self.seconds_per_m2 is not None:
            words += f", {self.seconds_per_m2:.1f} s/m2"
        if self.illegal_share:
            words += f"; {self.illegal_share:.1%} of the line is too near to what is not free"
        return words

    @classmethod
    def of(cls, figures: FloorFigures) -> PlannedFloor:
        """Return the figures, rounded."""
        share, pace = figures.swept_share, figures.seconds_per_m2
        return cls(
            reachable_m2=round(figures.reachable_m2, 2),
            swept_share=None if share is None else round(share, 4),
            seconds_per_m2=None if pace is None else round(pace, 3),
            patches_over_4_dm2=figures.patches_over_4_dm2,
            largest_patch_m2=round(figures.largest_patch_m2, 3),
            illegal_share=round(figures.illegal_share, 4),
        )
