"""``benchmarks twins``: the compiled planners against their naive twins in ``tests.naive``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Goal,
    Report,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
    seed,
)
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.planner import CoveragePlanner, ignore, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import planner_of
from tests import naive

DEFAULT_MAPS = ("office", "flat", "basement")
BASELINES = ("stc", "spiral-stc", "zigzag")
RULES = {"spiral-stc": naive.SPIRAL, "zigzag": naive.ZIGZAG}
# Baselines take less than a millisecond: one run says nothing.
BASELINE_RUNS = 20
GOAL_COLONY_RATIO, GOAL_BASELINE_RATIO = 300.0, 50.0
HEADER = ("grid", "planner", "ants", "compiled [ms]", "naive [ms]", "ratio", "same")

Walk = list[tuple[int, int]]


@dataclass(frozen=True, slots=True)
class Comparison:
    """One planner on one grid, compiled and naive.

    Attributes:
        grid: name of the grid.
        cells: cells to cover.
        planner: its name.
        ants: how many ants of the twin walked; 0 for a baseline.
        compiled_s, naive_s: time on a processor [s]: for one ant of a colony, for a baseline's
            walk.
        same_walk: whether both find the same walk, cell by cell.
    """

    grid: str
    cells: int
    planner: str
    ants: int
    compiled_s: float
    naive_s: float
    same_walk: bool

    @property
    def ratio(self) -> float:
        """Naive to compiled."""
        return self.naive_s / self.compiled_s


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument("--velocities", default="8:1", help="as in `plan` (default: %(default)s)")
    parser.add_argument("--seed", type=seed, default=0, help="(default: %(default)s)")
    parser.add_argument("--return-home", action="store_true", help="end each walk at its start")
    parser.add_argument(
        "--naive-s",
        type=seconds_above_zero,
        default=3.0,
        metavar="S",
        help="how long the naive colony may run on each grid [s] (default: %(default)g)",
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[Comparison, None, None]:
    velocities = parse_velocities(args.velocities)
    colony = ColonyConfig(ants=args.ants, velocities=velocities, seed=args.seed)
    # Read first: a wrong name should not be found out after minutes.
    grids = [read_grid(name) for name in grid_names(args, DEFAULT_MAPS)]
    say("loading kernels")
    warm_up()
    for grid in grids:
        end = grid.start if args.return_home else None
        problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
        say(f"{grid.name}: colony")
        yield _colony(grid, problem, colony, args.naive_s)
        # A naive baseline walks home in any case, as spanning-tree coverage does.
        closed = replace(problem, end=problem.start)
        for name in BASELINES:
            say(f"{grid.name}: {name}")
            yield _baseline(grid, closed, name)


def _colony(
    grid: NamedGrid, problem: CoverageProblem, config: ColonyConfig, naive_s: float
) -> Comparison:
    """Run the twin with as many ants as ``naive_s`` allow, one for each cohort at least."""
    steps, start = problem.lattice.steps, problem.lattice.local(problem.start)
    end = start if problem.closed else None

    def run(ants: int) -> tuple[Walk, float]:
        colony = replace(config, ants=ants)
        return _timed(lambda: naive.fasaco(steps, problem.to_cover, start, colony, end))

    ants = len(config.velocities)
    walk, cpu_s = run(ants)
    # Again where a few ants, slow as the first ones are, made a poor guess.
    while (affordable := min(config.ants, int(naive_s * ants / cpu_s))) > 2 * ants:
        ants = affordable
        walk, cpu_s = run(ants)
    path, _ = _timed(lambda: Fasaco(replace(config, ants=ants)).plan(problem))
    all_ants, compiled_s = _timed(lambda: Fasaco(config).plan(problem))
    return Comparison(
        grid=grid.name,
        cells=problem.cells,
        planner="fasaco",
        ants=ants,
        compiled_s=compiled_s / all_ants.work.ants,
        naive_s=cpu_s / ants,
        same_walk=_local(problem, path.cells) == walk,
    )


def _baseline(grid: NamedGrid, problem: CoverageProblem, name: str) -> Comparison:
    planner: CoveragePlanner = planner_of(name, ColonyConfig())
    runs = [_timed(lambda: planner.plan(problem, never, ignore)) for _ in range(BASELINE_RUNS)]
    path, compiled_s = min(runs, key=lambda run: run[1])
    walk, naive_s = _timed(lambda: _naive_baseline(problem, name))
    same = _local(problem, path.cells) == walk
    return Comparison(grid.name, problem.cells, name, 0, compiled_s, naive_s, same)


def _naive_baseline(problem: CoverageProblem, name: str) -> Walk:
    steps, start = problem.lattice.steps, problem.lattice.local(problem.start)
    if name == "stc":
        return naive.stc(steps, problem.to_cover, start)
    return naive.sweep(steps, problem.to_cover, start, RULES[name], end=start)


def _local(problem: CoverageProblem, cells: Any) -> Walk:
    window = problem.lattice.window
    return [tuple(cell) for cell in (cells - (window.row0, window.col0)).tolist()]


def _timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return the result, and seconds of this thread on a processor."""
    before = time.thread_time()
    result = call()
    return result, time.thread_time() - before


def _report(args: argparse.Namespace, comparisons: Sequence[Comparison]) -> Report:
    return Report(
        title=f"compiled against naive, {args.velocities}, seed {args.seed}",
        header=HEADER,
        rows=tuple(map(_row, comparisons)),
        figures={
            "velocities": args.velocities,
            "seed": args.seed,
            "return_home": args.return_home,
            "comparisons": [_document(one) for one in comparisons],
        },
        goals=tuple(_goals(comparisons)),
        remarks=(
            "fasaco: processor time for one ant; the twin has as many ants as its time allows, and "
            "same compares its walk with that of as many compiled ones. "
            f"Baselines: one walk home, compiled the least of {BASELINE_RUNS} runs.",
        ),
    )


def _row(one: Comparison) -> tuple[str, ...]:
    return (
        Path(one.grid).stem,
        one.planner,
        str(one.ants or "-"),
        f"{1e3 * one.compiled_s:.3f}",
        f"{1e3 * one.naive_s:.1f}",
        f"{one.ratio:.0f}",
        "yes" if one.same_walk else "NO",
    )


def _document(one: Comparison) -> dict[str, Any]:
    return {
        "grid": one.grid,
        "cells": one.cells,
        "planner": one.planner,
        "ants": one.ants,
        "compiled_s": round(one.compiled_s, 9),
        "naive_s": round(one.naive_s, 9),
        "ratio": round(one.ratio, 1),
        "same_walk": one.same_walk,
    }


def _goals(comparisons: Sequence[Comparison]) -> Iterator[Goal]:
    for one in comparisons:
        limit = GOAL_COLONY_RATIO if one.planner == "fasaco" else GOAL_BASELINE_RATIO
        what = f"{Path(one.grid).stem}, {one.planner}: ratio"
        yield Goal(what, round(one.ratio, 1), limit, at_least=True)


TWINS = Benchmark(
    name="twins",
    summary="compiled planners against their naive twins: the same walks, how much faster",
    description="Plan on each grid with FaSACO and the baselines, compiled and by their naive "
    "twins (plain Python, dicts and sets), on one thread; compare processor time and the walks, "
    "cell by cell.",
    add_options=_add_options,
    count=lambda args: (1 + len(BASELINES)) * len(grid_names(args, DEFAULT_MAPS)),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks twins
  python -m tests.benchmarks twins --maps warehouse --naive-s 20 --json
""",
)
