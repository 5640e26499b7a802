"""Result of planning: a walk and the line along it, with figures and pictures."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.drawing.pictures import draw_walk
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.drawing.trail import draw_trail
from fasaco_edge.host.durable import whole
from fasaco_edge.judge.floor import FloorFigures, JudgedFloor
from fasaco_edge.offline.figures import (
    above_bound,
    curve_document,
    curve_words,
    floor_document,
    floor_words,
    gap_words,
    judged_floor,
)
from fasaco_edge.offline.ground import Line, PlanGround
from fasaco_edge.offline.maps import Map
from fasaco_edge.offline.rooms import RoomsUnderLine
from fasaco_edge.offline.settings import CELLS, Search
from fasaco_edge.planners.cost import count_turns
from fasaco_edge.planners.curves import Curve
from fasaco_edge.planners.living_trail import Tau, branching
from fasaco_edge.planners.own.problem import GridProblem, grid_problem
from fasaco_edge.planners.path import CoveragePath, walk_figures
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.text import duration, percent

# Members of ``RobotConfig``: the limits for timing bends of the line.
LIMITS = ("turn_deg_s", "turn_deg_s2", "acceleration_m_s2", "steered_deg")


class Drive(NamedTuple):
    """The effort of driving a line: its length [m], quarter-turns, and time [s].

    Attributes:
        gap: time over the lower bound on the time of any line, minus 1; None if unknown.
        counts_turns: whether turns take time; False with ``quarter_turn_s=0``.
    """

    metres: float
    turns: float
    seconds: float
    gap: float | None
    counts_turns: bool

    @property
    def time(self) -> str:
        """The time in words."""
        return duration(self.seconds) + ("" if self.counts_turns else " without turns")


@dataclass(frozen=True, repr=False)
class Plan:
    """A walk over a map, and the line along it.

    Attributes:
        map: the map.
        robot: the robot.
        line: ``cells`` through the cells' centres; ``quick`` or ``thorough`` over the floor.
        search: settings of the search.
        ground: the cells, and the robot's stand for each.
        problem: what to cover, from where.
        path: the walk, with its cost and bound.
        xy: float64 (n, 2), n >= 1: points (x, y) [m] in the map frame, joined by straight
            segments.
        ended_by: what ended the search.
        wall_s, cpu_s: duration of the search for walk and line [s].
        curve: the curve that a robot with a turning radius drives, with its headings; its points
            are ``xy``. None for a robot that turns on the spot.
    """

    map: Map
    robot: RobotConfig
    line: str
    search: Search
    ground: PlanGround
    problem: CoverageProblem
    path: CoveragePath
    xy: Line
    ended_by: str
    wall_s: float
    cpu_s: float
    curve: Curve | None = None

    def __repr__(self) -> str:
        """Return the plan in one line."""
        drive = self.drive
        words = [f"{self.problem.cells} cells", drive.time, f"{drive.metres:,.1f} m"]
        floor = self.floor
        if floor is not None and floor.swept_share is not None:
            words[0] = f"{percent(floor.swept_share)} of {floor.reachable_m2:,.1f} m2 swept"
        words.append(f"{drive.turns:,.0f} quarter-turns")
        if floor is not None and floor.gap is not None:
            words.append(gap_words(floor.seconds, floor.gap))
        above = above_bound(self.path) if floor is None else ""
        return f"<Plan {self.map.name}, {self.path.planner}: {', '.join(words)}{above}>"

    def _repr_png_(self) -> bytes:
        return png_of(self.plot())

    @property
    def drive(self) -> Drive:
        """The effort of driving the line; for a coverage grid, the walk."""
        counts_turns = self.robot.cost().quarter_turn_s > 0.0
        if self.judged is not None:
            judged = self.judged.figures
            took = judged.length_m, judged.quarter_turns, judged.seconds, judged.gap
            return Drive(*took, counts_turns)
        turns = count_turns(self.cells)
        metres = self.steps * self.problem.lattice.cell_m
        return Drive(metres, turns.quarter + 2 * turns.half, self.cost_s, self.gap, counts_turns)

    @property
    def grid_problem(self) -> GridProblem:
        """The problem, as the input of a planner of your own."""
        return grid_problem(self.problem, self.search.seed)

    @property
    def cells(self) -> NDArray[np.int32]:
        """The walk, int32 (n, 2): cells (row, col), the start first."""
        return self.path.cells

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.path.steps

    @property
    def cost_s(self) -> float:
        """Time to drive and turn along the walk's cells [s]; the line has ``drive.seconds``."""
        return self.path.cost_s

    @property
    def gap(self) -> float | None:
        """Optimality gap of ``cost_s``, as a share; None if unknown. The line has ``drive.gap``."""
        return self.path.gap

    @cached_property
    def judged(self) -> JudgedFloor | None:
        """The floor that the line sweeps and leaves; None for a coverage grid."""
        return judged_floor(self.map.grid, self.xy, self.robot)

    @property
    def floor(self) -> FloorFigures | None:
        """Figures of the floor; None for a coverage grid."""
        return None if self.judged is None else self.judged.figures

    @property
    def curve_words(self) -> str:
        """Text about the curve; "" for a robot that turns on the spot."""
        if self.curve is None or self.floor is None:
            return ""
        return curve_words(self.robot, self.curve, self.floor)

    @property
    def swept_share(self) -> float | None:
        """The share of the reachable floor that the line sweeps; None for a coverage grid."""
        return None if self.floor is None else self.floor.swept_share

    @property
    def velocities(self) -> str | None:
        """The velocities of the ants; None for a planner without ants."""
        velocities = self.search.velocities
        of_ants = {"colony-search": velocities, "fasaco": velocities, "aco": "1"}
        return of_ants.get(self.path.planner)

    @property
    def figures(self) -> dict[str, object]:
        """All figures of ``fasaco-edge plan --json`` as JSON values."""
        path, problem, search, floor = self.path, self.problem, self.search, self.floor
        cell_m = problem.lattice.cell_m
        curve = {}
        if self.curve is not None and floor is not None:
            curve = {"curve": curve_document(self.robot, self.curve, floor)}
        return {
            "planner": path.planner,
            "seed": path.seed,
            "ants": path.work.ants,
            "kicks": path.work.perturbations,
            "proposals": path.work.proposals,
            "velocities": self.velocities,
            "map": self.map.name,
            "line": self.line,
            "tool_m": self.robot.tool_width_m,
            "cell_m": cell_m,
            "lattice_deg": round(self.ground.lattice_deg, 3),
            "start": list(problem.start),
            "end": path.cells[-1].tolist(),
            **asdict(walk_figures(problem.lattice, path.cells)),
            # Only the cells to cover, as the walk may pass over others.
            "cells": problem.cells,
            "length_m": round(path.steps * cell_m, 3),
            "cost_s": path.cost_s,
            "lower_bound_steps": path.lower_bound_steps,
            "lower_bound_cost_s": path.lower_bound_cost_s,
            "gap": None if path.gap is None else round(path.gap, 6),
            "unreachable_cells": int(np.count_nonzero(problem.unreachable)),
            **driving(self.robot),
            "budget_s": search.most_s,
            "threads": search.threads,
            "ended_by": self.ended_by,
            "first_walk_ms": round(1e3 * path.first_walk_s, 3),
            "wall_s": round(self.wall_s, 6),
            "cpu_s": round(self.cpu_s, 6),
            "floor": floor_document(floor),
            **curve,
        }

    @cached_property
    def rooms(self) -> RoomsUnderLine | None:
        """The rooms of the map, with figures of the line in each; None for a coverage grid."""
        if self.map.grid is None or self.judged is None:
            return None
        return RoomsUnderLine.of(self.map.grid, self.xy, self.judged)

    def plot(self, file: str | Path | None = None, *, rooms: bool = False) -> Image.Image:
        """Return an RGB picture of walk or line over the map; also write it to ``file`` as PNG.

        ``rooms``: whether it shows each room in its colour, in place of the swept floor.
        """
        return saved(picture_of(self, rooms=rooms), file)


def driving(robot: RobotConfig) -> dict[str, float | None]:
    """Return a robot's driving parameters; limits are None if turns are timed by angle."""
    has_limits = robot.turn_deg_s is not None
    return {
        "speed_m_s": robot.speed_m_s,
        "turn_s": robot.cost().quarter_turn_s,
        **{name: getattr(robot, name) if has_limits else None for name in LIMITS},
    }


def saved(picture: Image.Image, file: str | Path | None) -> Image.Image:
    """Return a picture, also written to ``file`` as PNG unless that is None."""
    if file is not None:
        with whole(Path(file)) as new:
            picture.save(new, "PNG")
    return picture


def png_of(picture: Image.Image) -> bytes:
    """Return a picture as PNG."""
    png = BytesIO()
    picture.save(png, "PNG")
    return png.getvalue()


def picture_of(plan: Plan, of: str = "", *, rooms: bool = False) -> Image.Image:
    """Return an RGB picture of a plan, with its rooms or not; its title begins with ``of``."""
    path, ground, judged = plan.path, plan.ground, plan.judged
    has_search = plan.search.has_local_search
    search = f", {path.work.perturbations} perturbations" if has_search else ""
    walk = walk_figures(ground.lattice, path.cells)
    deg = round(ground.lattice_deg, 3)
    askew = f" at {deg:g} degrees" if deg else ""
    drive = plan.drive
    lines = [
        f"{plan.map.name}: {plan.problem.cells} cells of {ground.lattice.cell_m:g} m{askew}; "
        f"walk: {walk.steps} steps, {walk.revisits} revisits{above_bound(path)}",
        f"line: {drive.metres:,.1f} m, {drive.turns:,.0f} quarter-turns, {drive.time}",
    ]
    if judged is not None:
        lines.append(f"reachable floor: {floor_words(judged.figures)}")
    if plan.curve_words:
        lines.append(plan.curve_words)
    shows_floor = judged is not None and plan.line != CELLS
    under = plan.rooms if rooms else None
    if under is not None:
        lines.append(f"{under.found.count} {'room' if under.found.count == 1 else 'rooms'}")
    return draw_walk(
        ground.lattice,
        path.cells,
        grid=ground.grid,
        title=of + path.planner + _colony(plan) + search,
        lines=lines,
        line_xy=plan.xy,
        is_backward=None if plan.curve is None else plan.curve.is_backward,
        swept=MapLayer(judged.geometry, judged.swept) if judged and shows_floor else None,
        unswept=MapLayer(judged.geometry, judged.unswept) if judged else None,
        rooms=None if under is None else under.found,
    )


def pheromone_picture_of(plan: Plan, tau: Tau) -> Image.Image:
    """Return an RGB picture of the trail left by a plan's colony."""
    ground = plan.ground
    # Ants visit no other cells.
    tau = np.where(plan.problem.to_cover[..., np.newaxis], tau, np.float32(0))
    # Rotated cells are drawn upright, without the map.
    deg = round(ground.lattice_deg, 3)
    askew = f", along rows at {deg:g} degrees to the map, which is not drawn" if deg else ""
    lines = [
        f"{plan.map.name}: direction of the strongest pheromone in each cell{askew}. Colour and "
        "size of an arrow: amount on that step, relative to the greatest on the map.",
        f"Mean branching factor {branching(tau):.2f} (1: one dominant direction in every cell).",
    ]
    return draw_trail(
        ground.lattice,
        tau,
        grid=None if deg else ground.grid,
        title=f"pheromone of {plan.path.planner}{_colony(plan)}",
        lines=lines,
    )


def _colony(plan: Plan) -> str:
    """Return a description of the ants; "" for none."""
    ants = plan.path.work.ants
    counted = "1 ant" if ants == 1 else f"{ants} ants"
    return f" {plan.velocities}, {counted}, seed {plan.path.seed}" if ants else ""
