"""Plans with costly turns: tours over public instances, and walks over maps at several prices.

A folder of instances has ``grids.npz``, a bool array of free cells for each name, and
``results.json``, known costs of tours with 1 s per step and 50 s per quarter-turn::

    {"grid_1": {"tour_best": 7786.0, "tour_approximation": 8254.0, "tour_lower_bound": 7784.0}}

A tour also turns at its start, where it ends; a planned walk home need not. So the judge adds this
last turn. Budgets are processor time, so other load on the computer does not change results.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.grids import read_grid
from fasaco_edge.planners.paper.baselines import spiral_stc, stc, zigzag
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import ProcessorBudget, WrongWalkError, grid_name, judged, planner_for

# Of the instances, in steps a quarter-turn.
TOUR_PRICE = 50.0
# Beside what is known of instances: the cheapest simple walk over a map.
SIMPLE = "simple"
# Sides that a visit passes straight between, as step masks.
STRAIGHT = (1 << EAST | 1 << WEST, 1 << NORTH | 1 << SOUTH)
# A first plan on a ground finds memory and caches cold: one that does not count.
WARM_S = 0.01


@dataclass(frozen=True, slots=True)
class TurnsPlan:
    """What to measure.

    Attributes:
        instances: folder of instances; None for none.
        every: take each so manieth instance, from number ``first`` on.
        first: number of the first one.
        grids: names or files of grids.
        prices: of a quarter-turn on these, in steps.
        budgets: to plan for [s].
        seed: of all random streams.
    """

    instances: Path | None
    every: int
    first: int
    grids: tuple[str, ...]
    prices: tuple[float, ...]
    budgets: tuple[float, ...]
    seed: int

    @property
    def count(self) -> int:
        """How many runs it takes."""
        tours = 0 if self.instances is None else len(_chosen(self, self.instances))
        return len(self.budgets) * (tours + len(self.grids) * len(self.prices))


@dataclass(frozen=True, slots=True)
class TurnsRun:
    """One plan, judged.

    Attributes:
        ground: name of the instance or grid.
        cells: cells to cover.
        is_tour: whether it is an instance.
        price: of a quarter-turn, in steps.
        budget_s: it was to take [s].
        cost_s: what the walk costs, with a tour's last turn [s].
        bound_s: what no walk costs less than, by the search, with a tour's last turn [s].
        gap: of the walk to that bound, as the search says.
        best_s, approximation_s: of an instance: the best known tour, and the authors' own
            approximation [s]; None where nobody knows.
        simple_s: the cheapest of simple walks over a map, spirals and sweeps [s]; None for tours.
        first_walk_s, wall_s: time to the first walk and until the path was there [s].
    """

    ground: str
    cells: int
    is_tour: bool
    price: float
    budget_s: float
    cost_s: float
    bound_s: float
    gap: float
    best_s: float | None
    approximation_s: float | None
    simple_s: float | None
    first_walk_s: float
    wall_s: float


def measure(plan: TurnsPlan, say: Say) -> Generator[TurnsRun, None, None]:
    """Yield every run, kernels warm.

    Raises:
        FasacoError: a grid or the instances cannot be read.
        WrongWalkError: a walk is not legal, not complete, or cheaper than can be.
    """
    posed = [*_tours(plan), *_walks(plan)]
    say("loading kernels")
    warm_up()
    for name, problem, known in posed:
        say(f"{name}: warming up")
        planner_for(plan.seed).plan(problem, ProcessorBudget(WARM_S))
        for budget_s in plan.budgets:
            say(f"{name}: {budget_s:g} s")
            yield _run(name, problem, known, budget_s, plan.seed)


def _run(
    name: str, problem: CoverageProblem, known: dict[str, Any], budget_s: float, seed: int
) -> TurnsRun:
    began = time.perf_counter()
    path = planner_for(seed).plan(problem, ProcessorBudget(budget_s))
    wall_s = time.perf_counter() - began
    judged(problem, path)
    cost_s, bound_s, best_s = path.cost_s, path.lower_bound_cost_s, known.get("tour_best")
    price = problem.cost.quarter_turn_s
    if problem.closed:
        cost_s += price * _quarters_at_the_end(path.cells)
        bound_s += price * _least_quarters_at_the_end(problem)
    if best_s is not None and bound_s > best_s + 1e-6:
        raise WrongWalkError(f"{name}: the bound, {bound_s}, is above {best_s}")
    return TurnsRun(
        ground=name,
        cells=problem.cells,
        is_tour=problem.closed,
        price=price,
        budget_s=budget_s,
        cost_s=cost_s,
        bound_s=bound_s,
        gap=path.gap or 0.0,
        best_s=best_s,
        approximation_s=known.get("tour_approximation"),
        simple_s=known.get(SIMPLE),
        first_walk_s=path.first_walk_s,
        wall_s=wall_s,
    )


def _quarters_at_the_end(cells: NDArray[np.int32]) -> int:
    """Return the quarter-turns between the last step of a tour and the first one."""
    last, first = cells[-1] - cells[-2], cells[1] - cells[0]
    return 1 - int(last @ first)


def _least_quarters_at_the_end(problem: CoverageProblem) -> int:
    """Return how many quarter-turns every tour makes where it ends and begins."""
    sides = int(problem.lattice.steps[problem.lattice.local(problem.start)])
    if sides & (sides - 1) == 0:
        return 2
    leads_through = any(sides & line == line for line in STRAIGHT)
    return 0 if leads_through else 1


def _tours(plan: TurnsPlan) -> Iterator[tuple[str, CoverageProblem, dict[str, Any]]]:
    if plan.instances is None:
        return
    known = _results(plan.instances)
    try:
        with np.load(plan.instances / "grids.npz", allow_pickle=False) as grids:
            floors = {name: grids[name].astype(bool) for name in _chosen(plan, plan.instances)}
    except (OSError, ValueError, KeyError) as error:
        raise BadConfiguration(f"cannot read grids.npz in {plan.instances}: {error}") from error
    for name, floor in floors.items():
        row, col = _start(floor)
        cost = CoverageCost(1.0, TOUR_PRICE)
        ground = CoverageLattice.from_free(floor)
        problem = CoverageProblem.of(ground, (row, col), end=(row, col), cost=cost)
        yield name, problem, known[name]


def _start(floor: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the cell to begin a tour in: a dead end, if there is any.

    There every tour turns back, so the last turn, which the planner does not count, is the same
    for all of them. Elsewhere a planned walk may save a turn that its tour then pays.
    """
    around = np.pad(floor, 1).astype(int)
    ways = around[2:, 1:-1] + around[:-2, 1:-1] + around[1:-1, 2:] + around[1:-1, :-2]
    dead_ends = np.argwhere(floor & (ways == 1))
    row, col = (dead_ends if dead_ends.size else np.argwhere(floor))[0].tolist()
    return row, col


def _walks(plan: TurnsPlan) -> Iterator[tuple[str, CoverageProblem, dict[str, Any]]]:
    grids = [read_grid(name) for name in plan.grids]
    for grid, price in itertools.product(grids, plan.prices):
        problem = CoverageProblem.of(grid.lattice, grid.start, cost=CoverageCost(1.0, price))
        simple_s = min(planner.plan(problem).cost_s for planner in (stc(), spiral_stc(), zigzag()))
        yield grid_name(grid.name), problem, {SIMPLE: simple_s}


def _chosen(plan: TurnsPlan, folder: Path) -> list[str]:
    return sorted(_results(folder))[plan.first :: plan.every]


def _results(folder: Path) -> dict[str, dict[str, Any]]:
    try:
        known = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"cannot read results.json in {folder}: {error}") from error
    if not isinstance(known, dict) or not all(isinstance(each, dict) for each in known.values()):
        raise BadConfiguration(f"results.json in {folder} must map names to objects")
    return known
