"""``benchmarks quality``: cost of plans over that of the best known walks, by time budget."""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    ResultTable,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
)
from fasaco_edge.bench.spread import Spread
from fasaco_edge.host.processes import peak_mb
from tests.benchmarks.harness import SECONDS
from tests.benchmarks.quality.figures import VARIANTS, GridFigures, by_grid, goals
from tests.benchmarks.quality.runs import QualityPlan, QualityRun, Setting, measure

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement", "warehouse")


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FILE.json",
        help="results of other planners by the grid's name: results {planner: {full, steps, "
        "turns_90, turns_180, returns_home}}, proven_optimum {open_steps, closed_steps}, bounds; "
        "without a file, ratios are to the search's own lower bound",
    )
    parser.add_argument(
        "--budgets",
        nargs="+",
        type=seconds_above_zero,
        default=[0.02, 0.1, 1.0],
        metavar="S",
        help="time budgets of a plan [s] (default: 0.02 0.1 1; there is a goal for 10, too)",
    )
    parser.add_argument(
        "--seeds",
        type=positive,
        default=10,
        metavar="N",
        help="use seeds 0 to N - 1 (default: %(default)s)",
    )
    _add_choice(parser, "--end", ("anywhere", "home"), ["anywhere"], "where walks end")
    _add_choice(
        parser,
        "--cost",
        ("steps", "turns"),
        ["steps", "turns"],
        "cost to minimise: steps alone, or time with turns",
    )
    parser.add_argument(
        "--turn-s",
        type=SECONDS,
        default=1.5,
        metavar="S",
        help="time of a quarter-turn [s]; a step takes 1 s, a half turn two quarter-turns "
        "(default: %(default)g, as in the goals)",
    )
    _add_choice(
        parser,
        "--variants",
        ("ants", "flat", "none"),
        ["ants"],
        "perturbations of the walk: half of them by ants on their trail; by ants on a uniform "
        "trail; or without ants",
    )


def _add_choice(
    parser: argparse.ArgumentParser, name: str, among: tuple[str, ...], default: list[str], say: str
) -> None:
    parser.add_argument(
        name,
        nargs="+",
        choices=among,
        default=default,
        help=f"{say} (default: {' '.join(default)})",
    )


def _names(args: argparse.Namespace) -> tuple[str, ...]:
    return grid_names(args, DEFAULT_MAPS)


def _count(args: argparse.Namespace) -> int:
    choices = (args.end, args.cost, args.variants, args.budgets)
    return math.prod((len(_names(args)), args.seeds, *(len(set(choice)) for choice in choices)))


def _measure(args: argparse.Namespace, say: Say) -> Generator[QualityRun, None, None]:
    settings = itertools.product(*map(dict.fromkeys, (args.end, args.cost, args.variants)))
    plan = QualityPlan(
        grids=_names(args),
        settings=tuple(Setting(*chosen) for chosen in settings),
        budgets=tuple(sorted(set(args.budgets))),
        seeds=args.seeds,
        turn_s=args.turn_s,
        results=args.results,
    )
    return measure(plan, say)


SUMMARY_HEADER = (
    "", "budget\n[s]", "steps\nmedian", "\nworst", "time\nmedian", "\nworst", "over\n[ms]",
)  # fmt: skip
HEADER = (
    "grid,\nbudget", "steps", "gap\n[%]", "steps\nto best", "turns\n90/180", "time\n[s]",
    "time\nto best", "first,\nover\n[ms]",
)  # fmt: skip
KNOWN_HEADER = ("grid", "cells", "bound", "best\nsteps", "", "best\ntime [s]", "")
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


QUALITY = Benchmark(
    name="quality",
    summary="cost of plans over that of the best known walks, by time budget",
    description="Plan with colony-search on each grid, with each budget and seed, on one thread, "
    "with kernels loaded. A judge that shares no code with the planner compares every walk with "
    "the best known walk, the search's own lower bound, and the best of other planners by mission "
    "time. Results are medians over the seeds, and below them the worst. A ratio of 1.005 is half "
    "a percent above the best known walk; below 1 it is better than all other planners.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=lambda args, runs: report(args.turn_s, args.seeds, runs),
    epilog="""\
examples:
  python -m tests.benchmarks quality
  python -m tests.benchmarks quality --maps office --budgets 0.02 0.1 1 10 --cost steps
  python -m tests.benchmarks quality --grids *.npy --results results.json
  python -m tests.benchmarks quality --end home --cost steps --budgets 1 --json
  python -m tests.benchmarks quality --variants ants flat none
""",
)
