"""The figures of a plan, as values that JSON has too."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.config.config import RobotConfig
from fasaco_edge.planners.path import walk_figures

if TYPE_CHECKING:
    from fasaco_edge.offline.plan import Plan

# Members of ``RobotConfig``: the limits that bends of the line are counted by.
LIMITS = ("turn_deg_s", "turn_deg_s2", "acceleration_m_s2", "steered_deg")


def figures_of(plan: Plan) -> dict[str, object]:
    """Return the figures of a walk, of the search for it, and of the floor under its line."""
    path, problem, ground, search = plan.path, plan.problem, plan.ground, plan.search
    cell_m = problem.lattice.cell_m
    return {
        "planner": path.planner,
        "local_search": search.has_local_search,
        "seed": path.seed,
        "ants": path.work.ants,
        "kicks": path.work.perturbations,
        "proposals": path.work.proposals,
        "velocities": velocities_of(plan),
        "map": plan.map.name,
        "line": plan.line,
        "tool_m": plan.robot.tool_width_m,
        "cell_m": cell_m,
        "lattice_deg": round(ground.lattice_deg, 3),
        "start": list(problem.start),
        "end": path.cells[-1].tolist(),
        **asdict(walk_figures(problem.lattice, path.cells)),
        # What there is to cover; the walk may pass over no other cells.
        "cells": problem.cells,
        "length_m": round(path.steps * cell_m, 3),
        "cost_s": path.cost_s,
        "lower_bound_steps": path.lower_bound_steps,
        "lower_bound_cost_s": path.lower_bound_cost_s,
        "gap": None if path.gap is None else round(path.gap, 6),
        "unreachable_cells": int(np.count_nonzero(problem.unreachable)),
        **driving(plan.robot),
        "budget_s": search.most_s,
        "target_gap": search.target_gap,
        "threads": search.threads,
        "ended_by": plan.ended_by,
        "first_walk_ms": round(1e3 * path.first_walk_s, 3),
        "wall_s": round(plan.wall_s, 6),
        "cpu_s": round(plan.cpu_s, 6),
        "floor": asdict(plan.floor) if plan.floor else None,
    }


def driving(robot: RobotConfig) -> dict[str, float | None]:
    """Return what driving takes a robot; limits are None where turns count by their angle."""
    has_limits = robot.turn_deg_s is not None
    return {
        "speed_m_s": robot.speed_m_s,
        "turn_s": robot.cost().quarter_turn_s,
        **{name: getattr(robot, name) if has_limits else None for name in LIMITS},
    }


def velocities_of(plan: Plan) -> str | None:
    """Return the velocities of the ants that walked; None of a planner that has none."""
    return {"fasaco": plan.search.velocities, "aco": "1"}.get(plan.path.planner)
