"""``benchmarks scale``: how time, memory and quality grow with the size of the building.

Each building is planned on in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Generator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from fasaco_edge.bench.benchmark import Benchmark, Say, positive, seconds_above_zero
from fasaco_edge.errors import BadConfiguration, ProcessEnded
from fasaco_edge.host.processes import python_program
from tests.benchmarks.buildings import building
from tests.benchmarks.harness import within
from tests.benchmarks.scale.process import ScaleRun, ScaleTask, SizedRun
from tests.benchmarks.scale.report import report

DEFAULT_SIZES = (1_000, 5_000, 20_000, 100_000)
FEWEST_CELLS, MOST_CELLS = 1_000, 2_000_000


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sizes",
        nargs="+",
        type=within(FEWEST_CELLS, MOST_CELLS),
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


def _sizes(args: argparse.Namespace) -> list[int]:
    return list(dict.fromkeys(args.sizes))


def _measure(args: argparse.Namespace, say: Say) -> Generator[SizedRun, None, None]:
    sizes = _sizes(args)
    return measure(sizes, budgets(sizes, args.budget_s), args.seeds, say)


PROGRAM = python_program("tests.benchmarks.scale.process")
WARM_S = 0.1


def budgets(sizes: Sequence[int], given: Sequence[float]) -> tuple[float, ...]:
    """Return for how long to plan on each size [s]: as given, or a minute a million cells.

    Raises:
        BadConfiguration: neither one budget is given nor one for each size.
    """
    if not given:
        return tuple(max(1.0, size * 60e-6) for size in sizes)
    if len(given) not in (1, len(sizes)):
        raise BadConfiguration(
            f"--budget-s must be one time, or one for each of {len(sizes)} sizes, got {len(given)}"
        )
    return tuple(given) * (len(sizes) if len(given) == 1 else 1)


def measure(
    sizes: Sequence[int], budgets_s: Sequence[float], seeds: int, say: Say
) -> Generator[SizedRun, None, None]:
    """Yield every run; each seed goes over all sizes before the next one does.

    Raises:
        ProcessEnded: a process failed; its message says why, such as a walk that is wrong.
    """
    with tempfile.TemporaryDirectory(prefix="fasaco-bench-") as folder:
        file = Path(folder) / "building.npy"
        say("warming the kernels' cache")
        _write_building(file, min(sizes), 0)
        planned(ScaleTask(str(file), 0, WARM_S))
        for seed in range(seeds):
            for size, budget_s in zip(sizes, budgets_s, strict=True):
                say(f"seed {seed}: {size:,} cells")
                _write_building(file, size, seed)
                yield SizedRun(size, planned(ScaleTask(str(file), seed, budget_s)))


def _write_building(file: Path, cells: int, seed: int) -> None:
    grid = building(cells, seed)
    np.save(file, grid.lattice.coverable)
    start = json.dumps({"start": list(grid.start)})
    file.with_suffix(".json").write_text(start, encoding="utf-8")


def planned(task: ScaleTask) -> ScaleRun:
    """Return what a process of its own measured.

    Raises:
        ProcessEnded: it failed.
    """
    try:
        ended = subprocess.run(
            PROGRAM, input=json.dumps(asdict(task)), check=True, capture_output=True, text=True
        )
    except subprocess.CalledProcessError as error:
        raise ProcessEnded(f"planning ended with {error.returncode}:\n{error.stderr}") from error
    return ScaleRun.of(json.loads(ended.stdout))


SCALE = Benchmark(
    name="scale",
    summary="how time, memory and quality of a plan grow with the building",
    description="Make synthetic buildings (rooms, corridors, furniture) of several sizes and plan "
    "on each with colony-search, for steps alone, in a process of its own, kernels "
    "warm, on one thread; judge every walk by code that shares nothing with the planner. Reads: "
    "how soon there is a complete walk, how soon one that is proven to be at most 5 or 3 % "
    "longer than the shortest, how near it comes in the end, and how much memory that takes; an "
    "exponent of 1 is growth in proportion to the cells.",
    add_options=_add_options,
    count=lambda args: len(_sizes(args)) * int(args.seeds),
    measure=_measure,
    report=lambda args, runs: report(args.seeds, runs),
    epilog="""\
examples:
  python -m tests.benchmarks scale
  python -m tests.benchmarks scale --sizes 1000 10000 100000 1000000
  python -m tests.benchmarks scale --sizes 100000 --seeds 1 --budget-s 5 --json
""",
)
