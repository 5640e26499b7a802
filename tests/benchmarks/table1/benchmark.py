"""``benchmarks table1``: Table I of the paper, measured again, and its claims checked."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Sequence

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    add_grid_options,
    add_own_planners,
    grid_names,
    positive,
)
from fasaco_edge.planners.own.loading import load
from tests.benchmarks.table1.report import report
from tests.benchmarks.table1.runs import VARIANTS, Run, measure

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement")


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument(
        "--seeds", type=positive, default=10, metavar="N",
        help="use seeds 0 to N - 1 (default: %(default)s)",
    )  # fmt: skip
    add_own_planners(parser)


def _names(args: argparse.Namespace) -> tuple[str, ...]:
    return grid_names(args, DEFAULT_MAPS)


def _count(args: argparse.Namespace) -> int:
    seeds: int = args.seeds
    return len(_names(args)) * seeds * (len(VARIANTS) + len(args.planner))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Run, None, None]:
    return measure(_names(args), args.ants, args.seeds, say, [*map(load, args.planner)])


def _report(args: argparse.Namespace, runs: Sequence[Run]) -> Report:
    return report(args.ants, args.seeds, runs)


TABLE1 = Benchmark(
    name="table1",
    summary="the paper's Table I, measured again, and its claims checked",
    description="Run every planner of Table I (Carr and Wang 2022), and three more variants of its "
    "baselines, start to start on each grid with each seed, on one thread. Count revisits as in "
    "the paper and in two other ways; list the grids on which each claim of the paper holds. "
    "Results are medians, with the range over the seeds in brackets.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks table1
  python -m tests.benchmarks table1 --maps office flat --seeds 3 --json
  python -m tests.benchmarks.table1.grids grid.yaml basement.yaml   # makes the next two
  python -m tests.benchmarks table1 --grids paper_simulated.npy paper_basement.npy
  python -m tests.benchmarks table1 --seeds 3 --planner mine.py:depth_first
""",
)
