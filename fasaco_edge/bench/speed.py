"""``bench speed``: how fast the compiled colony plans, on one thread and on several."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Goal,
    Report,
    Say,
    add_grid_options,
    grid_names,
    peak_mb,
    positive,
    seed,
)
from fasaco_edge.drawing.spread import Spread, document

if TYPE_CHECKING:
    from fasaco_edge.planners.grids import NamedGrid
    from fasaco_edge.planners.paper.fasaco import Fasaco
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem

DEFAULT_MAPS = ("office", "flat", "basement")
# Goal for 1,000 ants on the paper's basement, 520 cells; it also holds for smaller grids.
GOAL_CELLS, GOAL_ANTS, GOAL_WALL_S = 520, 1000, 0.25
# Threads pay off where a group of ants takes long.
GOAL_SPEEDUP, GOAL_SPEEDUP_CELLS = 1.6, 2000
HEADER = ("grid", "cells", "steps", "wall [ms]", "ants/s", "threads")


@dataclass(frozen=True, slots=True)
class Timing:
    """One plan.

    Attributes:
        grid: name of the grid.
        cells: cells to cover.
        steps: steps of the walk that was found.
        ants: how many ants walked.
        wall_s: time by the clock [s].
        cpu_s: time of the planning thread on a processor [s].
        threads: on how many threads the ants walked.
        same_walk: whether one thread finds the same walk, cell by cell.
    """

    grid: str
    cells: int
    steps: int
    ants: int
    wall_s: float
    cpu_s: float
    threads: int = 1
    same_walk: bool = True


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument("--velocities", default="8:1", help="as in `plan` (default: %(default)s)")
    parser.add_argument("--seed", type=seed, default=0, help="(default: %(default)s)")
    parser.add_argument("--repeats", type=positive, default=5, help="(default: %(default)s)")
    parser.add_argument("--return-home", action="store_true", help="end each walk at its start")
    parser.add_argument(
        "--threads",
        type=positive,
        default=2,
        metavar="N",
        help="number of threads to compare with one; 1 skips the comparison (default: %(default)s)",
    )


def _count(args: argparse.Namespace) -> int:
    runs: int = args.repeats * (2 if args.threads > 1 else 1)
    return runs * len(grid_names(args, DEFAULT_MAPS))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Timing, None, None]:
    # Imported here, so that listing the benchmarks does not load the compiler.
    from fasaco_edge.planners.compiling import warm_up  # noqa: PLC0415
    from fasaco_edge.planners.grids import read_grid  # noqa: PLC0415
    from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities  # noqa: PLC0415
    from fasaco_edge.planners.paper.fasaco import Fasaco  # noqa: PLC0415
    from fasaco_edge.planners.problem import CoverageProblem  # noqa: PLC0415

    velocities = parse_velocities(args.velocities)
    colony = ColonyConfig(ants=args.ants, velocities=velocities, seed=args.seed)
    # Read first, so that a wrong name fails at once and not after minutes.
    grids = [read_grid(name) for name in grid_names(args, DEFAULT_MAPS)]
    say("loading kernels")
    warm_up()
    for grid in grids:
        end = grid.start if args.return_home else None
        problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
        say(grid.name)
        Fasaco(replace(colony, ants=len(velocities))).plan(problem)
        for _ in range(args.repeats):
            # Alternating, so that a machine that slows down affects both.
            path, timing = _timed(grid, problem, Fasaco(colony))
            yield timing
            if args.threads > 1:
                together, timing = _timed(grid, problem, Fasaco(colony, args.threads))
                same = together.cells.tobytes() == path.cells.tobytes()
                yield replace(timing, threads=args.threads, same_walk=same)


def _timed(
    grid: NamedGrid, problem: CoverageProblem, planner: Fasaco
) -> tuple[CoveragePath, Timing]:
    wall, cpu = time.perf_counter(), time.thread_time()
    path = planner.plan(problem)
    wall_s, cpu_s = time.perf_counter() - wall, time.thread_time() - cpu
    return path, Timing(grid.name, problem.cells, path.steps, path.work.ants, wall_s, cpu_s)


def _report(args: argparse.Namespace, timings: Sequence[Timing]) -> Report:
    names = dict.fromkeys(timing.grid for timing in timings)
    grids = [_figures([timing for timing in timings if timing.grid == name]) for name in names]
    home = ", return home" if args.return_home else ""
    return Report(
        title=f"FaSACO {args.velocities}, {args.ants} ants, seed {args.seed}{home}, one thread",
        header=HEADER,
        rows=tuple(map(_row, grids)),
        figures={
            "ants": args.ants,
            "velocities": args.velocities,
            "seed": args.seed,
            "return_home": args.return_home,
            "grids": grids,
        },
        goals=tuple(goal for figures in grids for goal in _goals(figures)),
        remarks=(
            "below a time its range; threads: their speed-up over one",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


class _Parallel(TypedDict):
    """How much faster several threads are than one."""

    threads: int
    wall_s: dict[str, float] | None
    speedup: float
    same_walk: bool


class _Figures(TypedDict):
    """The runs on one grid summed up, as JSON values."""

    grid: str
    cells: int
    steps: int
    ants: int
    repeats: int
    wall_s: dict[str, float]
    cpu_s: dict[str, float] | None
    ants_per_s: float
    parallel: _Parallel | None


def _figures(timings: Sequence[Timing]) -> _Figures:
    """Sum up the runs on one grid."""
    alone = [timing for timing in timings if timing.threads == 1]
    parallel = [timing for timing in timings if timing.threads > 1]
    first = alone[0]
    wall = Spread.of([timing.wall_s for timing in alone])
    assert wall is not None
    return {
        "grid": first.grid,
        "cells": first.cells,
        "steps": first.steps,
        "ants": first.ants,
        "repeats": len(alone),
        "wall_s": wall.document(),
        "cpu_s": document(Spread.of([timing.cpu_s for timing in alone])),
        "ants_per_s": round(first.ants / wall.median, 1),
        "parallel": _parallel_figures(parallel, wall.median) if parallel else None,
    }


def _parallel_figures(parallel: Sequence[Timing], alone_s: float) -> _Parallel:
    wall = Spread.of([timing.wall_s for timing in parallel])
    assert wall is not None
    return {
        "threads": parallel[0].threads,
        "wall_s": wall.document(),
        "speedup": round(alone_s / wall.median, 2),
        "same_walk": all(timing.same_walk for timing in parallel),
    }


def _row(figures: _Figures) -> tuple[str, ...]:
    return (
        Path(figures["grid"]).stem,
        str(figures["cells"]),
        str(figures["steps"]),
        _milliseconds(figures["wall_s"]),
        f"{figures['ants_per_s']:.0f}",
        _speedup(figures["parallel"]),
    )


def _speedup(parallel: _Parallel | None) -> str:
    if parallel is None:
        return "-"
    same = "" if parallel["same_walk"] else "\nOTHER WALK"
    return f"{parallel['threads']}: x{parallel['speedup']}{same}"


def _milliseconds(spread: dict[str, float]) -> str:
    """Return the median and below it the range, short enough for a narrow terminal."""
    median, low, high = (1e3 * spread[name] for name in ("median", "low", "high"))
    digits = 0 if median >= 100.0 else 1
    return f"{median:.1f}\n{low:.{digits}f}-{high:.{digits}f}"


def _goals(figures: _Figures) -> Iterator[Goal]:
    name = Path(figures["grid"]).stem
    if figures["cells"] <= GOAL_CELLS and figures["ants"] >= GOAL_ANTS:
        wall_s = figures["wall_s"]["median"] * GOAL_ANTS / figures["ants"]
        yield Goal(f"{name}: wall time of {GOAL_ANTS} ants", round(wall_s, 4), GOAL_WALL_S, "s")
    parallel = figures["parallel"]
    if parallel and parallel["threads"] == 2 and figures["cells"] >= GOAL_SPEEDUP_CELLS:
        what = f"{name}: two threads against one"
        yield Goal(what, parallel["speedup"], GOAL_SPEEDUP, at_least=True)


SPEED = Benchmark(
    name="speed",
    summary="the compiled colony's time, on one thread and on several",
    description="Plan with FaSACO on each grid several times, kernels warm, on one thread and, by "
    "turns, on several. Times are medians with their range, which shows how quiet the machine "
    "was; ants/s is by the wall clock.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench speed
  fasaco-edge bench speed --grids grid.npy --return-home --repeats 9
  fasaco-edge bench speed --maps warehouse --threads 1 --json
""",
)
