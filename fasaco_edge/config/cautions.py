"""Cautions: valid settings that together have no effect, or an unexpected one.

The daemon starts nevertheless; invalid values are faults of ``loading``.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

from fasaco_edge.config.config import DaemonConfig, PlannerConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.grid.polygons import is_near

LOG = logging.getLogger(__name__)

# Least rate of poses, as localisers send them [Hz]; largest distance of two poses between which
# floor counts as swept [tool widths] (``mission.coverage.swept_floor.JUMP_TOOLS``).
POSES_HZ, JUMP_TOOLS = 10.0, 2.0
# Share of the tool's width above which lines give up clearance along walls
# (``planners.line.NEAR_SHARE``).
NEAR_SHARE = 0.2
# Tolerance for a tool as wide as the robot [m].
ROUNDING_M = 1e-6


def cautions(config: DaemonConfig) -> list[str]:
    """Return the cautions, each with its keys."""
    robot = config.robot
    found = (
        *(_tool(robot), _clearance(config), _turns(robot), _planner(config), _places(config)),
        _scan(config),
    )
    return [text for texts in found for text in texts]


def log_cautions(config: DaemonConfig) -> None:
    for text in cautions(config):
        LOG.warning("%s", text, extra={"event": "caution"})


def tool_caution(robot: RobotConfig) -> str:
    """Return the caution that the tool extends beyond the robot's disc; "" for none."""
    tool_m = abs(robot.tool_ahead_m) + 0.5 * robot.tool_width_m
    out_m = tool_m - robot.radius_m
    if out_m <= ROUNDING_M:
        return ""
    ahead = f" and robot.tool_ahead_m {robot.tool_ahead_m:g}" if robot.tool_ahead_m else ""
    return (
        f"robot.tool_width_m {robot.tool_width_m:g}{ahead}: the tool sticks {out_m:.2g} m out of "
        f"the robot's disc, robot.radius_m {robot.radius_m:.3g}. Nothing keeps that part off walls "
        f"and furniture; if it must not touch them, set robot.radius_m: {tool_m:.3g}"
    )


def _tool(robot: RobotConfig) -> Iterator[str]:
    if text := tool_caution(robot):
        yield text
    needed_hz = robot.speed_m_s / (JUMP_TOOLS * robot.tool_width_m)
    if needed_hz > POSES_HZ:
        yield (
            f"robot.speed_m_s {robot.speed_m_s:g} beside robot.tool_width_m "
            f"{robot.tool_width_m:g}: floor counts as swept only if a pose comes at least "
            f"{needed_hz:.0f} times a second; floor between poses farther apart does not count"
        )


def _clearance(config: DaemonConfig) -> Iterator[str]:
    robot = config.robot
    most_m = NEAR_SHARE * robot.tool_width_m
    if config.planner.line != "cells" and robot.clearance_m > most_m:
        yield (
            f"robot.clearance_m {robot.clearance_m:g} is more than a fifth of robot.tool_width_m, "
            f"{most_m:.2g}: lines come closer to walls, as that clearance would leave a wide strip "
            "unswept; a distance that must always be kept belongs in robot.radius_m"
        )


def _turns(robot: RobotConfig) -> Iterator[str]:
    usual = RobotConfig()
    if robot.turn_deg_s is not None and robot.quarter_turn_s != usual.quarter_turn_s:
        yield "robot.quarter_turn_s has no effect beside robot.turn_deg_s"
    if robot.turn_deg_s is None and robot.steered_deg != usual.steered_deg:
        yield "robot.steered_deg has no effect without robot.turn_deg_s"
    if not robot.turn_radius_m and robot.reverses != usual.reverses:
        yield "robot.reverses has no effect without robot.turn_radius_m"


def _planner(config: DaemonConfig) -> Iterator[str]:
    planner, usual = config.planner, PlannerConfig()
    if planner.name == "fasaco":
        yield (
            "planner.name fasaco is the paper's colony, without local search; the default is "
            "colony-search, which had that name before 1.0.0"
        )
    if planner.name not in ("fasaco", "aco"):
        of_these = "ants", "visibility", "threads"
        changed = [key for key in of_these if getattr(planner, key) != getattr(usual, key)]
        if changed:
            keys = ", ".join(f"planner.{key}" for key in changed)
            yield f"no effect where planner.name is {planner.name}: {keys}"
    if planner.line == "cells":
        idle = ["planner.align"] if planner.align != usual.align else []
        idle += ["planner.swept"] if planner.swept is not None else []
        idle += ["robot.overlap"] if config.robot.overlap != RobotConfig().overlap else []
        idle += ["robot.clearance_m"] if config.robot.clearance_m else []
        idle += ["robot.turn_radius_m"] if config.robot.turn_radius_m else []
        if idle:
            yield f"no effect where planner.line is cells: {', '.join(idle)}"


def _places(config: DaemonConfig) -> Iterator[str]:
    mission, radius_m = config.mission, config.robot.radius_m
    for name, place in (("home", mission.home), ("dock", mission.dock)):
        for index, polygon in enumerate(mission.keep_out if place is not None else ()):
            assert place is not None
            if is_near(polygon, (place.stand.x, place.stand.y), radius_m):
                where = "the place before its dock" if name == "dock" else "home"
                yield (
                    f"mission.keep_out[{index}] lies at mission.{name}: the robot may not stand at "
                    f"{where}, so it never gets there"
                )


def _scan(config: DaemonConfig) -> Iterator[str]:
    if not config.scan:
        return
    if config.ros2 and config.ros2.follow == "nav2":
        yield "scan has no effect where ros2.follow is nav2, as Nav2 reads scans itself"
    away_m = math.hypot(config.scan.x_m, config.scan.y_m)
    if away_m > config.robot.radius_m:
        yield (
            f"scan.x_m {config.scan.x_m:g} and scan.y_m {config.scan.y_m:g}: the lidar is "
            f"{away_m:.2g} m from the robot's middle, beyond its disc, robot.radius_m "
            f"{config.robot.radius_m:.3g}: are they in metres?"
        )
