"""``benchmarks scale``: how time, memory and quality grow with the size of the building."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.bench.benchmark import Benchmark, Report, Say, positive, seconds_above_zero
from fasaco_edge.errors import BadConfiguration

if TYPE_CHECKING:
    from tests.benchmarks.scale.runs import SizedRun

DEFAULT_SIZES = (1_000, 5_000, 20_000, 100_000)
FEWEST_CELLS, MOST_CELLS = 1_000, 2_000_000


def _size(text: str) -> int:
    cells = int(text)
    if not FEWEST_CELLS <= cells <= MOST_CELLS:
        raise argparse.ArgumentTypeError(f"must be in {FEWEST_CELLS}..{MOST_CELLS}, got {text}")
    return cells


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sizes",
        nargs="+",
        type=_size,
        default=list(DEFAULT_SIZES),
        metavar="CELLS",
        help=f"cells to cover, 2 %% more or less (default: {' '.join(map(str, DEFAULT_SIZES))}; "
        "there are goals for 1000000, too)",
    )
    parser.add_argument(
        "--seeds",
        type=positive,
        default=3,
        metavar="N",
        help="0 to N - 1, each a building and a search of its own (default: %(default)s)",
    )
    parser.add_argument(
        "--budget-s",
        nargs="+",
        type=seconds_above_zero,
        default=[],
        metavar="S",
        help="plan for so long [s]: one time for all sizes, or one for each (default: a minute a "
        "million cells, a second at least)",
    )
    parser.add_argument(
        "--plot", type=Path, metavar="FILE.png", help="draw time, memory and gap over size"
    )


def _sizes(args: argparse.Namespace) -> list[int]:
    return list(dict.fromkeys(args.sizes))


def _measure(args: argparse.Namespace, say: Say) -> Generator[SizedRun, None, None]:
    # Here and below, so that to list the benchmarks does not load the compiler.
    from tests.benchmarks.scale.runs import budgets, measure

    if args.plot is not None and not args.plot.parent.is_dir():
        raise BadConfiguration(f"cannot write {args.plot}: there is no such folder")
    sizes = _sizes(args)
    return measure(sizes, budgets(sizes, args.budget_s), args.seeds, say)


def _report(args: argparse.Namespace, runs: Sequence[SizedRun]) -> Report:
    from tests.benchmarks.scale.report import report

    return report(args.seeds, runs)


def _write(args: argparse.Namespace, runs: Sequence[SizedRun]) -> tuple[Path, ...]:
    from tests.benchmarks.scale.plot import draw

    if args.plot is None or not runs:
        return ()
    draw(runs).save(args.plot)
    return (args.plot,)


SCALE = Benchmark(
    name="scale",
    summary="how time, memory and quality of a plan grow with the building",
    description="Make synthetic buildings (rooms, corridors, furniture) of several sizes and plan "
    "on each with FaSACO and local search, for steps alone, in a process of its own, kernels "
    "warm, on one thread; judge every walk by code that shares nothing with the planner. Reads: "
    "how soon there is a complete walk, how soon one that is proven to be at most 5 or 3 % "
    "longer than the shortest, how near it comes in the end, and how much memory that takes; an "
    "exponent of 1 is growth in proportion to the cells.",
    add_options=_add_options,
    count=lambda args: len(_sizes(args)) * int(args.seeds),
    measure=_measure,
    report=_report,
    write=_write,
    epilog="""\
examples:
  python -m tests.benchmarks scale
  python -m tests.benchmarks scale --sizes 1000 10000 100000 1000000 --plot scale.png
  python -m tests.benchmarks scale --sizes 100000 --seeds 1 --budget-s 5 --json
""",
)
