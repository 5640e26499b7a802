"""Runs of one setting and budget on one grid, over all seeds, in figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from fasaco_edge.bench.quality_reference import Known
from fasaco_edge.bench.quality_runs import QualityRun, Setting
from fasaco_edge.bench.spread import Spread


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
                for name in ("ants", "kicks", "proposals")
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
