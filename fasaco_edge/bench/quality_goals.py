"""What the planner's walks are to reach; of the goals, those that were measured."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence

from fasaco_edge.bench.benchmark import Goal
from fasaco_edge.bench.quality_figures import GridFigures
from fasaco_edge.bench.quality_runs import Setting
from fasaco_edge.bench.table1_paper import paper_map

OPEN = Setting("anywhere", "steps", "ants")
CLOSED = Setting("home", "steps", "ants")
TURNS = Setting("anywhere", "turns", "ants")

# By budget [s]: most steps, as a multiple of the best known, in the median over seeds.
MOST_STEPS = {0.02: 1.02, 0.1: 1.01, 1.0: 1.005, 10.0: 1.002}
# The same of the worst seed, and the budget in which an optimum is to be found.
WORST_SEED = {1.0: 1.01}
OPTIMUM_BUDGET_S = 1.0
# On the paper's grids, revisits of a closed walk.
CLOSED_BUDGET_S, CLOSED_REVISITS = 1.0, {"paper_simulated": 46, "paper_basement": 55}
# By budget: most time, as a multiple of the best planner's, in the median over grids.
MISSION_TURN_S, MOST_TIME = 1.5, {0.1: 0.87, 1.0: 0.84}
# On no grid is it to be more than the best planner's.
NEVER_WORSE_BUDGET_S = 0.1


def goals(figures: Sequence[GridFigures], turn_s: float) -> Iterator[Goal]:
    """Yield the goals that ``figures`` have something to say on."""
    for budget_s in sorted({grid.budget_s for grid in figures}):
        at = [grid for grid in figures if grid.budget_s == budget_s]
        yield from _open_goals([grid for grid in at if grid.setting == OPEN], budget_s)
        yield from _closed_goals([grid for grid in at if grid.setting == CLOSED], budget_s)
        if turn_s == MISSION_TURN_S:
            turns = [grid for grid in at if grid.setting == TURNS and grid.known.walks]
            yield from _mission_goals(turns, budget_s)


def _open_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[Goal]:
    known = [grid for grid in at if grid.known.best_steps is not None]
    what = f"open walk, {budget_s:g} s: steps to the best known"
    if known and budget_s in MOST_STEPS:
        yield _worst(f"{what}, median", known, lambda grid: grid.ratio.median, MOST_STEPS[budget_s])
    if known and budget_s in WORST_SEED:
        yield _worst(
            f"{what}, worst seed", known, lambda grid: grid.ratio.high, WORST_SEED[budget_s]
        )
    proven = [grid for grid in known if grid.known.optimum is not None]
    if proven and budget_s == OPTIMUM_BUDGET_S:
        what = f"open walk, {budget_s:g} s: steps above the proven optimum, median"
        yield _worst(what, proven, _above_optimum, 0.0)


def _above_optimum(grid: GridFigures) -> float:
    assert grid.known.optimum is not None
    return grid.steps.median - grid.known.optimum


def _closed_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[Goal]:
    for grid in at if budget_s == CLOSED_BUDGET_S else ():
        if paper_map(grid.grid, grid.runs[0].cells):
            what = f"closed walk, {budget_s:g} s: n_r_paper, {grid.grid}"
            yield Goal(what, grid.revisits.median, CLOSED_REVISITS[grid.grid])


def _mission_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[Goal]:
    ratios = {grid.grid: grid.mission_ratio(MISSION_TURN_S).median for grid in at}
    what = f"mission time, {budget_s:g} s: to the best planner's"
    if at and budget_s == NEVER_WORSE_BUDGET_S:
        yield _worst(what, at, lambda grid: ratios[grid.grid], 1.0)
    if at and budget_s in MOST_TIME:
        median = statistics.median(ratios.values())
        yield Goal(f"{what}, median of {_count(at)}", median, MOST_TIME[budget_s])


def _worst(
    what: str, at: Sequence[GridFigures], figure: Callable[[GridFigures], float], limit: float
) -> Goal:
    """Return a goal that every grid has to reach, measured on that which does worst."""
    worst = max(at, key=figure)
    return Goal(f"{what}, worst of {_count(at)} ({worst.grid})", figure(worst), limit)


def _count(at: Sequence[GridFigures]) -> str:
    return f"{len(at)} grids" if len(at) > 1 else "1 grid"
