"""Offline planning: a walk over the cells of a map, and the line to be driven."""

from __future__ import annotations

import math
import operator
import time
from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import msgspec
import numpy as np

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.host.documents import converted
from fasaco_edge.offline.ground import Line, PlanGround
from fasaco_edge.offline.maps import Map
from fasaco_edge.offline.result import Plan
from fasaco_edge.offline.search import Planning, SearchEnd
from fasaco_edge.offline.settings import (
    ANYWHERE,
    AXES,
    CELLS,
    HOME,
    LIKE_OWN,
    WALLS,
    Search,
    default_line,
    require,
)
from fasaco_edge.planners.bound import lower_bound_of
from fasaco_edge.planners.compiling import compile_missing
from fasaco_edge.planners.cost import ANY_LANES, Lanes
from fasaco_edge.planners.curves import Curve, curve_along
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.own.loading import UserCode, user_code
from fasaco_edge.planners.passes import MOST_ANGLE_DEG, Covers, wanted_by
from fasaco_edge.planners.planner import (
    Observer,
    SearchProgress,
    StoppingCriterion,
    TimeBudget,
    ignore,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.stages import stages_of_plan

# Limit on rows and columns: arrays of cells are int32.
MOST_INDEX = 2**31 - 1


def plan(
    map: Map,
    robot: RobotConfig | None = None,
    *,
    start: Cell | None = None,
    start_xy: tuple[float, float] | None = None,
    end: str | Cell = ANYWHERE,
    line: str | None = None,
    align: str | float | None = None,
    covers: Covers = "all",
    lanes: Lanes = ANY_LANES,
    search: Search | None = None,
    planner: object = None,
    stop: StoppingCriterion | None = None,
    watch: Callable[[SearchProgress], None] = lambda _: None,
    observe: Observer = ignore,
) -> Plan:
    """Plan a walk over all reachable cells of a map, and the line along it.

    The first call on a computer compiles kernels, for two to four minutes.

    Args:
        map: what to cover.
        robot: its size and driving parameters; None for the defaults of the configuration.
        start: start cell (row, col), as wide as the tool, aligned with the map frame.
        start_xy: start point (x, y) [m] instead of ``start``. By default, a built-in map's own
            start, or the place nearest to the map frame's origin in the largest area.
        end: "anywhere", "home", or a cell.
        line: "cells": through cell centres, as the paper's planners do; "quick" or "thorough":
            over the floor, with 60 or 180 s as the value of a square metre. Default: "thorough";
            "cells" on a coverage grid, or by a planner other than colony-search.
        align: direction of the rows of cells for a line over the floor: "walls", "axes" or an angle
            [deg]; None for walls.
        covers: "all" cells; "edge", cells along walls and furniture; or "rest", all others.
        lanes: preferred direction of the walk: along the "rows" of cells, or the "columns"; "" for
            the cheapest.
        search: settings of the search; None for the defaults.
        planner: a planner of your own instead of a search: a function that takes a ``GridProblem``
            and returns the walk's cells (row, col) in order; or a class or an object with such a
            method ``plan``. It gets the seed of ``search``. In the main thread, it is ended after
            ``budget_s``, by default 60 s.
        stop: stopping criterion.
        watch: called with the progress of each search for a walk.
        observe: called with a ``ColonySnapshot``, which holds the pheromone: after each cohort, or
            once at the end of colony-search. Planners without pheromone do not call it.

    Raises:
        BadConfiguration: a value is invalid.
        StartOutsideMap, StartBlocked, EndBlocked: the robot cannot stand there.
        NothingToCover: no cell is coverable.
        PlannerFailed, IllegalWalk: raised by a planner of your own.
    """
    if start is not None and start_xy is not None:
        raise BadConfiguration("start and start_xy cannot both be given")
    require(isinstance(map, Map), "map", "be what load_map returns", map)
    robot = RobotConfig() if robot is None else robot
    search = Search() if search is None else search
    require(isinstance(robot, RobotConfig), "robot", "be a Robot", robot)
    require(isinstance(search, Search), "search", "be a Search", search)
    if not isinstance(end, str) or end not in (ANYWHERE, HOME):
        end = _cell("end", end, f"be {ANYWHERE}, {HOME} or a cell (row, col)")
    start = None if start is None else _cell("start", start, "be a cell (row, col)")
    start_xy = None if start_xy is None else _point("start_xy", start_xy)
    robot = checked(robot)
    own = None
    if planner is not None:
        own = planner if isinstance(planner, UserCode) else user_code(planner)
        search = replace(search, planner=LIKE_OWN)
    line = line or default_line(search, has_floor=map.grid is not None)
    require(covers in get_args(Covers), "covers", "be all, edge or rest", covers)
    require(lanes in get_args(Lanes), "lanes", "be rows, columns or empty", lanes)
    if lanes and not search.has_local_search:
        raise BadConfiguration(
            f"lanes {lanes}: only colony-search has a direction of its lanes",
            hint="plan by colony-search, the default",
        )
    has_curves = robot.turn_radius_m > 0.0
    compile_missing(stages=stages_of_plan(search.planner, has_curves=has_curves))
    ground = _ground(map, robot, start, start_xy, line, align)
    problem = _problem(ground, robot, end, covers, lanes)
    if covers != "all":
        ground = ground.only(problem.to_cover, beyond=covers == "edge")
    bound = None if search.has_local_search else lower_bound_of(problem)
    budget = None if search.most_s is None else TimeBudget(search.most_s)
    ending = SearchEnd(stop, budget, watch, bound)
    planning = Planning(problem, ground, search, own, ending, observe)
    wall, cpu = time.perf_counter(), time.process_time()
    path, xy = planning.run(line, robot)
    curve = _curve(xy, ground, line, robot, is_end_fixed=problem.end is not None)
    wall_s, cpu_s = time.perf_counter() - wall, time.process_time() - cpu
    found = path, xy if curve is None else curve.xy
    return Plan(map, robot, line, search, ground, problem, *found, ending.by, wall_s, cpu_s, curve)


def _cell(name: str, given: object, expectation: str) -> Cell:
    """Return an argument as a cell, two whole numbers within the limit; else BadConfiguration."""
    try:
        row, col = (operator.index(at) for at in given)  # type: ignore[attr-defined]
        is_cell = abs(row) <= MOST_INDEX and abs(col) <= MOST_INDEX
    except (TypeError, ValueError):
        is_cell = False
    require(is_cell, name, expectation, given)
    return row, col


def _point(name: str, given: object) -> tuple[float, float]:
    """Return an argument as a point, two finite numbers; else BadConfiguration."""
    try:
        x, y = (float(at + 0.0) for at in given)  # type: ignore[attr-defined]
        is_point = math.isfinite(x) and math.isfinite(y)
    except (TypeError, ValueError, OverflowError):
        is_point = False
    require(is_point, name, "be a point (x, y) [m]", given)
    return x, y


def checked(robot: RobotConfig) -> RobotConfig:
    """Return a robot after checking its values.

    Raises:
        BadConfiguration: a value is invalid; the error names it.
    """
    members = msgspec.structs.asdict(robot).items()
    given = {name: value for name, value in members if value is not msgspec.UNSET}
    return converted(RobotConfig, given, BadConfiguration)


def _ground(
    map: Map,
    robot: RobotConfig,
    start: Cell | None,
    start_xy: tuple[float, float] | None,
    line: str,
    align: str | float | None,
) -> PlanGround:
    require(line in (CELLS, *LINES), "line", f"be one of {CELLS}, {', '.join(LINES)}", line)
    if line == CELLS and robot.turn_radius_m:
        raise BadConfiguration(
            f"turn_radius_m {robot.turn_radius_m:g}: a line through cell centres turns on the spot",
            hint="ask for a line over the floor, quick or thorough",
        )
    if line != CELLS and map.grid is None:
        raise BadConfiguration(
            f"line {line}: {map.name} is a coverage grid, which lies in no map frame",
            hint="plan on a map_server YAML file, or ask for the line through cells",
        )
    is_angle = isinstance(align, int | float) and abs(align) <= MOST_ANGLE_DEG
    allowed = is_angle or align in (WALLS, AXES, None)
    require(allowed, "align", f"be {WALLS}, {AXES} or an angle in degrees", align)
    if line == CELLS and align not in (AXES, None):
        raise BadConfiguration(
            f"align {align}: the centres of cells lie along the axes of the map frame",
            hint="ask for a line over the floor, quick or thorough",
        )
    lattice = map.lattice(robot)
    if start is None:
        start = map.start(lattice) if start_xy is None else lattice.cell_at(*start_xy)
    if line == CELLS or map.grid is None:
        return PlanGround(lattice, map.grid, start)
    if start_xy is None:
        (xy,) = lattice.centres(np.array([start], np.int32)).tolist()
        start_xy = xy[0], xy[1]
    return PlanGround.of_floor(map.grid, robot, start_xy, WALLS if align is None else align)


def _curve(
    xy: Line, ground: PlanGround, line: str, robot: RobotConfig, *, is_end_fixed: bool
) -> Curve | None:
    """Return the curve along a line; None for a robot that turns on the spot."""
    config = robot.curves(LINES[line].price_s_m2) if line in LINES else None
    floor = ground.floor
    if config is None or floor is None:
        return None
    return curve_along(xy, floor, floor.reachable, config, is_end_fixed=is_end_fixed)


def _problem(
    ground: PlanGround,
    robot: RobotConfig,
    end: str | Cell,
    covers: Covers = "all",
    lanes: Lanes = ANY_LANES,
) -> CoverageProblem:
    lattice, start = ground.lattice, ground.start
    cost = robot.cost(lattice.cell_m).along(lanes)
    to = ground.end(end, robot.tool_width_m)
    problem = CoverageProblem.of(lattice, start, end=to, cost=cost)
    if covers == "all":
        return problem
    others = problem.to_cover & ~wanted_by(covers, lattice.steps, problem.to_cover)
    return CoverageProblem.of(lattice, start, covered=others, end=to, cost=cost)
