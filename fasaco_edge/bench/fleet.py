"""``bench fleet``: how much sooner several robots are done in one building.

Planned offline here; by real daemons in ``bench.fleet_online``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
    seed,
)
from fasaco_edge.bench.fleet_online import (
    OnlineRun,
    add_online_options,
    measure_online,
    report_online,
)
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.fleet.division import Division, divide
from fasaco_edge.planners.fleet.first_tours import Fleet
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.planner import StoppingCriterion, TimeBudget
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.warmup import warm_up

MAPS, ONLINE_MAPS = ("flat", "office", "basement"), ("flat",)
# Cost of a step of the built-in maps' robot [s].
STEP_S = 1.2
HEADER = ("building", "robots", "cells", "longest", "of an even share", "bound", "twice", "CPU s")


@dataclass(frozen=True, slots=True)
class SharedWalks:
    """A building that robots share, each on a walk that returns to its start.

    Attributes:
        building, robots: the question.
        cells: to cover.
        longest_steps: steps of the longest walk.
        steps: of all walks.
        bound_steps: the lower bound of the longest walk.
        passed_twice: share of the cells that two or more robots pass.
        cpu_s: processor time [s].
    """

    building: str
    robots: int
    cells: int
    longest_steps: int
    steps: int
    bound_steps: int
    passed_twice: float
    cpu_s: float

    @property
    def ratio(self) -> float:
        """The longest walk's steps over an even share of the cells."""
        return self.longest_steps * self.robots / self.cells

    @property
    def bound_ratio(self) -> float:
        """Its lower bound over an even share of the cells."""
        return self.bound_steps * self.robots / self.cells


def plan_shared(
    grid: NamedGrid, fleet: Fleet, stop: StoppingCriterion
) -> tuple[SharedWalks, Division]:
    """Plan one walk for each robot; return the figures, and the walks."""
    began = time.process_time()
    division = divide(grid.lattice, fleet, stop)
    cpu_s = time.process_time() - began
    window = grid.lattice.window
    times = np.zeros(grid.lattice.states.shape, np.int64)
    for walk in division.walks:
        times[tuple((np.unique(walk, axis=0) - (window.row0, window.col0)).T)] += 1
    steps = [len(walk) - 1 for walk in division.walks]
    shared = SharedWalks(
        building=grid.name,
        robots=len(steps),
        cells=division.cells,
        longest_steps=max(steps),
        steps=sum(steps),
        bound_steps=division.lower_bound_steps,
        passed_twice=round(np.count_nonzero(times > 1) / division.cells, 4),
        cpu_s=round(cpu_s, 3),
    )
    return shared, division


def drawn_starts(cells: NDArray[np.int64], count: int, seed: int) -> list[Cell]:
    """Return some of cells, int64 (n, 2), drawn at random, the same for one seed."""
    random = np.random.Generator(np.random.PCG64((seed, count)))
    chosen = random.choice(cells, min(count, len(cells)), replace=False)
    return [(row, col) for row, col in chosen.tolist()]


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, MAPS)
    parser.add_argument(
        "--robots", type=positive, nargs="+", default=[1, 2, 4, 8], metavar="N",
        help="how many share it (default: 1 2 4 8)",
    )  # fmt: skip
    parser.add_argument(
        "--budget", type=seconds_above_zero, default=1.0, metavar="S",
        help="search time of a plan [s] (default: 1)",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed, default=0, help="of starts and search (default: 0)")
    add_online_options(parser)


def _measure(args: argparse.Namespace, say: Say) -> Generator[SharedWalks | OnlineRun, None, None]:
    if args.online:
        yield from measure_online(args, grid_names(args, ONLINE_MAPS), say)
        return
    warm_up()
    for name in grid_names(args, MAPS):
        grid = read_grid(name)
        to_cover = CoverageProblem.of(grid.lattice, grid.start).to_cover
        window = grid.lattice.window
        cells = np.argwhere(to_cover) + np.array((window.row0, window.col0))
        for robots in args.robots:
            say(f"{name}, {robots} robots")
            starts = [grid.start, *drawn_starts(cells, robots - 1, args.seed)]
            fleet = Fleet(starts, CoverageCost(STEP_S, 0.0), seed=args.seed)
            yield plan_shared(grid, fleet, TimeBudget(args.budget))[0]


def _report(args: argparse.Namespace, samples: Sequence[SharedWalks | OnlineRun]) -> Report:
    plans = [sample for sample in samples if isinstance(sample, SharedWalks)]
    if args.online:
        return report_online(args, [run for run in samples if isinstance(run, OnlineRun)])
    return Report(
        title=f"robots that share a building and return, {args.budget:g} s of search",
        header=HEADER,
        rows=tuple(
            (
                plan.building,
                str(plan.robots),
                str(plan.cells),
                f"{plan.longest_steps} steps",
                f"{plan.ratio:.3f}",
                f"{plan.bound_ratio:.3f}",
                f"{plan.passed_twice:.1%}",
                f"{plan.cpu_s:.2f}",
            )
            for plan in plans
        ),
        figures={
            "budget_s": args.budget,
            "plans": [{**asdict(plan), "ratio": round(plan.ratio, 4)} for plan in plans],
        },
        remarks=(
            "longest: of the robots' walks. bound: no division has a shorter longest walk. twice: "
            "cells that two or more robots pass.",
        ),
    )


def _count(args: argparse.Namespace) -> int:
    if args.online:
        runs: int = len(grid_names(args, ONLINE_MAPS)) * len(args.robots) * args.repeats
        return runs
    return len(grid_names(args, MAPS)) * len(args.robots)


FLEET = Benchmark(
    name="fleet",
    summary="several robots in one building: the longest walk against an even share",
    description="Plan one walk for each of several robots that share a building, as `plan --robots`"
    " does: the first robot starts where one alone would, the others anywhere. With --online real "
    "daemons and simulated robots cover a building that none of them knows.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench fleet
  fasaco-edge bench fleet --maps warehouse --robots 2 3 --budget 10 --json
  fasaco-edge bench fleet --online --robots 1 2 4
  fasaco-edge bench fleet --online --maps office --robots 3 --kill-after 120 --split-after 60
""",
)
