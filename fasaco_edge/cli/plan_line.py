"""The line of a plan: where its points are, its file, and how much floor it sweeps.

A line is float64 (n, 2), n >= 1: points (x, y) [m] in the map frame, to be driven straight from
one to the next; today the centres of a walk's cells.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.floor import FloorFigures, SweepingRobot, judge_floor, swept_words

if TYPE_CHECKING:
    from fasaco_edge.grid.lattice import CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid

Line = NDArray[np.float64]


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


def planned_floor(
    args: argparse.Namespace, grid: OccupancyGrid | None, line_xy: Line
) -> PlannedFloor | None:
    """Return what a line does to the floor of a map; None for a coverage grid, which has none.

    The tool is as wide as a cell.
    """
    if grid is None:
        return None
    robot = SweepingRobot(args.cell, args.robot_radius, args.speed_m_s, args.turn_s)
    return PlannedFloor.of(judge_floor(grid, line_xy, robot).figures)


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
        if self.patches_over_4_dm2:
            words += (
                f", {self.patches_over_4_dm2} patches over 4 dm2 left, "
                f"the largest {self.largest_patch_m2:,.2f} m2"
            )
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
