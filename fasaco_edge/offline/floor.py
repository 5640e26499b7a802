"""The floor that a planned line sweeps, judged on the map's own pixels."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.bench.drive_time import DriveLimits
from fasaco_edge.bench.floor import (
    FloorFigures,
    JudgedFloor,
    SweepingRobot,
    judge_floor,
    swept_words,
)
from fasaco_edge.config.config import RobotConfig
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.offline.ground import Line


def judged_floor(
    grid: OccupancyGrid | None, line_xy: Line, robot: RobotConfig
) -> JudgedFloor | None:
    """Return what a line does to the floor of a map; None for a coverage grid, which has none."""
    if grid is None:
        return None
    limits = None
    if robot.turn_deg_s is not None:
        limits = DriveLimits(
            robot.acceleration_m_s2, robot.turn_deg_s, robot.turn_deg_s2, robot.steered_deg
        )
    judged = SweepingRobot(
        robot.tool_width_m,
        robot.radius_m,
        robot.speed_m_s,
        robot.cost().quarter_turn_s,
        limits=limits,
    )
    return judge_floor(grid, line_xy, judged)


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
