"""Figures of a planned line by the judge: the floor that it sweeps, and its curve."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.driven_line import DriveLimits
from fasaco_edge.judge.floor import (
    FloorFigures,
    JudgedFloor,
    SweepingRobot,
    judge_floor,
    swept_words,
)
from fasaco_edge.offline.ground import Line
from fasaco_edge.planners.curves import Curve


def judged_floor(
    grid: OccupancyGrid | None, line_xy: Line, robot: RobotConfig
) -> JudgedFloor | None:
    """Return the swept and unswept floor of a line on a map; None for a coverage grid."""
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
        turn_radius_m=robot.turn_radius_m,
    )
    return judge_floor(grid, line_xy, judged)


@dataclass(frozen=True, slots=True)
class PlannedFloor:
    """The floor that a plan sweeps, as in ``--json``; see ``FloorFigures``."""

    reachable_m2: float
    swept_share: float | None
    seconds_per_m2: float | None
    gap: float | None
    patches_over_4_dm2: int
    largest_patch_m2: float
    illegal_share: float

    def __str__(self) -> str:
        """Text for tables and pictures."""
        if self.swept_share is None:
            return "none is reachable"
        swept_m2 = self.swept_share * self.reachable_m2
        words = f"{swept_words(swept_m2, self.reachable_m2)} swept"
        if count := self.patches_over_4_dm2:
            patches = "1 patch" if count == 1 else f"{count} patches"
            words += f", {patches} over 4 dm2 left, the largest {self.largest_patch_m2:,.2f} m2"
        if self.seconds_per_m2 is not None:
            words += f", {self.seconds_per_m2:.1f} s/m2"
        if self.gap is not None:
            words += f", at most {100 * self.gap:.0f} % above the shortest possible time"
        if self.illegal_share:
            words += (
                f"; {self.illegal_share:.1%} of the line is too close to obstacles or unknown floor"
            )
        return words

    @classmethod
    def of(cls, figures: FloorFigures) -> PlannedFloor:
        """Return the figures, rounded."""
        share, pace, gap = figures.swept_share, figures.seconds_per_m2, figures.gap
        return cls(
            reachable_m2=round(figures.reachable_m2, 2),
            swept_share=None if share is None else round(share, 4),
            seconds_per_m2=None if pace is None else round(pace, 3),
            gap=None if gap is None else round(gap, 4),
            patches_over_4_dm2=figures.patches_over_4_dm2,
            largest_patch_m2=round(figures.largest_patch_m2, 3),
            illegal_share=round(figures.illegal_share, 4),
        )


@dataclass(frozen=True, slots=True)
class CurveFigures:
    """The curve of a robot with a turning radius, as in ``--json``.

    Attributes:
        turn_radius_m: of its tightest arc [m].
        reverses: whether it may drive backward.
        length_m, backward_m: length of the curve, and of what is driven backward [m].
        seconds: driving time by the judge [s].
        reversals: changes between forward and backward.
        spot_turns: turns that do not fit, and stay on the spot, by the judge.
    """

    turn_radius_m: float
    reverses: bool
    length_m: float
    backward_m: float
    seconds: float
    reversals: int
    spot_turns: int

    def __str__(self) -> str:
        """Text for tables and pictures."""
        count, left = self.reversals, self.spot_turns
        changes = "1 change" if count == 1 else f"{count} changes"
        words = (
            f"arcs of {self.turn_radius_m:g} m or more, {self.length_m:,.1f} m in "
            f"{self.seconds:,.0f} s, {self.backward_m:,.1f} m of it backward, {changes} between "
            "forward and backward"
        )
        if left:
            words += f"; {left} turn{'s' * (left != 1)} do{'es' * (left == 1)} not fit"
        return words

    @classmethod
    def of(cls, robot: RobotConfig, curve: Curve, judged: FloorFigures) -> CurveFigures:
        """Return the figures, rounded."""
        return cls(
            turn_radius_m=robot.turn_radius_m,
            reverses=robot.reverses,
            length_m=round(judged.length_m, 2),
            backward_m=round(curve.backward_m, 2),
            seconds=round(judged.seconds, 1),
            reversals=judged.reversals,
            spot_turns=judged.spot_turns,
        )
