"""Figures of runs with one setting and budget on one grid over all seeds, and goals for them."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from fasaco_edge.bench.benchmark import MeasuredGoal
from fasaco_edge.bench.spread import Spread
from tests.benchmarks.quality.runs import Known, QualityRun, Setting
from tests.benchmarks.table1.paper import paper_map

# What perturbs, as the tables have it.
VARIANTS = {
    "ants": "with ants",
    "flat": "ants on a uniform trail",
    "none": "without ants",
}


@dataclass(frozen=True)
class GridFigures:
    """The runs on a grid that differ in nothing but the seed; one at least."""

    runs: tuple[QualityRun, ...]

    @property
    def grid(self) -> str:
        """The grid's name."""
        return self.runs[0].grid

    @property
    def known(self) -> Known:
        """What others know of it."""
        return self.runs[0].known

    @property
    def setting(self) -> Setting:
        """What was planned."""
        return self.runs[0].setting

    @property
    def budget_s(self) -> float:
        """How long each run was to take [s]."""
        return self.runs[0].budget_s

    @property
    def steps_to_beat(self) -> int:
        """Steps of the best walk known; where none is known, the search's lower bound."""
        return self.known.best_steps or self.runs[0].bound

    @cached_property
    def steps(self) -> Spread:
        """Steps."""
        return self._spread([run.steps for run in self.runs])

    @cached_property
    def revisits(self) -> Spread:
        """Visits beyond each cell's first; of walks that end at home it is n_r_paper."""
        return self._spread([run.revisits for run in self.runs])

    @cached_property
    def gap(self) -> Spread:
        """How much longer than its bound a walk is."""
        return self._spread([run.steps / run.bound - 1.0 for run in self.runs])

    @cached_property
    def ratio(self) -> Spread:
        """Steps to ``steps_to_beat``."""
        return self._spread([run.steps / self.steps_to_beat for run in self.runs])

    @cached_property
    def mission_s(self) -> Spread:
        """Time with turns at their price [s]."""
        return self._spread([run.mission_s for run in self.runs])

    @cached_property
    def turns(self) -> tuple[Spread, Spread]:
        """Quarter-turns and half turns."""
        return (
            self._spread([run.turns_90 for run in self.runs]),
            self._spread([run.turns_180 for run in self.runs]),
        )

    def mission_to_beat(self, turn_s: float) -> float:
        """Return the best planner's time [s]; where there is none, that of the bound's steps."""
        quickest = self.known.quickest(turn_s)
        return float(self.runs[0].bound) if quickest is None else quickest.mission_s(turn_s)

    def mission_ratio(self, turn_s: float) -> Spread:
        """Return the time to that of the best planner."""
        to_beat = self.mission_to_beat(turn_s)
        return self._spread([run.mission_s / to_beat for run in self.runs])

    @cached_property
    def first_walk_s(self) -> Spread:
        """Time to the first complete walk [s]."""
        return self._spread([run.first_walk_s for run in self.runs])

    @cached_property
    def overshoot_s(self) -> float:
        """By how much the slowest run exceeded its budget [s]; negative where none did."""
        return max(run.wall_s - run.budget_s for run in self.runs)

    def document(self, turn_s: float) -> dict[str, Any]:
        """Return this as JSON values."""
        quickest = self.known.quickest(turn_s)
        quarter, half = self.turns
        return {
            "grid": self.grid,
            "cells": self.runs[0].cells,
            **asdict(self.setting),
            "budget_s": self.budget_s,
            "seeds": len(self.runs),
            "lower_bound_steps": self.runs[0].bound,
            "best_known_steps": self.known.best_steps,
            "proven_optimum_steps": self.known.optimum,
            "best_planner": quickest and quickest.planner,
            "best_planner_mission_s": quickest and quickest.mission_s(turn_s),
            "steps": self.steps.document(),
            "steps_by_seed": [run.steps for run in self.runs],
            "revisits": self.revisits.document(),
            "gap": self.gap.document(),
            "ratio_steps": self.ratio.document(),
            "turns_90": quarter.document(),
            "turns_180": half.document(),
            "mission_s": self.mission_s.document(),
            "mission_s_by_seed": [run.mission_s for run in self.runs],
            "ratio_mission": self.mission_ratio(turn_s).document(),
            "first_walk_s": self.first_walk_s.document(),
            "wall_s": self._spread([run.wall_s for run in self.runs]).document(),
            "overshoot_s": round(self.overshoot_s, 6),
            "work": {
                name: self._spread([getattr(run.work, name) for run in self.runs]).median
                for name in ("ants", "perturbations", "proposals")
            },
        }

    @staticmethod
    def _spread(values: Sequence[float]) -> Spread:
        spread = Spread.of(values)
        assert spread is not None
        return spread


def by_grid(runs: Sequence[QualityRun]) -> tuple[GridFigures, ...]:
    """Return the runs, put together setting by setting, grid by grid, budget by budget."""
    settings = list(dict.fromkeys(run.setting for run in runs))
    grids = list(dict.fromkeys(run.grid for run in runs))
    together: dict[tuple[int, int, float], list[QualityRun]] = {}
    for run in runs:
        key = (settings.index(run.setting), grids.index(run.grid), run.budget_s)
        together.setdefault(key, []).append(run)
    return tuple(GridFigures(tuple(together[key])) for key in sorted(together))


OPEN = Setting("anywhere", "steps", "ants")
CLOSED = Setting("home", "steps", "ants")
TURNS = Setting("anywhere", "turns", "ants")

# By budget [s]: most steps, as a multiple of the best known, in the median over seeds.
MOST_STEPS = {0.02: 1.02, 0.1: 1.01, 1.0: 1.005, 10.0: 1.002}
# The same of the worst seed, and the budget in which an optimum is to be found.
WORST_SEED = {1.0: 1.01}
OPTIMUM_BUDGET_S = 1.0
# Budget of closed walks on the paper's grids [s].
CLOSED_BUDGET_S = 1.0
# Most revisits of such a walk.
CLOSED_REVISITS = {"paper_simulated": 46, "paper_basement": 55}
# Time of a quarter-turn in missions [s].
MISSION_TURN_S = 1.5
# Most time by budget, relative to the best planner, in the median over grids.
MOST_TIME = {0.1: 0.87, 1.0: 0.84}
# On no grid is it to be more than the best planner's.
NEVER_WORSE_BUDGET_S = 0.1


def goals(figures: Sequence[GridFigures], turn_s: float) -> Iterator[MeasuredGoal]:
    """Yield the goals that ``figures`` have something to say on."""
    for budget_s in sorted({grid.budget_s for grid in figures}):
        at = [grid for grid in figures if grid.budget_s == budget_s]
        yield from _open_goals([grid for grid in at if grid.setting == OPEN], budget_s)
        yield from _closed_goals([grid for grid in at if grid.setting == CLOSED], budget_s)
        if turn_s == MISSION_TURN_S:
            turns = [grid for grid in at if grid.setting == TURNS and grid.known.walks]
            yield from _mission_goals(turns, budget_s)


def _open_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[MeasuredGoal]:
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


def _closed_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[MeasuredGoal]:
    for grid in at if budget_s == CLOSED_BUDGET_S else ():
        if paper_map(grid.grid, grid.runs[0].cells):
            what = f"closed walk, {budget_s:g} s: n_r_paper, {grid.grid}"
            yield MeasuredGoal(what, grid.revisits.median, CLOSED_REVISITS[grid.grid])


def _mission_goals(at: Sequence[GridFigures], budget_s: float) -> Iterator[MeasuredGoal]:
    ratios = {grid.grid: grid.mission_ratio(MISSION_TURN_S).median for grid in at}
    what = f"mission time, {budget_s:g} s: to the best planner's"
    if at and budget_s == NEVER_WORSE_BUDGET_S:
        yield _worst(what, at, lambda grid: ratios[grid.grid], 1.0)
    if at and budget_s in MOST_TIME:
        median = statistics.median(ratios.values())
        yield MeasuredGoal(f"{what}, median of {_count(at)}", median, MOST_TIME[budget_s])


def _worst(
    what: str, at: Sequence[GridFigures], figure: Callable[[GridFigures], float], limit: float
) -> MeasuredGoal:
    """Return a goal that every grid has to reach, measured on that which does worst."""
    worst = max(at, key=figure)
    return MeasuredGoal(f"{what}, worst of {_count(at)} ({worst.grid})", figure(worst), limit)


def _count(at: Sequence[GridFigures]) -> str:
    return f"{len(at)} grids" if len(at) > 1 else "1 grid"
