"""``benchmarks quality``: cost of plans over their certified lower bounds, by time budget."""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TypeVar

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    ResultTable,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
)
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.planner import TimeBudget
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import SECONDS, check_names, grid_name, judged, planner_for

Key = TypeVar("Key")

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement", "warehouse")
# A first plan on a grid finds memory and caches cold: one that does not count.
WARM_S = 0.02


@dataclass(frozen=True, slots=True, order=True)
class Setting:
    """What is planned, and how.

    Attributes:
        end: "anywhere" or "home".
        cost: "steps", turns being free, or "turns".
        variant: what perturbs, see ``harness.planner_for``.
    """

    end: str
    cost: str
    variant: str

    def problem(self, grid: NamedGrid, turn_s: float) -> CoverageProblem:
        """Return the problem on a grid; a step takes 1 s, a quarter-turn ``turn_s`` [s]."""
        cost = CoverageCost(1.0, turn_s) if self.cost == "turns" else STEPS_ALONE
        end = grid.start if self.end == "home" else None
        return CoverageProblem.of(grid.lattice, grid.start, end=end, cost=cost)


@dataclass(frozen=True, slots=True)
class QualityRun:
    """One plan, judged.

    Attributes:
        grid, cells: name of the grid, and cells to cover.
        setting, budget_s, seed: what was planned, in what time [s].
        steps, turns_90, turns_180: of the walk, counted by the judge.
        mission_s: time [s] with turns at their price, whatever was minimised.
        cost_s, bound_s: cost of the walk, and the search's own lower bound [s].
        first_walk_s, wall_s: time to the first complete walk, and until the path was there [s].
    """

    grid: str
    cells: int
    setting: Setting
    budget_s: float
    seed: int
    steps: int
    turns_90: int
    turns_180: int
    mission_s: float
    cost_s: float
    bound_s: float
    first_walk_s: float
    wall_s: float

    @property
    def ratio(self) -> float:
        """Cost to the lower bound."""
        return self.cost_s / self.bound_s


def _measure(args: argparse.Namespace, say: Say) -> Generator[QualityRun, None, None]:
    """Yield every run, kernels warm; each seed goes over all grids before the next one does."""
    names = grid_names(args, DEFAULT_MAPS)
    check_names(names)
    grids = [read_grid(name) for name in names]
    for grid in grids:
        if CoverageProblem.of(grid.lattice, grid.start).cells < 2:
            raise BadConfiguration(f"{grid_name(grid.name)} has one cell only: no walk to measure")
    say("loading kernels")
    warm_up()
    for grid, setting in itertools.product(grids, _settings(args)):
        say(f"{grid_name(grid.name)}: warming up")
        problem = setting.problem(grid, args.turn_s)
        planner_for(0, setting.variant).plan(problem, TimeBudget(WARM_S))
    for seed, grid in itertools.product(range(args.seeds), grids):
        say(f"seed {seed}: {grid_name(grid.name)}")
        for setting, budget_s in itertools.product(_settings(args), sorted(set(args.budgets))):
            yield _run(grid, setting, args.turn_s, seed, budget_s)


def _settings(args: argparse.Namespace) -> list[Setting]:
    choices = map(dict.fromkeys, (args.end, args.cost, args.variants))
    return [Setting(*chosen) for chosen in itertools.product(*choices)]


def _run(
    grid: NamedGrid, setting: Setting, turn_s: float, seed: int, budget_s: float
) -> QualityRun:
    problem = setting.problem(grid, turn_s)
    planner = planner_for(seed, setting.variant)
    began = time.perf_counter()
    path = planner.plan(problem, TimeBudget(budget_s))
    wall_s = time.perf_counter() - began
    verdict = judged(problem, path)
    return QualityRun(
        grid=grid_name(grid.name),
        cells=problem.cells,
        setting=setting,
        budget_s=budget_s,
        seed=seed,
        steps=verdict.steps,
        turns_90=verdict.turns_90,
        turns_180=verdict.turns_180,
        mission_s=verdict.steps + turn_s * (verdict.turns_90 + 2 * verdict.turns_180),
        cost_s=path.cost_s,
        bound_s=path.lower_bound_cost_s,
        first_walk_s=path.first_walk_s,
        wall_s=wall_s,
    )


SUMMARY_HEADER = ("", "budget [s]", "to bound, median", "worst", "slowest [s]")
HEADER = (
    "grid", "budget [s]", "bound [s]", "cost [s]", "worst", "to bound", "time [s]",
    "turns", "first [ms]",
)  # fmt: skip
REMARKS = (
    "Medians over the seeds; worst: of all seeds, in the first table of all grids. to bound: cost "
    "to the search's own lower bound. time: a second a step, a turn at the price of --turn-s, "
    "whatever was minimised. turns: by 90 and by 180 degrees. first: until the first complete "
    "walk. slowest: the longest time until a path was there.",
    "Every walk was judged legal and complete by code that shares nothing with the planner.",
)


def report(args: argparse.Namespace, runs: Sequence[QualityRun]) -> Report:
    """Sum up any number of runs, even none."""
    settings = sorted({run.setting for run in runs})
    return Report(
        title=f"cost to the lower bound over all grids, {args.seeds} seeds, one thread",
        header=SUMMARY_HEADER,
        rows=tuple(_summary(runs)),
        figures={"seeds": args.seeds, "turn_s": args.turn_s, "runs": [*map(asdict, runs)]},
        remarks=REMARKS,
        further=(
            *(ResultTable(_name(one), HEADER, tuple(_rows(runs, one))) for one in settings),
            *_variant_tables(runs),
        ),
    )


def _summary(runs: Sequence[QualityRun]) -> Iterator[tuple[str, ...]]:
    for (setting, budget_s), some in _by(runs, lambda run: (run.setting, run.budget_s)).items():
        grids = _by(some, lambda run: run.grid).values()
        ratios = [statistics.median(run.ratio for run in grid) for grid in grids]
        worst = max(run.ratio for run in some)
        slowest = max(run.wall_s for run in some)
        median = statistics.median(ratios)
        yield _name(setting), f"{budget_s:g}", f"{median:.4f}", f"{worst:.4f}", f"{slowest:.3f}"


def _rows(runs: Sequence[QualityRun], setting: Setting) -> Iterator[tuple[str, ...]]:
    mine = [run for run in runs if run.setting == setting]
    for (grid, budget_s), some in _by(mine, lambda run: (run.grid, run.budget_s)).items():

        def median(figure: str, some: Sequence[QualityRun] = some) -> float:
            return float(statistics.median(getattr(run, figure) for run in some))

        yield (
            grid,
            f"{budget_s:g}",
            f"{median('bound_s'):g}",
            f"{median('cost_s'):g}",
            f"{max(run.cost_s for run in some):g}",
            f"{median('ratio'):.4f}",
            f"{median('mission_s'):g}",
            f"{median('turns_90'):g} {median('turns_180'):g}",
            f"{1e3 * median('first_walk_s'):.2f}",
        )


def _variant_tables(runs: Sequence[QualityRun]) -> Iterator[ResultTable]:
    """Yield a table for each kind of problem that was solved by several variants."""
    variants = list(dict.fromkeys(run.setting.variant for run in runs))
    if len(variants) < 2:
        return
    for (end, cost), posed in _by(runs, lambda run: (run.setting.end, run.setting.cost)).items():
        rows = []
        for (grid, budget_s), some in _by(posed, lambda run: (run.grid, run.budget_s)).items():
            found = _by(some, lambda run: run.setting.variant)
            ratios = (statistics.median(run.ratio for run in found[one]) for one in found)
            texts = dict(zip(found, (f"{ratio:.4f}" for ratio in ratios), strict=True))
            rows.append((grid, f"{budget_s:g}", *(texts.get(one, "-") for one in variants)))
        title = f"variants: {cost} to bound, end {end}"
        yield ResultTable(title, ("grid", "budget [s]", *variants), tuple(rows))


def _by(
    runs: Sequence[QualityRun], key: Callable[[QualityRun], Key]
) -> dict[Key, list[QualityRun]]:
    """Return runs that have a key in common, in the order in which keys come first."""
    groups: dict[Key, list[QualityRun]] = {}
    for run in runs:
        groups.setdefault(key(run), []).append(run)
    return groups


def _name(setting: Setting) -> str:
    cost = "steps and turns" if setting.cost == "turns" else "steps alone"
    return f"{cost}, end {setting.end}, {setting.variant}"


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument(
        "--budgets", nargs="+", type=seconds_above_zero, default=[0.02, 0.1, 1.0], metavar="S",
        help="time budgets of a plan [s] (default: 0.02 0.1 1)",
    )  # fmt: skip
    parser.add_argument(
        "--seeds", type=positive, default=10, metavar="N",
        help="use seeds 0 to N - 1 (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--turn-s", type=SECONDS, default=1.5, metavar="S",
        help="time of a quarter-turn [s]; a step takes 1 s (default: %(default)g)",
    )  # fmt: skip
    for name, among, default, what in (
        ("--end", ("anywhere", "home"), ["anywhere"], "where walks end"),
        ("--cost", ("steps", "turns"), ["steps", "turns"], "cost: steps alone, or with turns"),
        (
            "--variants", ("ants", "flat", "none"), ["ants"],
            "perturbations of the walk: half of them by ants on their trail; by ants on a uniform "
            "trail; or without ants",
        ),
    ):  # fmt: skip
        shown = f"{what} (default: {' '.join(default)})"
        parser.add_argument(name, nargs="+", choices=among, default=default, help=shown)


def _count(args: argparse.Namespace) -> int:
    grids = len(grid_names(args, DEFAULT_MAPS))
    return math.prod((grids, args.seeds, len(_settings(args)), len(set(args.budgets))))


QUALITY = Benchmark(
    name="quality",
    summary="cost of plans over their lower bounds, by time budget",
    description="Plan with colony-search on each grid, with each budget and seed, on one thread, "
    "with kernels loaded. A judge that shares no code with the planner checks every walk.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=report,
    epilog="""\
examples:
  python -m tests.benchmarks quality
  python -m tests.benchmarks quality --maps office --budgets 0.02 0.1 1 10 --cost steps
  python -m tests.benchmarks quality --end home --cost steps --budgets 1 --json
  python -m tests.benchmarks quality --variants ants flat none
""",
)
