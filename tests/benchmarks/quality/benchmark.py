"""``benchmarks quality``: how near to the best known walks a plan comes in so much time."""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds,
    seconds_above_zero,
)
from fasaco_edge.errors import BadConfiguration

if TYPE_CHECKING:
    from tests.benchmarks.quality.runs import QualityRun

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement", "warehouse")


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FILE.json",
        help="what other planners reached on the grids, by name: results {planner: {full, steps, "
        "turns_90, turns_180, returns_home}}, proven_optimum {open_steps, closed_steps}, bounds; "
        "without it ratios are to the search's own lower bound",
    )
    parser.add_argument(
        "--budgets",
        nargs="+",
        type=seconds_above_zero,
        default=[0.02, 0.1, 1.0],
        metavar="S",
        help="plan for so long [s] (default: 0.02 0.1 1; there is a goal for 10, too)",
    )
    parser.add_argument(
        "--seeds", type=positive, default=10, metavar="N", help="0 to N - 1 (default: %(default)s)"
    )
    _add_choice(parser, "--end", ("anywhere", "home"), ["anywhere"], "where walks end")
    _add_choice(
        parser,
        "--cost",
        ("steps", "turns"),
        ["steps", "turns"],
        "what walks are to have little of: steps alone, or time with turns at their price",
    )
    parser.add_argument(
        "--turn-s",
        type=seconds,
        default=1.5,
        metavar="S",
        help="a quarter-turn [s], where a step takes 1 s and a half turn two quarter-turns "
        "(default: %(default)g, that of the goals)",
    )
    _add_choice(
        parser,
        "--variants",
        ("ants", "flat", "never"),
        ["ants"],
        "what the search goes on from where kicks gain nothing any more: the colony's next ants; "
        "ants on a trail that nothing strengthens; or the same walk",
    )
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help="draw ratios over budgets")


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
    # Here and below, so that to list the benchmarks does not load the compiler.
    from tests.benchmarks.quality.runs import QualityPlan, Setting, measure

    if args.plot is not None and not args.plot.parent.is_dir():
        raise BadConfiguration(f"cannot write {args.plot}: there is no such folder")
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


def _report(args: argparse.Namespace, runs: Sequence[QualityRun]) -> Report:
    from tests.benchmarks.quality.report import report

    return report(args.turn_s, args.seeds, runs)


def _write(args: argparse.Namespace, runs: Sequence[QualityRun]) -> tuple[Path, ...]:
    from tests.benchmarks.quality.plot import draw

    if args.plot is None or not runs:
        return ()
    draw(runs, args.turn_s).save(args.plot)
    return (args.plot,)


QUALITY = Benchmark(
    name="quality",
    summary="how near plans of so much time come to the best known walks",
    description="Plan with FaSACO and local search on each grid, with each budget and seed, "
    "kernels warm, on one thread; judge every walk by code that shares nothing with the "
    "planner, and compare it with the best walk known, the search's own lower bound, and the "
    "best of other planners by mission time. Reads: medians over the seeds, and below them the "
    "worst; a ratio of 1.005 is half a percent above the best known, one below 1 better than "
    "any other planner.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    write=_write,
    epilog="""\
examples:
  python -m tests.benchmarks quality
  python -m tests.benchmarks quality --maps office --budgets 0.02 0.1 1 10 --cost steps
  python -m tests.benchmarks quality --grids *.npy --results results.json --plot quality.png
  python -m tests.benchmarks quality --end home --cost steps --budgets 1 --json
  python -m tests.benchmarks quality --variants ants flat never
""",
)
