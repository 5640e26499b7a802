"""Plans with several budgets, costs and ends on each grid, each judged.

Results of other planners, proven optima and bounds are read from a JSON file with an entry for each
grid, by name::

    {"paper_simulated": {
        "cells": 169,
        "results": {"lkh_open": {"full": true, "steps": 186, "turns_90": 78, "turns_180": 3}},
        "proven_optimum": {"open_steps": 186, "closed_steps": 214},
        "bounds": {"hk_open": 186.0, "block_closed": 214}}}

Only ``results`` is required. Incomplete walks, which are not ``full``, do not count.
"""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost, SearchWork
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import TimeBudget
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import WrongWalkError, check_names, grid_name, judged, planner_for

# The tour solver's walks: of the others, none is near to the best there is.
BEST_KNOWN_BY = {False: "lkh_open", True: "lkh_closed"}

# A bound of a linear programme may be above a whole number by as much and not mean it.
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class OtherWalk:
    """A complete walk of another planner; ``returns_home`` if it ends where it began."""

    planner: str
    steps: int
    turns_90: int
    turns_180: int
    returns_home: bool

    def mission_s(self, turn_s: float) -> float:
        """Return its time [s], a second a step and ``turn_s`` a quarter-turn."""
        return self.steps + turn_s * (self.turns_90 + 2 * self.turns_180)


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of walks on a grid that end anywhere, or of those that end at home.

    Attributes:
        walks: complete walks of other planners.
        optimum: steps of a shortest walk, proven; None if nobody knows.
        bound: no walk has fewer steps; 0 if nothing is known.
        best_steps: the best known: the optimum or the tour solver's walk.
    """

    walks: tuple[OtherWalk, ...] = ()
    optimum: int | None = None
    bound: int = 0
    best_steps: int | None = None

    def quickest(self, turn_s: float) -> OtherWalk | None:
        """Return the walk of the best of all planners by mission time; None without any."""
        return min(self.walks, key=lambda walk: walk.mission_s(turn_s), default=None)


@dataclass(frozen=True, slots=True)
class Reference:
    """What is known of a grid: its number of cells, open walks, and closed ones."""

    cells: int | None
    open: Known
    closed: Known

    def of(self, closed: bool) -> Known:
        """Return what is known of the one or the other."""
        return self.closed if closed else self.open


UNKNOWN = Reference(None, Known(), Known())


def read_references(file: Path | None) -> Mapping[str, Reference]:
    """Return what a file knows of each grid, by its name; nothing without a file.

    Raises:
        BadConfiguration: it cannot be read, or is not laid out as above.
    """
    if file is None:
        return {}
    try:
        grids = json.loads(file.read_text(encoding="utf-8"))
        return {name: _reference(grid) for name, grid in grids.items()}
    except OSError as error:
        raise BadConfiguration(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadConfiguration(
            f"{file}: expected results, bounds and optima of grids, got {error!r}"
        ) from error


def _reference(grid: dict[str, Any]) -> Reference:
    walks = tuple(_walk(name, walk) for name, walk in grid["results"].items() if walk["full"])
    return Reference(grid.get("cells"), _known(grid, walks, False), _known(grid, walks, True))


def _walk(name: str, walk: dict[str, Any]) -> OtherWalk:
    steps, quarter, half = (int(walk[figure]) for figure in ("steps", "turns_90", "turns_180"))
    return OtherWalk(name, steps, quarter, half, bool(walk.get("returns_home", False)))


def _known(grid: dict[str, Any], walks: tuple[OtherWalk, ...], closed: bool) -> Known:
    end = "closed" if closed else "open"
    optimum = grid.get("proven_optimum", {}).get(f"{end}_steps")
    bounds = [value for name, value in grid.get("bounds", {}).items() if name.endswith(f"_{end}")]
    solved = [walk.steps for walk in walks if walk.planner == BEST_KNOWN_BY[closed]]
    best = [*solved, *([] if optimum is None else [int(optimum)])]
    return Known(
        # A walk that comes home is one that may end anywhere, too.
        tuple(walk for walk in walks if walk.returns_home or not closed),
        None if optimum is None else int(optimum),
        max((math.ceil(float(bound) - ROUNDING) for bound in bounds), default=0),
        min(best, default=None),
    )


# A first plan on a grid finds memory and caches cold: one that does not count.
WARM_S = 0.02


@dataclass(frozen=True, slots=True)
class Setting:
    """What is planned, and how.

    Attributes:
        end: "anywhere" or "home".
        cost: "steps", turns being free, or "turns".
        variant: what perturbs, see ``harness.planner_for``.
    """

    end: str
    cost: str
    variant: str

    @property
    def closed(self) -> bool:
        """Whether walks end where they begin."""
        return self.end == "home"

    @property
    def counts_turns(self) -> bool:
        """Whether walks are to have few turns, too."""
        return self.cost == "turns"


@dataclass(frozen=True, slots=True)
class QualityPlan:
    """What to measure: every setting, with every budget and seed, on every grid.

    Attributes:
        grids: names or files of grids.
        settings: what is planned.
        budgets: seconds to plan for.
        seeds: how many, from 0 on.
        turn_s: a quarter-turn [s], where a step takes one.
        results: what other planners reached; None for nothing to compare with.
    """

    grids: tuple[str, ...]
    settings: tuple[Setting, ...]
    budgets: tuple[float, ...]
    seeds: int
    turn_s: float
    results: Path | None


@dataclass(frozen=True, slots=True)
class QualityRun:
    """One plan.

    Attributes:
        grid: name of the grid.
        cells: cells to cover.
        known: what is known of walks on it that end as this one does.
        setting: what was planned.
        budget_s: how long it was to take [s].
        seed: of all random streams.
        steps, revisits, turns_90, turns_180: of the walk, counted by the judge.
        mission_s: time [s] with turns at their price, whatever was planned.
        bound: the search's own lower bound of steps.
        first_walk_s: time to the first complete walk [s].
        wall_s: time until the path was there [s].
        work: what the search did.
    """

    grid: str
    cells: int
    known: Known
    setting: Setting
    budget_s: float
    seed: int
    steps: int
    revisits: int
    turns_90: int
    turns_180: int
    mission_s: float
    bound: int
    first_walk_s: float
    wall_s: float
    work: SearchWork


def measure(plan: QualityPlan, say: Say) -> Generator[QualityRun, None, None]:
    """Yield every run, kernels warm; each seed goes over all grids before the next one does.

    Raises:
        FasacoError: a grid or the results cannot be read, or are of different grids.
        WrongWalkError: a walk is not legal, not complete, or shorter than can be.
    """
    check_names(plan.grids)
    references = read_references(plan.results)
    grids = [read_grid(grid) for grid in plan.grids]
    about = [_known_of(grid, references.get(grid_name(grid.name), UNKNOWN)) for grid in grids]
    say("loading kernels")
    warm_up()
    for grid, setting in itertools.product(grids, plan.settings):
        say(f"{grid_name(grid.name)}: warming up")
        _timed(_pose(grid, setting, plan.turn_s), setting, 0, WARM_S)
    for seed in range(plan.seeds):
        for grid, reference in zip(grids, about, strict=True):
            say(f"seed {seed}: {grid_name(grid.name)}")
            for setting, budget_s in itertools.product(plan.settings, plan.budgets):
                yield _run(grid, reference, setting, plan.turn_s, seed, budget_s)


def _known_of(grid: NamedGrid, reference: Reference) -> Reference:
    """Return ``reference`` if it can be of this grid.

    Raises:
        BadConfiguration: it is of another, with more cells or fewer; or there is nothing
            to compare, since a walk over one cell has no steps.
    """
    cells = CoverageProblem.of(grid.lattice, grid.start).cells
    if cells < 2:
        raise BadConfiguration(f"{grid_name(grid.name)} has one cell only: no walk to measure")
    if reference.cells not in (None, cells):
        raise BadConfiguration(
            f"{grid_name(grid.name)} has {cells} cells, in the results {reference.cells}",
            hint="name the results of these grids, or none",
        )
    return reference


def _pose(grid: NamedGrid, setting: Setting, turn_s: float) -> CoverageProblem:
    cost = CoverageCost(1.0, turn_s) if setting.counts_turns else STEPS_ALONE
    end = grid.start if setting.closed else None
    return CoverageProblem.of(grid.lattice, grid.start, end=end, cost=cost)


def _timed(
    problem: CoverageProblem, setting: Setting, seed: int, budget_s: float
) -> tuple[CoveragePath, float]:
    """Return a path and after what time it was there [s]."""
    planner = planner_for(seed, setting.variant)
    began = time.perf_counter()
    path = planner.plan(problem, TimeBudget(budget_s))
    return path, time.perf_counter() - began


def _run(
    grid: NamedGrid,
    reference: Reference,
    setting: Setting,
    turn_s: float,
    seed: int,
    budget_s: float,
) -> QualityRun:
    problem = _pose(grid, setting, turn_s)
    path, wall_s = _timed(problem, setting, seed, budget_s)
    verdict = judged(problem, path)
    name, known = grid_name(grid.name), reference.of(setting.closed)
    if verdict.steps < max(known.bound, known.optimum or 0):
        raise WrongWalkError(f"{name}: {verdict.steps} steps, fewer than are proven to be needed")
    if known.best_steps is not None and path.lower_bound_steps > known.best_steps:
        raise WrongWalkError(
            f"{name}: the bound, {path.lower_bound_steps}, is above a walk of {known.best_steps}"
        )
    quarters = verdict.turns_90 + 2 * verdict.turns_180
    return QualityRun(
        grid=name,
        cells=problem.cells,
        known=known,
        setting=setting,
        budget_s=budget_s,
        seed=seed,
        steps=verdict.steps,
        revisits=verdict.revisits,
        turns_90=verdict.turns_90,
        turns_180=verdict.turns_180,
        mission_s=verdict.steps + turn_s * quarters,
        bound=path.lower_bound_steps,
        first_walk_s=path.first_walk_s,
        wall_s=wall_s,
        work=path.work,
    )
