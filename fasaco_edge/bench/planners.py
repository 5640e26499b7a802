"""``bench planners``: walks of all planners, and of the user's own, side by side."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    ResultTable,
    Say,
    add_grid_options,
    add_own_planners,
    grid_names,
    positive,
    seconds_above_zero,
)
from fasaco_edge.bench.spread import Spread, document
from fasaco_edge.config.config import PlannerConfig
from fasaco_edge.errors import FasacoError, IllegalWalk, PlannerFailed
from fasaco_edge.planners.own.loading import UserCode, load
from fasaco_edge.planners.own.time_limit import OWN_BUDGET_S, TookTooLongError
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.registry import PLANNERS as REGISTRY

if TYPE_CHECKING:
    from fasaco_edge.planners.grids import NamedGrid
    from fasaco_edge.planners.path import WalkFigures
    from fasaco_edge.planners.planner import CoveragePlanner
    from fasaco_edge.planners.problem import CoverageProblem

DEFAULT_MAPS = ("office", "flat")
# Time of colony-search if none is requested [s].
SEARCH_S = 1.0
HEADER = ("planner", "steps", "revisits", "n_r_paper", "turns\n90", "CPU\n[s]")
FIGURES = ("steps", "revisits", "recovered_cells", "n_r_paper", "turns_90")


@dataclass(frozen=True, slots=True)
class Run:
    """One walk of a planner on a grid.

    Attributes:
        grid: name of the grid.
        cells: number of cells to cover.
        planner: name of its row.
        walk: figures of the walk; None if the planner failed.
        cpu_s: processor time of the planning thread [s].
        bound_steps: lower bound on the steps.
        fault: error of a planner of the user's own, if it failed.
        ended_s: time limit that ended it without a walk [s]; None if it was not ended.
    """

    grid: str
    cells: int
    planner: str
    walk: WalkFigures | None
    cpu_s: float
    bound_steps: int
    fault: FasacoError | None = None
    ended_s: float | None = None


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_own_planners(parser)
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--ants", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument("--velocities", default="8:1", help="as in `plan` (default: %(default)s)")
    parser.add_argument(
        "--seeds", type=positive, default=3, metavar="N", help="0 to N - 1 (default: %(default)s)"
    )
    parser.add_argument(
        "--budget",
        type=seconds_above_zero,
        metavar="S",
        help="time of colony-search [s], and the time after which a planner of your own is ended; "
        f"the others walk to their end (default: {SEARCH_S:g}; {OWN_BUDGET_S:g} for your own)",
    )
    parser.add_argument(
        "--end",
        choices=("home", "anywhere"),
        default="anywhere",
        help="where each walk ends: anywhere, or home as in the paper's Table I; a planner of your "
        "own that ends elsewhere then fails (default: %(default)s)",
    )


def _count(args: argparse.Namespace) -> int:
    rows = len(dict.fromkeys(args.planner)) + len(REGISTRY)
    runs: int = args.seeds * rows
    return runs * len(grid_names(args, DEFAULT_MAPS))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Run, None, None]:
    # Imported here, so that the list of benchmarks does not load the compiler.
    from fasaco_edge.planners.bound import lower_bound_of  # noqa: PLC0415
    from fasaco_edge.planners.compiling import warm_up  # noqa: PLC0415
    from fasaco_edge.planners.grids import read_grid  # noqa: PLC0415
    from fasaco_edge.planners.problem import CoverageProblem  # noqa: PLC0415

    # Read first, so that a wrong name fails at once.
    own = [load(place) for place in dict.fromkeys(args.planner)]
    names = Counter(code.name for code in own)
    # Planners of one name in two files are two rows, named after their files.
    own = [
        replace(code, name=place) if names[code.name] > 1 else code
        for code, place in zip(own, dict.fromkeys(args.planner), strict=True)
    ]
    colony = ColonyConfig(ants=args.ants, velocities=parse_velocities(args.velocities))
    grids = [read_grid(name) for name in grid_names(args, DEFAULT_MAPS)]
    say("loading kernels")
    warm_up()
    posed = []
    for grid in grids:
        end = grid.start if args.end == "home" else None
        problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
        posed.append((grid, problem, lower_bound_of(problem).steps))
    # The user's own planners come last: if one hangs, the other results are there already.
    for rows in (_known, partial(_own, own, args.budget)):
        for grid, problem, bound in posed:
            for seed in range(args.seeds):
                for name, planner in rows(replace(colony, seed=seed)):
                    say(f"{Path(grid.name).stem}: {name}, seed {seed}")
                    yield _run(grid, problem, name, planner, args.budget or SEARCH_S, bound)


def _own(
    own: Sequence[UserCode], budget_s: float | None, colony: ColonyConfig
) -> Generator[tuple[str, CoveragePlanner], None, None]:
    from fasaco_edge.planners.own.problem import OwnPlanner  # noqa: PLC0415

    for code in own:
        yield code.name, OwnPlanner(code, colony.seed, budget_s or OWN_BUDGET_S)


def _known(colony: ColonyConfig) -> Generator[tuple[str, CoveragePlanner], None, None]:
    from fasaco_edge.planners.registry import planner_of  # noqa: PLC0415

    for name, entry in REGISTRY.items():
        # The planner of missions takes q0 from the configuration of missions.
        q0 = PlannerConfig().q0 if entry.has_local_search else colony.q0
        yield name, planner_of(name, replace(colony, q0=q0))


def _run(
    grid: NamedGrid,
    problem: CoverageProblem,
    name: str,
    planner: CoveragePlanner,
    budget_s: float,
    bound: int,
) -> Run:
    from fasaco_edge.planners.path import walk_figures  # noqa: PLC0415
    from fasaco_edge.planners.planner import TimeBudget, ignore, never  # noqa: PLC0415

    has_budget = name in REGISTRY and REGISTRY[name].has_local_search
    stop = TimeBudget(budget_s) if has_budget else never
    cpu = time.thread_time()
    try:
        path = planner.plan(problem, stop, ignore)
    except (PlannerFailed, IllegalWalk) as error:
        # The other planners are measured nevertheless.
        is_late = isinstance(error.__cause__, TookTooLongError)
        ended_s = getattr(planner, "most_s", None) if is_late else None
        return Run(grid.name, problem.cells, name, None, 0.0, bound, error, ended_s)
    cpu_s = time.thread_time() - cpu
    walk = walk_figures(grid.lattice, path.cells)
    return Run(grid.name, problem.cells, name, walk, cpu_s, bound)


def _report(args: argparse.Namespace, runs: Sequence[Run]) -> Report:
    grids = list(dict.fromkeys(run.grid for run in runs))
    figures = [_figures([run for run in runs if run.grid == grid]) for grid in grids]
    tables = [_table(grid) for grid in figures] or [ResultTable("no walks", HEADER, ())]
    first, *others = tables
    return Report(
        title=first.title,
        header=HEADER,
        rows=first.rows,
        figures={
            "ants": args.ants,
            "velocities": args.velocities,
            "seeds": args.seeds,
            "end": args.end,
            "budget_s": args.budget or SEARCH_S,
            "grids": figures,
        },
        remarks=(
            "medians over the seeds (with their range); n_r_paper: revisits including the "
            "way home, as in the paper's Table I",
        ),
        further=tuple(others),
        # One error per kind: the lines below the first may differ from run to run.
        faults=tuple(
            {str(run.fault).split("\n")[0]: run.fault for run in runs if run.fault}.values()
        ),
    )


def _figures(runs: Sequence[Run]) -> dict[str, Any]:
    """Return the figures of the runs on one grid, as JSON values."""
    rows = []
    for name in dict.fromkeys(run.planner for run in runs):
        mine = [run for run in runs if run.planner == name]
        walks = [run.walk for run in mine if run.walk]
        row: dict[str, Any] = {"planner": name, "runs": len(walks)}
        if walks:
            counts = {what: Spread.of([getattr(walk, what) for walk in walks]) for what in FIGURES}
            counts["cpu_s"] = Spread.of([run.cpu_s for run in mine if run.walk])
            row |= {what: document(spread) for what, spread in counts.items()}
        if faults := [run.fault for run in mine if run.fault]:
            row |= {"failed": len(faults), "why": str(faults[0]), "code": faults[0].code}
            row["ended_s"] = max((run.ended_s for run in mine if run.ended_s), default=None)
        rows.append(row)
    return {
        "grid": runs[0].grid,
        "cells": runs[0].cells,
        "bound_steps": runs[0].bound_steps,
        "rows": rows,
    }


def _table(grid: dict[str, Any]) -> ResultTable:
    columns = ("steps", "revisits", "n_r_paper", "turns_90")
    rows = tuple(
        (row["planner"], *(_range(row[what]) for what in columns), f"{row['cpu_s']['median']:.3f}")
        if row["runs"]
        else (row["planner"], _failed(row), *("-" for _ in range(len(HEADER) - 2)))
        for row in grid["rows"]
    )
    name = Path(grid["grid"]).stem
    title = f"{name}: {grid['cells']} cells, at least {grid['bound_steps']} steps"
    return ResultTable(title, HEADER, rows)


def _failed(row: dict[str, Any]) -> str:
    return f"no walk\nafter {row['ended_s']:g} s" if row["ended_s"] else "failed"


def _range(spread: dict[str, float]) -> str:
    median, low, high = (spread[name] for name in ("median", "low", "high"))
    return f"{median:g}" if low == high else f"{median:g}\n({low:g}-{high:g})"


PLANNERS = Benchmark(
    name="planners",
    summary="the walks of all planners, and of your own, side by side",
    description="Plan with every planner, and with those of your own, on each grid with each "
    "seed, on one thread with warm kernels. colony-search is what `plan` and missions use, fasaco "
    "the paper's colony. A turn costs nothing, as the paper counts.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench planners --planner mine.py:depth_first
  fasaco-edge bench planners --planner mine.py:depth_first lab.planners:Spiral --maps basement
  fasaco-edge bench planners --grids grid.npy --seeds 10 --json
""",
)
