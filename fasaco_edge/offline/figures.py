"""Figures of a planned line by the judge: the floor that it sweeps, and its curve."""

from __future__ import annotations

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
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.text import duration, percent


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


# Figures of the floor and of the curve in ``--json``, and their digits.
FLOOR = {
    "reachable_m2": 2,
    "swept_share": 4,
    "seconds": 1,
    "seconds_per_m2": 3,
    "gap": 4,
    "patches_over_4_dm2": 0,
    "largest_patch_m2": 3,
    "illegal_share": 4,
}


def floor_document(floor: FloorFigures | None) -> dict[str, float | None] | None:
    """Return the figures of the floor that a line sweeps, as JSON values."""
    if floor is None:
        return None
    values = {name: getattr(floor, name) for name in FLOOR}
    return {
        name: None if value is None else round(value, FLOOR[name]) for name, value in values.items()
    }


def floor_words(floor: FloorFigures) -> str:
    """Return as text the floor that a line sweeps and leaves."""
    if floor.swept_share is None:
        return "none is reachable"
    words = f"{swept_words(floor.swept_m2, floor.reachable_m2)} swept"
    if floor.patches_over_4_dm2:
        words += f", {patches_left(floor)}"
    if floor.seconds_per_m2 is not None:
        words += f", {floor.seconds_per_m2:.1f} s/m2"
    if floor.gap is not None:
        words += f", {gap_words(floor.seconds, floor.gap)}"
    if floor.illegal_share:
        share = percent(floor.illegal_share)
        words += f"; {share} of the line is too close to obstacles or unknown floor"
    return words


def gap_words(seconds: float, gap: float) -> str:
    """Return in words how far a line's time [s] is above its lower bound; ``gap``: as a share."""
    least = duration(seconds / (1.0 + gap))
    return f"{100 * gap:.0f} % above {least}, the time to sweep as much without turns or overlap"


def patches_left(floor: FloorFigures) -> str:
    """Return as text the patches of floor that a line leaves."""
    count = floor.patches_over_4_dm2
    if not count:
        return "no patch over 4 dm2 left"
    patches = "1 patch" if count == 1 else f"{count} patches"
    return f"{patches} over 4 dm2 left, the largest {floor.largest_patch_m2:,.2f} m2"


def above_bound(path: CoveragePath) -> str:
    """Return as text how far a walk is above its lower bound; "" if unknown."""
    return "" if path.gap is None else f", at most {100 * path.gap:.1f} % above its bound"


def curve_document(robot: RobotConfig, curve: Curve, judged: FloorFigures) -> dict[str, object]:
    """Return the figures of a robot's curve, as JSON values."""
    return {
        "turn_radius_m": robot.turn_radius_m,
        "reverses": robot.reverses,
        "length_m": round(judged.length_m, 2),
        "backward_m": round(curve.backward_m, 2),
        "seconds": round(judged.seconds, 1),
        "reversals": judged.reversals,
        "spot_turns": judged.spot_turns,
    }


def curve_words(robot: RobotConfig, curve: Curve, judged: FloorFigures) -> str:
    """Return a robot's curve as text."""
    changes = "1 change" if judged.reversals == 1 else f"{judged.reversals} changes"
    words = f"arcs of {robot.turn_radius_m:g} m or more, " + (
        f"{curve.backward_m:,.1f} m backward, {changes} between forward and backward"
        if robot.reverses
        else "forward only"
    )
    if left := judged.spot_turns:
        words += f"; {left} turn{'s' * (left != 1)} do{'es' * (left == 1)} not fit"
    return words
