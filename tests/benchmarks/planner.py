"""The planner that ``quality`` and ``scale`` measure, and how its walks are judged."""

from __future__ import annotations

import numpy as np

from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.near_optimal import NearOptimal
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search import ANTS
from tests.benchmarks.judge import WalkVerdict, check_walk


class WrongWalkError(Exception):
    """A planner returned a walk that is not what it was asked for, or says it is another."""


def planner_for(seed: int, restarts: str = ANTS) -> NearOptimal:
    """Return FaSACO with local search on one thread; ``restarts`` as in ``NearOptimal``."""
    colony = ColonyConfig(seed=seed, visibility="fewest-open", q0=0.98)
    return NearOptimal(colony, threads=1, restarts=restarts)


def judged(problem: CoverageProblem, path: CoveragePath) -> WalkVerdict:
    """Return what the independent judge says of a path, and that it says of itself the same.

    Raises:
        WrongWalkError: it is not legal, not complete, or its figures are not those it has.
    """
    lattice = problem.lattice
    corner = np.array((lattice.window.row0, lattice.window.col0))
    verdict = check_walk(
        lattice.steps,
        lattice.coverable,
        path.cells - corner,
        lattice.local(problem.start),
        None if problem.end is None else lattice.local(problem.end),
    )
    quarters = verdict.turns_90 + 2 * verdict.turns_180
    cost = problem.cost
    cost_us = verdict.steps * cost.step_us + quarters * cost.quarter_turn_us
    wrong = list(verdict.problems)
    if round(path.cost_s * 1e6) != cost_us:
        wrong.append(f"costs {cost_us / 1e6} s, said to cost {path.cost_s} s")
    if verdict.steps < path.lower_bound_steps:
        wrong.append(f"{verdict.steps} steps are below the bound of {path.lower_bound_steps}")
    if wrong:
        raise WrongWalkError(
            f"{path.planner}, seed {path.seed}, from {problem.start}: {'; '.join(wrong)}"
        )
    return verdict
