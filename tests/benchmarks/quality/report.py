"""Runs to tables: a summary, one for each setting, and what the ants are worth."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from fasaco_edge.bench.benchmark import Report, ResultTable
from fasaco_edge.bench.machine import machine, peak_mb
from fasaco_edge.drawing.spread import Spread
from tests.benchmarks.quality.figures import GridFigures, by_grid, goals
from tests.benchmarks.quality.runs import QualityRun, Setting

SUMMARY_HEADER = (
    "", "budget\n[s]", "steps\nmedian", "\nworst", "time\nmedian", "\nworst", "over\n[ms]",
)  # fmt: skip
HEADER = (
    "grid,\nbudget", "steps", "gap\n[%]", "steps\nto best", "turns\n90/180", "time\n[s]",
    "time\nto best", "first,\nover\n[ms]",
)  # fmt: skip
KNOWN_HEADER = ("grid", "cells", "bound", "best\nsteps", "", "best\ntime [s]", "")
VARIANTS = {
    "ants": "with ants",
    "flat": "restarts without pheromone",
    "never": "without ants",
}

REMARKS = (
    "Above the median over the seeds, below the worst; of turns quarter-turns above, half turns "
    "below, medians. gap: to the search's own lower bound. best: the best steps known, and the "
    "best planner's time; where there are none, the lower bound. time: a second a step, turns "
    "at the price of --turn-s. first: to the first complete walk, the median; over: by how much "
    "the slowest run exceeded its budget.",
    "Every walk was judged legal and complete by code that shares nothing with the planner.",
)


def report(turn_s: float, seeds: int, runs: Sequence[QualityRun]) -> Report:
    """Sum up any number of runs, even none."""
    figures = by_grid(runs)
    settings = list(dict.fromkeys(grid.setting for grid in figures))
    # Of the other variants the last tables say enough.
    shown = [one for one in settings if one.variant == "ants" or len(settings) == 1]
    tables = [
        *_known_tables(figures, turn_s),
        *(_setting_table(setting, figures, turn_s) for setting in shown),
        *_variant_tables(figures, turn_s),
    ]
    return Report(
        title=f"ratios to the best over all grids, {seeds} seeds, one thread",
        header=SUMMARY_HEADER,
        rows=tuple(_summary_rows(figures, settings, turn_s)),
        figures={
            "seeds": seeds,
            "turn_s": turn_s,
            "grids": [grid.document(turn_s) for grid in figures],
            "peak_rss_mb": peak_mb(),
            "machine": machine(),
        },
        goals=tuple(goals(figures, turn_s)),
        remarks=(*REMARKS, f"peak memory of this process {peak_mb()} MB"),
        further=tuple(tables),
    )


def _summary_rows(
    figures: Sequence[GridFigures], settings: Sequence[Setting], turn_s: float
) -> Iterator[tuple[str, ...]]:
    """Yield rows of ratios: medians over seeds, of these the median and worst over grids."""
    for setting in settings:
        mine = [grid for grid in figures if grid.setting == setting]
        for budget_s in sorted({grid.budget_s for grid in mine}):
            at = [grid for grid in mine if grid.budget_s == budget_s]
            # Ratios to rivals and to bounds do not mix; without any rival the bounds have to do.
            solved = [grid for grid in at if grid.known.best_steps is not None] or at
            walked = [grid for grid in at if grid.known.walks] or at
            steps = [grid.ratio.median for grid in solved]
            times = [grid.mission_ratio(turn_s).median for grid in walked]
            yield (
                _name(setting),
                f"{budget_s:g}",
                *_median_and_worst(steps, 4),
                *_median_and_worst(times, 3),
                _over_ms(max(at, key=lambda grid: grid.overshoot_s)),
            )


def _median_and_worst(values: Sequence[float], digits: int) -> tuple[str, str]:
    return f"{statistics.median(values):.{digits}f}", f"{max(values):.{digits}f}"


def _known_tables(figures: Sequence[GridFigures], turn_s: float) -> Iterator[ResultTable]:
    """Yield a table for each kind of end: what the walks are measured against."""
    for end in dict.fromkeys(grid.setting.end for grid in figures):
        grids = {grid.grid: grid for grid in figures if grid.setting.end == end}
        rows = tuple(_known_row(grid, turn_s) for grid in grids.values())
        yield ResultTable(f"what is known of walks that end {_at(end)}", KNOWN_HEADER, rows)


def _known_row(grid: GridFigures, turn_s: float) -> tuple[str, ...]:
    known, first = grid.known, grid.runs[0]
    quickest = known.quickest(turn_s)
    return (
        grid.grid,
        str(first.cells),
        str(first.bound),
        "-" if known.best_steps is None else str(known.best_steps),
        "proven" if known.optimum is not None else "",
        "-" if quickest is None else f"{quickest.mission_s(turn_s):g}",
        "" if quickest is None else quickest.planner,
    )


def _setting_table(setting: Setting, figures: Sequence[GridFigures], turn_s: float) -> ResultTable:
    rows = tuple(_row(grid, turn_s) for grid in figures if grid.setting == setting)
    return ResultTable(_name(setting), HEADER, rows)


def _row(grid: GridFigures, turn_s: float) -> tuple[str, ...]:
    quarter, half = grid.turns
    return (
        f"{grid.grid}\n{grid.budget_s:g} s",
        _two(grid.steps),
        _two(grid.gap, ".2f", 100.0),
        _two(grid.ratio, ".4f"),
        f"{quarter.median:g}\n{half.median:g}",
        _two(grid.mission_s),
        _two(grid.mission_ratio(turn_s), ".3f"),
        f"{1e3 * grid.first_walk_s.median:.2f}\n{_over_ms(grid)}",
    )


def _over_ms(grid: GridFigures) -> str:
    # A search that has proven its walk to be the best ends early.
    return f"{1e3 * max(grid.overshoot_s, 0.0):.1f}"


def _two(spread: Spread, style: str = "g", unit: float = 1.0) -> str:
    """Return the median, and below it the worst."""
    return f"{unit * spread.median:{style}}\n{unit * spread.high:{style}}"


def _variant_tables(figures: Sequence[GridFigures], turn_s: float) -> Iterator[ResultTable]:
    """Yield a table for each kind of problem, if it was solved with ants and without."""
    variants = list(dict.fromkeys(grid.setting.variant for grid in figures))
    if len(variants) < 2:
        return
    for end, cost in dict.fromkeys((grid.setting.end, grid.setting.cost) for grid in figures):
        found: dict[tuple[str, float], dict[str, str]] = {}
        for grid in figures:
            if (grid.setting.end, grid.setting.cost) == (end, cost):
                ratio = grid.mission_ratio(turn_s) if cost == "turns" else grid.ratio
                row = found.setdefault((grid.grid, grid.budget_s), {})
                row[grid.setting.variant] = _two(ratio, ".4f")
        yield ResultTable(
            f"what the ants are worth: {'time' if cost == 'turns' else 'steps'} to the best, "
            f"end {_at(end)}",
            ("grid", "budget [s]", *(VARIANTS[variant] for variant in variants)),
            tuple(
                (grid, f"{budget_s:g}", *(row.get(variant, "-") for variant in variants))
                for (grid, budget_s), row in found.items()
            ),
        )


def _name(setting: Setting) -> str:
    variant = "" if setting.variant == "ants" else f", {VARIANTS[setting.variant]}"
    cost = "steps and turns" if setting.counts_turns else "steps alone"
    return f"{cost}, end {_at(setting.end)}{variant}"


def _at(end: str) -> str:
    return "at home" if end == "home" else end
