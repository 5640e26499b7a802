"""``benchmarks fleet``: one walk for each of several robots that share a building."""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.random import PCG64
from numpy.random import Generator as Random
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    add_grid_options,
    positive,
)
from fasaco_edge.fleet.planning.division import Fleet, divide
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.grids import NamedGrid, read_grid
from tests.benchmarks.buildings import building
from tests.benchmarks.harness import WrongWalkError, check_names, grid_name
from tests.benchmarks.judge import check_walk, reachable

STEP_S, QUARTER_TURN_S = 1.2, 1.5
SPREAD, TOGETHER = "spread", "together"
HEADER = (
    "building",
    "cells",
    "robots",
    "starts",
    "longest",
    "bound",
    "gap",
    "steps",
    "twice",
)
MEAN = "mean"


@dataclass(frozen=True, slots=True)
class SharedWalks:
    """Walks over a building that robots share, each back to its start; legal and complete.

    Attributes:
        building, robots, starts, seed: the question; ``starts`` is spread or together.
        cells: to cover.
        longest_steps: steps of the longest walk.
        steps: of all walks.
        bound_steps: the lower bound of the longest walk.
        ratio: the longest walk's steps over an even share of the cells.
        passed_twice: share of the cells that two or more robots pass.
        cpu_s: processor time [s].
    """

    building: str
    robots: int
    starts: str
    seed: int
    cells: int
    longest_steps: int
    steps: int
    bound_steps: int
    ratio: float
    passed_twice: float
    cpu_s: float


def plan_shared(
    grid: NamedGrid, reached: NDArray[np.bool_], fleet: Fleet, how: str, budget_s: float
) -> SharedWalks:
    """Plan one walk for each robot, within a processor time [s], and judge all.

    Raises:
        WrongWalkError: a walk is not legal, or together they leave cells out.
    """
    began = time.process_time()
    # Other programs do not take of processor time.
    division = divide(grid.lattice, fleet, lambda _: time.process_time() - began >= budget_s)
    cpu_s = time.process_time() - began
    corner = grid.lattice.window.row0, grid.lattice.window.col0
    walks = [walk - corner for walk in division.walks]
    starts = [grid.lattice.local(start) for start in fleet.starts]
    judge_walks(grid.lattice.steps, reached, walks, starts)
    times = np.zeros(grid.lattice.states.shape, np.int64)
    for walk in walks:
        times[tuple(np.unique(walk, axis=0).T)] += 1
    steps = [len(walk) - 1 for walk in walks]
    return SharedWalks(
        building=grid.name,
        robots=len(steps),
        starts=how,
        seed=fleet.seed,
        cells=division.cells,
        longest_steps=max(steps),
        steps=sum(steps),
        bound_steps=division.lower_bound_steps,
        ratio=round(max(steps) * len(steps) / division.cells, 4),
        passed_twice=round(np.count_nonzero(times > 1) / division.cells, 4),
        cpu_s=round(cpu_s, 3),
    )


def drawn_starts(cells: NDArray[np.int64], count: int, seed: int) -> list[Cell]:
    """Return some of cells, int64 (n, 2), drawn at random, the same for one seed."""
    random = Random(PCG64((seed, count)))
    chosen = random.choice(cells, min(count, len(cells)), replace=False)
    return [(row, col) for row, col in chosen.tolist()]


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, ())
    parser.add_argument(
        "--generated", type=int, metavar="N", help="buildings (default: 3, or 0 with grids or maps)"
    )
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="of the buildings")
    parser.add_argument("--cells", type=positive, default=2_000, help="of each (default: 2000)")
    parser.add_argument("--robots", type=positive, nargs="+", default=[2, 4, 8], metavar="N")
    parser.add_argument("--starts", choices=(SPREAD, TOGETHER), nargs="+", default=[SPREAD])
    parser.add_argument("--seeds", type=positive, default=1, metavar="N", help="0 to N - 1")
    parser.add_argument(
        "--budget", type=float, default=1.0, metavar="S", help="processor time (default: 1)"
    )
    parser.add_argument("--threads", type=positive, default=1, metavar="N", help="(default: 1)")
    parser.add_argument("--cost", choices=("steps", "turns"), default="steps")


def _names(args: argparse.Namespace) -> Sequence[str]:
    return (*args.grids, *args.maps)


def _grids(args: argparse.Namespace) -> Iterator[NamedGrid]:
    for name in _names(args):
        yield replace(read_grid(name), name=grid_name(name))
    for seed in range(args.first, args.first + _generated(args)):
        yield replace(building(args.cells, seed), name=f"building {seed}")


def _generated(args: argparse.Namespace) -> int:
    if args.generated is not None:
        return int(args.generated)
    return 0 if _names(args) else 3


def _measure(args: argparse.Namespace, say: Say) -> Generator[SharedWalks, None, None]:
    check_names(_names(args))
    warm_up()
    cost = CoverageCost(STEP_S, QUARTER_TURN_S if args.cost == "turns" else 0.0)
    for grid in _grids(args):
        window = grid.lattice.window
        reached = reachable(grid.lattice.steps, grid.lattice.local(grid.start))
        for robots, how, seed in itertools.product(args.robots, args.starts, range(args.seeds)):
            say(f"{grid.name}, {robots} robots, {how}, seed {seed}")
            starts = starts_of(reached, robots, how, seed)
            placed = [(row + window.row0, col + window.col0) for row, col in starts]
            fleet = Fleet(placed, cost, seed=seed, threads=args.threads)
            yield plan_shared(grid, reached, fleet, how, args.budget)


def starts_of(reached: NDArray[np.bool_], robots: int, how: str, seed: int) -> list[Cell]:
    """Return where robots begin: anywhere, or all around one place.

    Args:
        reached: bool (rows, cols), the cells they can be in.
        robots: how many.
        how: SPREAD or TOGETHER.
        seed: of the places.
    """
    cells = np.argwhere(reached)
    if how == SPREAD:
        return drawn_starts(cells, robots, seed)
    random = Random(PCG64((seed, robots)))
    away = np.abs(cells - cells[random.integers(len(cells))]).sum(axis=1)
    chosen = cells[np.argsort(away, kind="stable")[:robots]]
    return [(row, col) for row, col in chosen.tolist()]


def judge_walks(
    steps: NDArray[np.uint8],
    reached: NDArray[np.bool_],
    walks: Sequence[NDArray[np.int32]],
    starts: Sequence[Cell],
) -> None:
    """Judge closed walks that shall cover all cells together.

    Raises:
        WrongWalkError: a walk is not legal, or together they leave cells out.
    """
    nothing = np.zeros_like(reached)
    passed = np.zeros_like(reached)
    for walk, start in zip(walks, starts, strict=True):
        verdict = check_walk(steps, nothing, walk, start, start)
        if not verdict.legal:
            raise WrongWalkError(f"{len(walks)} robots, from {start}: {verdict.problems}")
        passed[tuple(walk.T)] = True
    if left := np.count_nonzero(reached & ~passed):
        raise WrongWalkError(f"{len(walks)} robots leave {left} cells out")


def _row(plans: Sequence[SharedWalks]) -> tuple[str, ...]:
    """Return means over plans of one question, from the robots on."""
    figures = [
        (
            plan.ratio,
            plan.bound_steps * plan.robots / plan.cells,
            plan.longest_steps / plan.bound_steps - 1.0,
            plan.steps / plan.cells,
            plan.passed_twice,
        )
        for plan in plans
    ]
    longest, bound, gap, steps, twice = map(statistics.mean, zip(*figures, strict=True))
    ratios = f"{longest:.3f}", f"{bound:.3f}", f"{gap:.1%}", f"{steps:.3f}", f"{twice:.1%}"
    return str(plans[0].robots), plans[0].starts, *ratios


def _report(args: argparse.Namespace, plans: Sequence[SharedWalks]) -> Report:
    rows = [
        (plan.building, str(plan.cells), *_row([plan]))
        for plan in sorted(plans, key=lambda plan: (plan.robots, plan.starts))
    ]
    for robots, how in itertools.product(args.robots, args.starts):
        some = [plan for plan in plans if (plan.robots, plan.starts) == (robots, how)]
        if len(some) > 1:
            rows.append((MEAN, "", *_row(some)))
    return Report(
        title=f"buildings shared by robots that return, {args.budget:g} s, {args.cost}",
        header=HEADER,
        rows=tuple(rows),
        figures={"budget_s": args.budget, "plans": [asdict(plan) for plan in plans]},
        goals=(),
        remarks=(
            "longest: steps of the longest walk, over an even share of the cells. bound: no "
            "division has a shorter longest walk; gap: how far it is above that. steps: of all "
            "walks, over the cells; twice: cells that two or more pass. together: all begin around "
            "one place.",
        ),
    )


def _count(args: argparse.Namespace) -> int:
    grids = len(_names(args)) + _generated(args)
    return math.prod((grids, len(args.robots), len(args.starts), args.seeds))


FLEET = Benchmark(
    name="fleet",
    summary="buildings shared by several robots: the longest walk against an even share",
    description="Plan one walk for each of several robots that share a building, and judge them: "
    "how long the longest is, and what sharing costs in steps and in cells passed twice.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks fleet
  python -m tests.benchmarks fleet --generated 1 --cells 12000 --first 13
  python -m tests.benchmarks fleet --grids *.npy --robots 4 8 --starts spread together --json
""",
)
