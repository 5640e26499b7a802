"""``benchmarks fleet``: one walk for each of several robots that share a building."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass

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
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.fleet.division import Division, divide
from fasaco_edge.planners.fleet.sharing import Fleet
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.planner import TimeBudget
from fasaco_edge.planners.warmup import warm_up
from tests.benchmarks.buildings import building
from tests.benchmarks.harness import WrongWalkError, check_names, grid_name
from tests.benchmarks.judge import check_walk, reachable

STEP_S, QUARTER_TURN_S = 1.2, 1.5
SPREAD, TOGETHER = "spread", "together"
HEADER = (
    "robots",
    "starts",
    "plans",
    "longest",
    "worst",
    "steps",
    "passed twice",
    "bound",
    "CPU s",
)


@dataclass(frozen=True, slots=True)
class Shared:
    """A building that robots share.

    Attributes:
        grid, robots, starts, seed: the question; ``starts`` is spread or together.
        cells: to cover.
        longest: steps of the longest walk, over an even share of the cells.
        steps: of all walks, over the cells.
        passed_twice: share of the cells that two or more robots pass.
        bound: the lower bound of the longest walk, over an even share of the cells.
        cpu_s: processor time.
    """

    grid: str
    robots: int
    starts: str
    seed: int
    cells: int
    longest: float
    steps: float
    passed_twice: float
    bound: float
    cpu_s: float


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, ())
    parser.add_argument(
        "--generated", type=positive, default=3, metavar="N", help="buildings (default: 3)"
    )
    parser.add_argument("--cells", type=positive, default=2_000, help="of each (default: 2000)")
    parser.add_argument("--robots", type=positive, nargs="+", default=[2, 4, 8], metavar="N")
    parser.add_argument("--starts", choices=(SPREAD, TOGETHER), nargs="+", default=[SPREAD])
    parser.add_argument("--seeds", type=positive, default=1, metavar="N", help="0 to N - 1")
    parser.add_argument("--budget", type=float, default=1.0, metavar="S", help="(default: 1)")
    parser.add_argument("--threads", type=positive, default=1, metavar="N", help="(default: 1)")
    parser.add_argument("--cost", choices=("steps", "turns"), default="steps")


def _names(args: argparse.Namespace) -> Sequence[str]:
    return (*args.grids, *args.maps)


def _grids(args: argparse.Namespace) -> Iterator[tuple[str, NamedGrid]]:
    for name in _names(args):
        yield grid_name(name), read_grid(name)
    for seed in range(0 if _names(args) else args.generated):
        yield f"building {seed}", building(args.cells, seed)


def _measure(args: argparse.Namespace, say: Say) -> Generator[Shared, None, None]:
    check_names(_names(args))
    warm_up()
    cost = CoverageCost(STEP_S, QUARTER_TURN_S if args.cost == "turns" else 0.0)
    for name, grid in _grids(args):
        lattice = grid.lattice
        first = lattice.local(grid.start)
        reached = reachable(lattice.steps, first)
        for robots in args.robots:
            for how in args.starts:
                for seed in range(args.seeds):
                    say(f"{name}, {robots} robots, {how}, seed {seed}")
                    starts = starts_of(reached, robots, how, seed)
                    there = (lattice.window.row0, lattice.window.col0)
                    placed = [(row + there[0], col + there[1]) for row, col in starts]
                    fleet = Fleet(placed, cost, seed=seed, threads=args.threads)
                    began = time.process_time()
                    division = divide(lattice, fleet, TimeBudget(args.budget))
                    cpu_s = time.process_time() - began
                    walks = [walk - there for walk in division.walks]
                    yield _judged(
                        (name, robots, how, seed), lattice.steps, reached, walks, starts,
                        division, cpu_s,
                    )  # fmt: skip


def starts_of(reached: NDArray[np.bool_], robots: int, how: str, seed: int) -> list[Cell]:
    """Return where robots begin: anywhere, or all around one place.

    Args:
        reached: bool (rows, cols), the cells they can be in.
        robots: how many.
        how: SPREAD or TOGETHER.
        seed: of the places.
    """
    cells = np.argwhere(reached)
    random = Random(PCG64((seed, robots)))
    if how == SPREAD:
        chosen = cells[random.choice(len(cells), robots, replace=False)]
    else:
        away = np.abs(cells - cells[random.integers(len(cells))]).sum(axis=1)
        chosen = cells[np.argsort(away, kind="stable")[:robots]]
    return [(row, col) for row, col in chosen.tolist()]


def _judged(
    question: tuple[str, int, str, int],
    steps: NDArray[np.uint8],
    reached: NDArray[np.bool_],
    walks: Sequence[NDArray[np.int32]],
    starts: Sequence[Cell],
    division: Division,
    cpu_s: float,
) -> Shared:
    """Return the figures, counted by the judge of walks.

    Raises:
        WrongWalkError: a walk is not legal, or together they leave cells out.
    """
    nothing = np.zeros_like(reached)
    passed = np.zeros(reached.shape, np.int64)
    lengths = []
    for walk, start in zip(walks, starts, strict=True):
        verdict = check_walk(steps, nothing, walk, start, start)
        if not verdict.legal:
            raise WrongWalkError(f"{question}: {verdict.problems}")
        rows, cols = np.unique(walk, axis=0).T
        passed[rows, cols] += 1
        lengths.append(verdict.steps)
    if (reached & (passed == 0)).any():
        raise WrongWalkError(f"{question}: {np.count_nonzero(reached & (passed == 0))} left out")
    name, robots, how, seed = question
    cells = int(np.count_nonzero(reached))
    return Shared(
        grid=name,
        robots=robots,
        starts=how,
        seed=seed,
        cells=cells,
        longest=max(lengths) * robots / cells,
        steps=sum(lengths) / cells,
        passed_twice=np.count_nonzero(passed > 1) / cells,
        bound=division.lower_bound_steps * robots / cells,
        cpu_s=cpu_s,
    )


def _report(args: argparse.Namespace, plans: Sequence[Shared]) -> Report:
    rows = []
    for robots in args.robots:
        for how in args.starts:
            some = [plan for plan in plans if (plan.robots, plan.starts) == (robots, how)]
            if not some:
                continue
            middle = [
                statistics.median(getattr(plan, name) for plan in some)
                for name in ("longest", "steps", "passed_twice", "bound", "cpu_s")
            ]
            longest, steps, twice, bound, cpu_s = middle
            worst = max(plan.longest for plan in some)
            figures = f"{longest:.3f}", f"{worst:.3f}", f"{steps:.3f}", f"{twice:.1%}"
            rows.append(
                (str(robots), how, str(len(some)), *figures, f"{bound:.3f}", f"{cpu_s:.2f}")
            )
    return Report(
        title=f"buildings shared by robots that return, {args.budget:g} s, {args.cost}",
        header=HEADER,
        rows=tuple(rows),
        figures={"budget_s": args.budget, "plans": [asdict(plan) for plan in plans]},
        goals=(),
        remarks=(
            "longest: steps of the longest walk, over an even share of the cells; worst: of all "
            "plans; else medians. steps: of all walks, over the cells. bound: no division has a "
            "shorter longest walk. together: all begin around one place.",
        ),
    )


def _count(args: argparse.Namespace) -> int:
    grids = len(_names(args)) or args.generated
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
  python -m tests.benchmarks fleet --grids *.npy --robots 4 8 --starts spread together --json
""",
)
