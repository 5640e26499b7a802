"""``benchmarks full``: full plans that start from the previous walk, against plans from none."""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.random import PCG64
from numpy.random import Generator as Random
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    add_grid_options,
    grid_names,
    positive,
)
from fasaco_edge.errors import NothingToCover
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.grids import read_grid
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import check_covered, check_names, grid_name, planner_for

DEFAULT_MAPS = ("flat", "office", "walled_grid", "basement", "warehouse")
STEP_S, QUARTER_TURN_S = 1.2, 1.5
# The next 5 m on cells of 0.3 m.
NEXT_STEPS = 17
# Share of the cells beside walls that a changed map loses.
LOST = 0.06
# Share of the cells beyond these that it gains.
FOUND = 0.03
HEADER = ("situation", "plans", "cost", "+-", "kept, from nothing", "kept, from the walk")


class Situation(NamedTuple):
    """Why a full plan is made: where, from which cell, what is covered by then."""

    name: str
    lattice: CoverageLattice
    start: Cell
    covered: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Pair:
    """Two full plans of the same work.

    Attributes:
        grid, situation, seed: of both.
        ratio: cost of the one that begins with the walk before, over the other's.
        kept_anew, kept: shares of the next 5 m of the walk before that they keep.
    """

    grid: str
    situation: str
    seed: int
    ratio: float
    kept_anew: float
    kept: float


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument("--cost", choices=("steps", "turns"), default="steps")
    parser.add_argument(
        "--seeds", type=positive, default=3, metavar="N",
        help="use seeds 0 to N - 1 (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--proposals", type=positive, default=2_000_000,
        help="proposals of each plan (default: %(default)s)",
    )  # fmt: skip


SITUATIONS = ("asked for", "map corrected", "carried", "other order")


def _measure(args: argparse.Namespace, say: Say) -> Generator[Pair, None, None]:
    names = grid_names(args, DEFAULT_MAPS)
    check_names(names)
    warm_up()
    cost = CoverageCost(STEP_S, QUARTER_TURN_S if args.cost == "turns" else 0.0)
    limit = WorkLimit(SearchWork(proposals=args.proposals))
    for name in names:
        grid = read_grid(name)
        for seed in range(args.seeds):
            say(f"{grid_name(name)}, seed {seed}")
            lattice = CoverageLattice.from_free(grid.lattice.coverable)
            first = CoverageProblem.of(lattice, grid.lattice.local(grid.start), cost=cost)
            walk = planner_for(seed).plan(first, limit).cells
            at = int(len(walk) * Random(PCG64((seed, 7))).uniform(0.1, 0.5))
            before = walk[at:]
            for situation in _situations(lattice, walk[: at + 1], seed):
                try:
                    problem = CoverageProblem.of(
                        situation.lattice, situation.start, covered=situation.covered, cost=cost
                    )
                except NothingToCover:
                    continue  # as it is drawn, nothing of it can be reached
                # Another seed: the same one would find the same walk.
                planner = planner_for(seed + 100)
                anew = planner.plan(problem, limit)
                posed = replace(problem, before=before, is_full=True)
                path = planner.plan(posed, limit)
                check_covered(posed, path.cells)
                yield Pair(
                    grid=grid_name(name),
                    situation=situation.name,
                    seed=seed,
                    ratio=path.cost_s / anew.cost_s,
                    kept_anew=kept(before, anew.cells),
                    kept=kept(before, path.cells),
                )


def _situations(
    lattice: CoverageLattice, driven: NDArray[np.int32], seed: int
) -> Iterator[Situation]:
    """Yield why a robot that has driven so far gets a full plan."""
    random = Random(PCG64((seed, 11)))
    covered = np.zeros(lattice.coverable.shape, np.bool_)
    covered[tuple(driven.T)] = True
    row, col = driven[-1].tolist()
    yield Situation(SITUATIONS[0], lattice, (row, col), covered)
    free = lattice.coverable.copy()
    open_beside, shut_beside = _beside(free), _beside(~free)
    lost = free & shut_beside & (random.random(free.shape) < LOST)
    lost[row, col] = False
    free = (free & ~lost) | (~free & open_beside & (random.random(free.shape) < FOUND))
    corrected = CoverageLattice.from_free(free)
    yield Situation(SITUATIONS[1], corrected, (row, col), covered)
    left = np.argwhere(lattice.coverable & ~covered)
    there_row, there_col = left[int(random.integers(len(left)))].tolist()
    yield Situation(SITUATIONS[2], lattice, (there_row, there_col), covered)
    half = np.ones_like(covered)
    half[:, : len(covered.T) // 2] = False
    if (lattice.coverable & ~half).any():
        yield Situation(SITUATIONS[3], lattice, (row, col), half)


def _beside(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which cells lie beside a marked one."""
    around = np.pad(marked, 1)
    beside: NDArray[np.bool_] = (
        around[2:, 1:-1] | around[:-2, 1:-1] | around[1:-1, 2:] | around[1:-1, :-2]
    )
    return beside


def kept(before: NDArray[np.int32], after: NDArray[np.int32]) -> float:
    """Return the share of the next steps of a walk that another one begins with."""
    size = min(len(before), len(after), NEXT_STEPS + 1)
    same = (before[:size] == after[:size]).all(axis=1)
    return max((size if same.all() else int(np.argmin(same))) - 1, 0) / NEXT_STEPS


def _report(args: argparse.Namespace, pairs: Sequence[Pair]) -> Report:
    rows = []
    for name in SITUATIONS:
        some = [pair for pair in pairs if pair.situation == name]
        if not some:
            continue
        ratios = [pair.ratio for pair in some]
        error = statistics.pstdev(ratios) / len(ratios) ** 0.5
        ratio = statistics.fmean(ratios)
        kept_anew = statistics.fmean(pair.kept_anew for pair in some)
        kept_now = statistics.fmean(pair.kept for pair in some)
        shares = f"{kept_anew:.3f}", f"{kept_now:.3f}"
        rows.append((name, str(len(some)), f"{ratio:.4f}", f"{error:.4f}", *shares))
    return Report(
        title=f"full plans from the walk before, against from nothing; {args.cost}",
        header=HEADER,
        rows=tuple(rows),
        figures={"cost": args.cost, "pairs": [asdict(pair) for pair in pairs]},
        goals=(),
        remarks=(
            "cost: the plan from the previous walk over the plan from none, after equal work. "
            "kept: share of the next 5 m of the previous walk, up to the first change. carried: "
            "the robot is elsewhere, so nothing can be kept. map corrected: cells along walls "
            "appear and disappear.",
        ),
    )


FULL = Benchmark(
    name="full",
    summary="full plans from the previous walk, against plans from none",
    description="Plan, drive a part, then make a full plan: on request, on a corrected map, from "
    "another place, for another order; without a walk, and from the previous walk. Compare cost "
    "and the kept share of the next 5 m.",
    add_options=_add_options,
    count=lambda args: len(SITUATIONS) * args.seeds * len(grid_names(args, DEFAULT_MAPS)),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks full
  python -m tests.benchmarks full --grids *.npy --cost turns --seeds 10 --json
""",
)
