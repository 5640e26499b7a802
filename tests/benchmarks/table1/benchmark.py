"""``benchmarks table1``: Table I of the paper, measured again, and its claims checked."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Sequence
from pathlib import Path

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
from tests.benchmarks.table1.page import draw, write_page
from tests.benchmarks.table1.report import report
from tests.benchmarks.table1.runs import VARIANTS, Run, check_drawn, measure

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement")


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument(
        "--seeds", type=positive, default=10, metavar="N",
        help="use seeds 0 to N - 1 (default: %(default)s)",
    )  # fmt: skip
    add_own_planners(parser)
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the page of results")
    parser.add_argument(
        "--png", type=Path, metavar="DIR", help="draw walks and pheromone of each grid"
    )
    parser.add_argument("--png-of", nargs="+", default=[], metavar="GRID", help="draw only these")


def _names(args: argparse.Namespace) -> tuple[str, ...]:
    return grid_names(args, DEFAULT_MAPS)


def _count(args: argparse.Namespace) -> int:
    seeds: int = args.seeds
    return len(_names(args)) * seeds * (len(VARIANTS) + len(args.planner))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Run, None, None]:
    check_drawn(args.png_of, _names(args))
    return measure(_names(args), args.ants, args.seeds, say, [*map(load, args.planner)])


def _report(args: argparse.Namespace, runs: Sequence[Run]) -> Report:
    return report(args.ants, args.seeds, runs)


def _write(args: argparse.Namespace, runs: Sequence[Run]) -> tuple[Path, ...]:
    measured = {run.grid for run in runs}
    pictures = draw(args.png, _names(args), args.png_of, measured, args.ants) if args.png else ()
    files = tuple(file for picture in pictures for file in (picture.walks, picture.pheromone))
    if args.markdown is None:
        return files
    missing = _count(args) - len(runs)
    write_page(args.markdown, _command(args), _report(args, runs), pictures, missing)
    return (*files, args.markdown)


def _command(args: argparse.Namespace) -> str:
    """Return the command that makes the page, without where on this machine files lie."""
    words = ["python -m tests.benchmarks table1", f"--ants {args.ants} --seeds {args.seeds}"]
    if args.grids:
        words.append(f"--grids {' '.join(Path(grid).name for grid in args.grids)}")
    maps = args.maps or (() if args.grids else DEFAULT_MAPS)
    if maps:
        words.append(f"--maps {' '.join(Path(name).name for name in maps)}")
    if args.planner:
        words.append(f"--planner {' '.join(Path(place).name for place in args.planner)}")
    words.append(f"--markdown {args.markdown.name}")
    if args.png:
        words.append(f"--png {args.png.name}")
        words += [f"--png-of {' '.join(args.png_of)}"] if args.png_of else []
    return " \\\n    ".join(words)


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
    write=_write,
    epilog="""\
examples:
  python -m tests.benchmarks table1
  python -m tests.benchmarks table1 --maps office flat --seeds 3 --json
  python -m tests.benchmarks.table1.grids grid.yaml basement.yaml   # makes the next two
  python -m tests.benchmarks table1 --grids paper_simulated.npy paper_basement.npy
  python -m tests.benchmarks table1 --seeds 3 --planner mine.py:depth_first
  python -m tests.benchmarks table1 --markdown RESULTS.md --png pictures --png-of walled_grid
""",
)
