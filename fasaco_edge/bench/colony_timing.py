"""Time the compiled planners, and beside them the naive twins of the tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.bench.grids import NamedGrid, read_grid
from fasaco_edge.bench.naive_twin import load_naive, naive_file
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.fasaco import Fasaco
from fasaco_edge.planners.planner import ignore
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import planner_of
from fasaco_edge.planners.stopping import never
from fasaco_edge.planners.warmup import warm_up

BASELINES = ("stc", "spiral-stc", "zigzag")
# They take less than a millisecond: one run says nothing.
BASELINE_RUNS = 20
_NO_COLONY = ColonyConfig()


@dataclass(frozen=True, slots=True)
class Timing:
    """One planner's run.

    Attributes:
        grid: name of the grid.
        cells: cells to cover.
        steps: steps of the walk that was found.
        ants: how many ants walked.
        wall_s: time by the clock [s].
        cpu_s: time of the one thread on a processor [s].
        compiled: False for the naive twin.
        same_walk: of the twin, whether the compiled planner (with as many ants) finds the
            same walk, cell by cell; of several threads, whether one finds it.
        planner: its name.
        threads: on how many threads the ants walked.
    """

    grid: str
    cells: int
    steps: int
    ants: int
    wall_s: float
    cpu_s: float
    compiled: bool = True
    same_walk: bool | None = None
    planner: str = "fasaco"
    threads: int = 1


@dataclass(frozen=True, slots=True)
class TimingPlan:
    """What to time.

    Attributes:
        grids: coverage grids, maps, or names of built-in maps.
        colony: the colony.
        repeats: runs of the compiled colony on each grid.
        closed: whether walks end where they begin.
        naive_s: about how long the naive twin may run on each grid [s]; 0 for not at all.
        threads: how many threads are tried against one; 1 for no trial.
    """

    grids: tuple[str, ...]
    colony: ColonyConfig
    repeats: int
    closed: bool
    naive_s: float
    threads: int


def time_colony(plan: TimingPlan, say: Say) -> Generator[Timing, None, None]:
    """Yield the runs on each grid: the compiled ones, warm, then the naive one.

    Raises:
        FasacoError: a grid cannot be read or planned on.
    """
    file = naive_file() if plan.naive_s else None
    naive = load_naive(file) if file else None
    # Read first: a wrong name should not be found out after minutes.
    grids = [read_grid(grid) for grid in plan.grids]
    say("loading kernels")
    warm_up()
    for grid in grids:
        end = grid.start if plan.closed else None
        problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
        say(f"{grid.name}: compiled")
        Fasaco(_smallest(plan.colony)).plan(problem)
        for _ in range(plan.repeats):
            # In turn, so that a machine that slows down does so for both.
            yield _time_compiled(grid, problem, plan.colony)
            if plan.threads > 1:
                yield _time_threads(grid, problem, plan)
        if naive is not None:
            say(f"{grid.name}: naive twin")
            yield _time_naive(naive, grid, problem, plan)
            for name in BASELINES:
                say(f"{grid.name}: {name}")
                yield from _time_baseline(naive, grid, problem, name)


def _time_compiled(grid: NamedGrid, problem: CoverageProblem, colony: ColonyConfig) -> Timing:
    path, wall_s, cpu_s = _timed(lambda: Fasaco(colony).plan(problem))
    return Timing(grid.name, problem.cells, path.steps, path.work.ants, wall_s, cpu_s)


def _time_threads(grid: NamedGrid, problem: CoverageProblem, plan: TimingPlan) -> Timing:
    together, wall_s, cpu_s = _timed(lambda: Fasaco(plan.colony, plan.threads).plan(problem))
    same = together.cells.tobytes() == Fasaco(plan.colony).plan(problem).cells.tobytes()
    return Timing(
        grid=grid.name,
        cells=problem.cells,
        steps=together.steps,
        ants=together.work.ants,
        wall_s=wall_s,
        cpu_s=cpu_s,
        same_walk=same,
        threads=plan.threads,
    )


def _time_baseline(
    naive: ModuleType, grid: NamedGrid, problem: CoverageProblem, name: str
) -> Generator[Timing, None, None]:
    """Yield the compiled baseline's quickest run, and its twin's."""
    planner = planner_of(name, _NO_COLONY)
    runs = [_timed(lambda: planner.plan(problem, never, ignore)) for _ in range(BASELINE_RUNS)]
    path, wall_s, cpu_s = min(runs, key=lambda run: run[1])
    yield Timing(grid.name, problem.cells, path.steps, 0, wall_s, cpu_s, planner=name)
    # The twin walks home in any case, as spanning-tree coverage does.
    closed = CoverageProblem.of(problem.lattice, problem.start, end=problem.start)
    walk, wall_s, cpu_s = _timed(lambda: _naive_baseline(naive, closed, name))
    window = problem.lattice.window
    cells = planner.plan(closed, never, ignore).cells - (window.row0, window.col0)
    same = cells.tolist() == [list(cell) for cell in walk]
    steps = len(walk) - 1
    yield Timing(grid.name, problem.cells, steps, 0, wall_s, cpu_s, False, same, name)


def _naive_baseline(
    naive: ModuleType, problem: CoverageProblem, name: str
) -> list[tuple[int, int]]:
    steps, start = problem.lattice.steps, problem.lattice.local(problem.start)
    walk: list[tuple[int, int]]
    if name == "stc":
        walk = naive.stc(steps, problem.to_cover, start)
    else:
        rule = {"spiral-stc": naive.SPIRAL, "zigzag": naive.ZIGZAG}[name]
        walk = naive.sweep(steps, problem.to_cover, start, rule, end=start)
    return walk


def _time_naive(
    naive: ModuleType, grid: NamedGrid, problem: CoverageProblem, plan: TimingPlan
) -> Timing:
    """Run the twin with as many ants as ``naive_s`` allow; one for each cohort at least."""
    colony = _smallest(plan.colony)
    walk, wall_s, cpu_s = _timed_naive(naive, problem, colony)
    # Again where a few ants, slow as the first ones are, made a poor guess.
    while (ants := _affordable(plan, wall_s / colony.ants)) > 2 * colony.ants:
        colony = replace(colony, ants=ants)
        walk, wall_s, cpu_s = _timed_naive(naive, problem, colony)
    window = problem.lattice.window
    cells = Fasaco(colony).plan(problem).cells - (window.row0, window.col0)
    return Timing(
        grid=grid.name,
        cells=problem.cells,
        steps=len(walk) - 1,
        ants=colony.ants,
        wall_s=wall_s,
        cpu_s=cpu_s,
        compiled=False,
        same_walk=cells.tolist() == [list(cell) for cell in walk],
    )


def _timed_naive(
    naive: ModuleType, problem: CoverageProblem, colony: ColonyConfig
) -> tuple[list[tuple[int, int]], float, float]:
    steps, start = problem.lattice.steps, problem.lattice.local(problem.start)
    end = start if problem.closed else None
    return _timed(lambda: naive.fasaco(steps, problem.to_cover, start, colony, end))


def _affordable(plan: TimingPlan, s_per_ant: float) -> int:
    return min(plan.colony.ants, int(plan.naive_s / s_per_ant))


def _smallest(colony: ColonyConfig) -> ColonyConfig:
    return replace(colony, ants=len(colony.velocities))


def _timed(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return the result, wall seconds, and seconds of this thread on a processor."""
    wall, cpu = time.perf_counter(), time.thread_time()
    result = call()
    return result, time.perf_counter() - wall, time.thread_time() - cpu
