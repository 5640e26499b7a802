"""``bench speed``: how fast the compiled colony is, alone and against its naive twin."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Goal,
    Report,
    ResultTable,
    Say,
    positive,
    seconds,
)
from fasaco_edge.bench.grid_options import add_grid_options, grid_names
from fasaco_edge.bench.machine import machine, peak_mb
from fasaco_edge.bench.naive_twin import naive_file
from fasaco_edge.drawing.spread import Spread, document

if TYPE_CHECKING:
    from fasaco_edge.bench.colony_timing import Timing

DEFAULT_MAPS = ("office", "flat", "basement")
# For 1,000 ants on the paper's basement, 520 cells; smaller grids are held to it too.
GOAL_CELLS, GOAL_ANTS, GOAL_WALL_S = 520, 1000, 0.25
GOAL_RATIO = 300.0
GOAL_BASELINE_RATIO = 50.0
# Threads pay where a group of ants takes its time.
GOAL_SPEEDUP, GOAL_SPEEDUP_CELLS = 1.6, 2000
HEADER = (
    "grid", "cells", "steps", "wall [ms]", "ants/s", "threads", "naive [ms]",
    "ratio", "same",
)  # fmt: skip
BASELINE_HEADER = ("baselines", "planner", "compiled [ms]", "naive [ms]", "ratio", "same")


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument("--velocities", default="8:1", help="as in `plan` (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="(default: %(default)s)")
    parser.add_argument("--repeats", type=positive, default=5, help="(default: %(default)s)")
    parser.add_argument("--return-home", action="store_true", help="end each walk at its start")
    parser.add_argument(
        "--naive-s",
        type=seconds,
        default=3.0,
        metavar="S",
        help="how long the naive twin may run on each grid [s], 0 to leave it out "
        "(default: %(default)g)",
    )
    parser.add_argument(
        "--threads",
        type=positive,
        default=2,
        metavar="N",
        help="threads to try against one, 1 to leave it out (default: %(default)s)",
    )


def _names(args: argparse.Namespace) -> tuple[str, ...]:
    return grid_names(args, DEFAULT_MAPS)


def _count(args: argparse.Namespace) -> int:
    runs: int = args.repeats * (2 if args.threads > 1 else 1)
    # The twin's colony, and both runs of three baselines.
    naive = 1 + 2 * 3 if args.naive_s and naive_file() else 0
    return len(_names(args)) * (runs + naive)


def _measure(args: argparse.Namespace, say: Say) -> Generator[Timing, None, None]:
    # Here, so that to list the benchmarks does not load the compiler.
    from fasaco_edge.bench.colony_timing import TimingPlan, time_colony  # noqa: PLC0415
    from fasaco_edge.planners.colony import ColonyConfig, parse_velocities  # noqa: PLC0415

    colony = ColonyConfig(
        ants=args.ants, velocities=parse_velocities(args.velocities), seed=args.seed
    )
    plan = TimingPlan(
        _names(args), colony, args.repeats, args.return_home, args.naive_s, args.threads
    )
    return time_colony(plan, say)


def _report(args: argparse.Namespace, timings: Sequence[Timing]) -> Report:
    names = dict.fromkeys(timing.grid for timing in timings)
    grids = [_figures([timing for timing in timings if timing.grid == name]) for name in names]
    home = ", return home" if args.return_home else ""
    return Report(
        title=f"FaSACO {args.velocities}, {args.ants} ants, seed {args.seed}{home}, one thread",
        header=HEADER,
        rows=tuple(_row(args, figures) for figures in grids),
        figures={
            "ants": args.ants,
            "velocities": args.velocities,
            "seed": args.seed,
            "return_home": args.return_home,
            "naive_available": naive_file() is not None,
            "grids": grids,
            "peak_rss_mb": peak_mb(),
            "machine": machine(),
        },
        goals=tuple(goal for figures in grids for goal in _goals(figures)),
        further=_baseline_tables(grids),
        remarks=(
            "below a time its range, below the naive twin's time per ant its ants; ratio: "
            "processor time per ant, naive to compiled; same: the walks of the naive colony "
            "and a compiled one of as many ants; threads: how much faster so many are than one",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


def _figures(timings: Sequence[Timing]) -> dict[str, Any]:
    """Sum up the runs on one grid as JSON values."""
    colonies = [timing for timing in timings if timing.planner == "fasaco"]
    compiled = [timing for timing in colonies if timing.compiled and timing.threads == 1]
    parallel = [timing for timing in colonies if timing.threads > 1]
    first = compiled[0]
    wall = Spread.of([timing.wall_s for timing in compiled])
    cpu = Spread.of([timing.cpu_s for timing in compiled])
    assert wall is not None
    assert cpu is not None
    naive = next((timing for timing in colonies if not timing.compiled), None)
    return {
        "grid": first.grid,
        "cells": first.cells,
        "steps": first.steps,
        "ants": first.ants,
        "repeats": len(compiled),
        "wall_s": document(wall),
        "cpu_s": document(cpu),
        "ants_per_s": round(first.ants / wall.median, 1),
        "parallel": _parallel_figures(parallel, wall.median) if parallel else None,
        "naive": _naive_figures(naive, cpu.median / first.ants) if naive else None,
        "baselines": list(_baseline_figures(timings)),
    }


def _parallel_figures(parallel: Sequence[Timing], alone_s: float) -> dict[str, Any]:
    wall = Spread.of([timing.wall_s for timing in parallel])
    assert wall is not None
    return {
        "threads": parallel[0].threads,
        "wall_s": document(wall),
        "speedup": round(alone_s / wall.median, 2),
        "same_walk": all(timing.same_walk for timing in parallel),
    }


def _baseline_figures(timings: Sequence[Timing]) -> Iterator[dict[str, Any]]:
    runs = {(timing.planner, timing.compiled): timing for timing in timings}
    for (planner, compiled), naive in runs.items():
        if compiled or planner == "fasaco":
            continue
        quick = runs[planner, True]
        yield {
            "planner": planner,
            "wall_s": round(quick.wall_s, 6),
            "naive_wall_s": round(naive.wall_s, 6),
            "ratio": round(naive.wall_s / quick.wall_s, 1),
            "same_walk": naive.same_walk,
        }


def _naive_figures(naive: Timing, compiled_s_per_ant: float) -> dict[str, Any]:
    return {
        "ants": naive.ants,
        "steps": naive.steps,
        "wall_s": round(naive.wall_s, 6),
        "cpu_s": round(naive.cpu_s, 6),
        "ms_per_ant": round(1e3 * naive.cpu_s / naive.ants, 4),
        "ratio": round(naive.cpu_s / naive.ants / compiled_s_per_ant, 1),
        "same_walk": naive.same_walk,
    }


def _row(args: argparse.Namespace, figures: dict[str, Any]) -> tuple[str, ...]:
    return (
        Path(figures["grid"]).stem,
        str(figures["cells"]),
        str(figures["steps"]),
        _milliseconds(figures["wall_s"]),
        f"{figures['ants_per_s']:.0f}",
        _speedup(figures["parallel"]),
        *_naive_columns(args, figures["naive"]),
    )


def _speedup(parallel: dict[str, Any] | None) -> str:
    if parallel is None:
        return "-"
    same = "" if parallel["same_walk"] else "\nOTHER WALK"
    return f"{parallel['threads']}: x{parallel['speedup']}{same}"


def _baseline_tables(grids: Sequence[dict[str, Any]]) -> tuple[ResultTable, ...]:
    rows = tuple(
        (
            Path(figures["grid"]).stem,
            baseline["planner"],
            f"{1e3 * baseline['wall_s']:.3f}",
            f"{1e3 * baseline['naive_wall_s']:.1f}",
            f"{baseline['ratio']:.0f}",
            "yes" if baseline["same_walk"] else "NO",
        )
        for figures in grids
        for baseline in figures["baselines"]
    )
    return (ResultTable("baselines, least of 20 runs", BASELINE_HEADER, rows),) if rows else ()


def _milliseconds(spread: dict[str, float]) -> str:
    """Return the median and below it the range, short enough for a narrow terminal."""
    median, low, high = (1e3 * spread[name] for name in ("median", "low", "high"))
    digits = 0 if median >= 100.0 else 1
    return f"{median:.1f}\n{low:.{digits}f}-{high:.{digits}f}"


def _naive_columns(args: argparse.Namespace, naive: dict[str, Any] | None) -> tuple[str, str, str]:
    if naive is None:
        return _why_no_naive(args), "-", "-"
    same = "yes" if naive["same_walk"] else "NO"
    return f"{naive['ms_per_ant']:.3g}\n{naive['ants']} ants", f"{naive['ratio']:.0f}", same


def _why_no_naive(args: argparse.Namespace) -> str:
    if not args.naive_s:
        return "left out"
    return "not measured" if naive_file() else "needs a source checkout"


def _goals(figures: dict[str, Any]) -> Iterator[Goal]:
    name = Path(figures["grid"]).stem
    if figures["cells"] <= GOAL_CELLS and figures["ants"] >= GOAL_ANTS:
        wall_s = figures["wall_s"]["median"] * GOAL_ANTS / figures["ants"]
        yield Goal(f"{name}: wall time of {GOAL_ANTS} ants", round(wall_s, 4), GOAL_WALL_S, "s")
    if figures["naive"] is not None:
        ratio = figures["naive"]["ratio"]
        yield Goal(f"{name}, fasaco: ratio", ratio, GOAL_RATIO, at_least=True)
    for baseline in figures["baselines"]:
        what = f"{name}, {baseline['planner']}: ratio"
        yield Goal(what, baseline["ratio"], GOAL_BASELINE_RATIO, at_least=True)
    parallel = figures["parallel"]
    if parallel and parallel["threads"] == 2 and figures["cells"] >= GOAL_SPEEDUP_CELLS:
        what = f"{name}: two threads against one"
        yield Goal(what, parallel["speedup"], GOAL_SPEEDUP, at_least=True)


SPEED = Benchmark(
    name="speed",
    summary="the compiled colony's time, alone and against its naive twin",
    description="Plan with FaSACO on each grid several times, kernels warm, on one thread; then "
    "let the naive twin from the tests (plain Python, dicts and sets) walk with fewer ants, and "
    "compare time per ant and the walks. Reads: times are medians with their range, which "
    "shows how quiet the machine was; ants/s is by the wall clock.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench speed
  fasaco-edge bench speed --grids grid.npy --return-home --repeats 9
  fasaco-edge bench speed --maps warehouse --naive-s 0 --json
""",
)
