"""Plans of several budgets, costs and ends on each grid, each judged."""

from __future__ import annotations

import itertools
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.bench.grids import NamedGrid, read_grid
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.stopping import SearchWork, TimeBudget
from fasaco_edge.planners.warmup import warm_up
from tests.benchmarks.planner import WrongWalkError, judged, planner_for
from tests.benchmarks.quality.reference import UNKNOWN, Known, Reference, read_references
from tests.benchmarks.table1.runs import check_names, grid_name

# A first plan on a grid finds memory and caches cold: one that does not count.
WARM_S = 0.02


@dataclass(frozen=True, slots=True)
class Setting:
    """What is planned, and how.

    Attributes:
        end: "anywhere" or "home".
        cost: "steps", turns being free, or "turns".
        variant: what the search goes on from, as ``NearOptimal.restarts``.
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
