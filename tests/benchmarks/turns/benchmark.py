"""``benchmarks turns``: quality of walks if turns cost, and of their lower bounds."""

from __future__ import annotations

import argparse
import itertools
import statistics
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from fasaco_edge.bench.benchmark import (
    Benchmark,
    MeasuredGoal,
    Report,
    ResultTable,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
)
from tests.benchmarks.harness import SECONDS
from tests.benchmarks.turns.runs import TurnsPlan, TurnsRun, measure

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement", "warehouse")

# Means over instances: cost to the best known, by budget [s]; the worst one; bound to best known.
TOUR_GOALS = {0.1: 1.012, 1.0: 1.003, 10.0: 0.998}
WORST_TOUR, WORST_AFTER_S = 1.03, 10.0
BOUND_GOAL = 0.95
# Medians of the certified gap of open walks, by price and budget [s].
GAP_GOALS = {(1.25, 0.1): 0.045, (1.25, 1.0): 0.03, (5.0, 1.0): 0.04, (50.0, 1.0): 0.06}

TOURS = ("budget [s]", "tours", "to best known", "median", "worst", "to approximation", "bound")
WALKS = (
    *("turn [steps]", "budget [s]", "walks", "certified gap, median", "worst"),
    *("to a simple walk", "worst", "wall [s]"),
)


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--instances",
        type=Path,
        metavar="FOLDER",
        help="folder of turn-cost instances, grids.npz and results.json (default: only maps)",
    )
    parser.add_argument(
        "--every", type=positive, default=1, metavar="N", help="use each N-th instance"
    )
    parser.add_argument(
        "--first", type=int, default=0, metavar="N", help="first instance (default: %(default)s)"
    )
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--no-maps", action="store_true", help="use only instances")
    parser.add_argument(
        "--prices",
        nargs="+",
        type=SECONDS,
        default=[0.0, 1.25, 5.0, 20.0, 50.0],
        metavar="STEPS",
        help="prices of a quarter-turn on maps, in steps (default: 0 1.25 5 20 50)",
    )
    parser.add_argument(
        "--budgets",
        nargs="+",
        type=seconds_above_zero,
        default=[0.02, 0.1, 1.0],
        metavar="S",
        help="processor time of a plan [s] (default: 0.02 0.1 1; there are goals for 10, too)",
    )
    parser.add_argument("--seed", type=int, default=0, help="(default: %(default)s)")


def _plan_of(args: argparse.Namespace) -> TurnsPlan:
    return TurnsPlan(
        instances=args.instances,
        every=args.every,
        first=args.first,
        grids=() if args.no_maps else grid_names(args, DEFAULT_MAPS),
        prices=tuple(args.prices),
        budgets=tuple(args.budgets),
        seed=args.seed,
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[TurnsRun, None, None]:
    yield from measure(_plan_of(args), say)


def report(args: argparse.Namespace, runs: Sequence[TurnsRun]) -> Report:
    """Sum up runs: tours over instances, walks over maps, and each ground by itself."""
    tours = [run for run in runs if run.is_tour and run.best_s]
    walks = [run for run in runs if not run.is_tour]
    each = tuple(
        (
            *(run.ground, str(run.cells), f"{run.price:g}", f"{run.budget_s:g}"),
            *(f"{run.cost_s:.1f}", f"{run.bound_s:.1f}", f"{run.gap:.2%}"),
            f"{run.cost_s / run.best_s:.4f}" if run.best_s else "-",
        )
        for run in runs
    )
    header = ("ground", "cells", "turn [steps]", "budget [s]", "cost [s]", "bound [s]", "gap")
    return Report(
        title="tours over instances, 50 steps a quarter-turn: means of cost to the best known",
        header=TOURS,
        rows=tuple(_tour_rows(tours)),
        figures={"runs": [asdict(run) for run in runs]},
        goals=tuple(_goals(tours, walks)),
        remarks=("bound: of the search, to the best known; judged by code of its own",),
        further=(
            ResultTable("open walks over maps", WALKS, tuple(_walk_rows(walks))),
            ResultTable("each ground", (*header, "to best known"), each),
        ),
    )


def _tour_rows(tours: Sequence[TurnsRun]) -> Iterator[tuple[str, ...]]:
    for budget_s, runs in _by(tours, lambda run: (run.budget_s,)):
        ratios = _ratios(runs)
        rough = [run.cost_s / run.approximation_s for run in runs if run.approximation_s]
        yield (
            *(f"{budget_s[0]:g}", str(len(runs)), f"{statistics.mean(ratios):.4f}"),
            *(f"{statistics.median(ratios):.4f}", f"{max(ratios):.4f}"),
            f"{statistics.mean(rough):.4f}" if rough else "-",
            f"{statistics.mean(_bounds(runs)):.4f}",
        )


def _walk_rows(walks: Sequence[TurnsRun]) -> Iterator[tuple[str, ...]]:
    for (price, budget_s), runs in _by(walks, lambda run: (run.price, run.budget_s)):
        gaps = [run.gap for run in runs]
        yield (
            *(f"{price:g}", f"{budget_s:g}", str(len(runs))),
            *(f"{statistics.median(gaps):.2%}", f"{max(gaps):.2%}"),
            *(f"{statistics.mean(_to_simple(runs)):.4f}", f"{max(_to_simple(runs)):.4f}"),
            f"{statistics.mean(run.wall_s for run in runs):.3f}",
        )


def _goals(tours: Sequence[TurnsRun], walks: Sequence[TurnsRun]) -> Iterator[MeasuredGoal]:
    for (budget_s,), runs in _by(tours, lambda run: (run.budget_s,)):
        if budget_s in TOUR_GOALS:
            mean = statistics.mean(_ratios(runs))
            yield MeasuredGoal(f"tours to best known, {budget_s:g} s", mean, TOUR_GOALS[budget_s])
        if budget_s == WORST_AFTER_S:
            yield MeasuredGoal(f"worst tour, {budget_s:g} s", max(_ratios(runs)), WORST_TOUR)
    if tours:
        bounds = statistics.mean(_bounds(tours))
        yield MeasuredGoal("bound to best known tour", bounds, BOUND_GOAL, at_least=True)
    for key, runs in _by(walks, lambda run: (run.price, run.budget_s)):
        if key in GAP_GOALS:
            gap = statistics.median(run.gap for run in runs)
            yield MeasuredGoal(
                f"certified gap at {key[0]:g} a turn, {key[1]:g} s", gap, GAP_GOALS[key]
            )
    if walks:
        yield MeasuredGoal("worst walk to a simple one", max(_to_simple(walks)), 1.0)


def _ratios(runs: Sequence[TurnsRun]) -> list[float]:
    return [run.cost_s / run.best_s for run in runs if run.best_s]


def _to_simple(runs: Sequence[TurnsRun]) -> list[float]:
    return [run.cost_s / run.simple_s for run in runs if run.simple_s]


def _bounds(runs: Sequence[TurnsRun]) -> list[float]:
    return [run.bound_s / run.best_s for run in runs if run.best_s]


def _by(
    runs: Sequence[TurnsRun], key: Callable[[TurnsRun], tuple[float, ...]]
) -> Iterator[tuple[tuple[float, ...], list[TurnsRun]]]:
    """Yield runs that have a key in common, in order of the keys."""
    for value, group in itertools.groupby(sorted(runs, key=key), key=key):
        yield value, list(group)


TURNS = Benchmark(
    name="turns",
    summary="walks with costly turns, against best known tours and their bounds",
    description="Plan tours over public turn-cost instances, and open walks over maps at several "
    "prices of a turn, with several budgets. A judge that shares no code with the planners checks "
    "each walk.",
    add_options=_add_options,
    count=lambda args: _plan_of(args).count,
    measure=_measure,
    report=report,
    epilog="example:\n  python -m tests.benchmarks turns --instances turncost --every 8 --no-maps",
)
