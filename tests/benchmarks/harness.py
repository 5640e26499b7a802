"""Harness of all benchmarks: grids by name, the measured planner, judged walks."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import SearchProgress
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.benchmarks.judge import WalkVerdict, check_walk

Number = TypeVar("Number", int, float)


class WrongWalkError(Exception):
    """A planner returned a walk that is not what it was asked for, or says it is another."""


# Weight of new pheromone, so small that a trail stays uniform.
NO_WEIGHT = 1e-12


def planner_for(seed: int, variant: str = "ants") -> NearOptimal:
    """Return the planner of missions: with "ants", ants on a "flat" trail, or "none"."""
    alpha = NO_WEIGHT if variant == "flat" else 0.1
    colony = ColonyConfig(seed=seed, alpha=alpha, q0=0.9)
    return NearOptimal(colony, has_ants=variant != "none")


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
    if cost_us < round(path.lower_bound_cost_s * 1e6):
        wrong.append(f"costs {cost_us / 1e6} s, below the bound of {path.lower_bound_cost_s} s")
    if wrong:
        raise WrongWalkError(
            f"{path.planner}, seed {path.seed}, from {problem.start}: {'; '.join(wrong)}"
        )
    return verdict


def check_covered(problem: CoverageProblem, cells: NDArray[np.int32]) -> None:
    """Raise WrongWalkError where a walk, int32 (n, 2), leaves a cell out."""
    left, window = problem.to_cover.copy(), problem.lattice.window
    left[tuple((cells - (window.row0, window.col0)).T)] = False
    if left.any():
        raise WrongWalkError(f"{np.count_nonzero(left)} cells are left out")


@dataclass(slots=True)
class ProcessorBudget:
    """Stop after some seconds of this thread's processor time."""

    seconds: float
    began: float = field(default_factory=time.thread_time)

    def __call__(self, progress: SearchProgress) -> bool:
        return time.thread_time() - self.began >= self.seconds


def within(low: Number, high: Number) -> Callable[[str], Number]:
    """Return what reads an option's number within bounds; whole numbers if these are."""

    def read(text: str) -> Number:
        number = type(low)(text)
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"must be in {low}..{high}, got {text}")
        return number

    return read


SECONDS = within(0.0, 3600.0)
"""Reads a time [s] from 0 to an hour."""


def add_floors(parser: argparse.ArgumentParser, floors: int) -> None:
    """Declare ``--floors`` and ``--seed`` of generated homes and offices."""
    parser.add_argument(
        "--floors",
        type=within(1, 1_000_000),
        default=floors,
        help="number of floors of each kind (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=within(0, 2**62), default=0, help="first seed (default: %(default)s)"
    )


def grid_name(name_or_path: str) -> str:
    """Return a grid's name in results, without the folder of its file."""
    return Path(name_or_path).stem


def check_names(grids: Sequence[str]) -> None:
    """Make sure that names tell grids apart.

    Raises:
        BadConfiguration: two grids have the same name.
    """
    names = [grid_name(grid) for grid in grids]
    for name in names:
        if names.count(name) > 1:
            raise BadConfiguration(f"grids must have different names, got {name!r} twice")
