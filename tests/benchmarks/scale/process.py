"""One plan on one building, in a process of its own: so that the memory is its own.

``python -m tests.benchmarks.scale.process`` reads a ``ScaleTask`` as JSON and writes a
``ScaleRun`` as JSON. Kernels come from the cache; whoever compiles them starts it twice.
"""

from __future__ import annotations

import json
import os
import sys
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fasaco_edge.host.processes import peak_mb, resident_mb
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.planner import SearchProgress
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import judged, planner_for

# A gap is noted when it has fallen by so much of itself; and when it comes to one of these.
NOTED_FALL = 0.01
TARGETS = (0.05, 0.03)

# What proc(5) takes to forget how much memory a process ever had.
FORGET_PEAK = "5"


@dataclass(frozen=True, slots=True)
class ScaleTask:
    """What to plan: a coverage grid's file (.npy), its seed, and for how long [s]."""

    file: str
    seed: int
    budget_s: float


@dataclass(frozen=True, slots=True)
class ScaleRun:
    """One plan.

    Attributes:
        cells: cells to cover.
        seed: of the building and of the search.
        budget_s: how long it was to take [s].
        first_walk_s: time from the call to the first complete walk [s].
        target_s: gap, as in ``TARGETS``, to the time it was reached at [s]; None if never.
        noted: time [s] and gap, as the gap fell.
        gap: in the end.
        steps, lower_bound_steps: of the walk, and of any.
        wall_s: time until the path was there [s].
        idle_mb: resident with imports and kernels, before there was a grid [MB].
        peak_mb: the most it was resident with until then and while it planned [MB].
        work: what the search did.
    """

    cells: int
    seed: int
    budget_s: float
    first_walk_s: float
    target_s: tuple[tuple[float, float | None], ...]
    noted: tuple[tuple[float, float], ...]
    gap: float
    steps: int
    lower_bound_steps: int
    wall_s: float
    idle_mb: float
    peak_mb: float
    work: dict[str, int]

    @property
    def own_mb(self) -> float:
        """Memory above that of the idle process [MB]."""
        return self.peak_mb - self.idle_mb

    @classmethod
    def of(cls, document: dict[str, Any]) -> ScaleRun:
        """Return the run that ``asdict`` and JSON made ``document`` of."""
        pairs = {name: tuple(map(tuple, document[name])) for name in ("target_s", "noted")}
        return cls(**{**document, **pairs})


@dataclass(frozen=True, slots=True)
class SizedRun:
    """A run, and the number of cells that was asked for."""

    size: int
    run: ScaleRun


@dataclass(slots=True)
class GapWatch:
    """A stopping criterion that ends a search by the clock, and notes how its gap falls."""

    seconds: float
    began: float = field(default_factory=time.perf_counter)
    noted: list[tuple[float, float]] = field(default_factory=list)
    target_s: dict[float, float | None] = field(default_factory=lambda: dict.fromkeys(TARGETS))

    def __call__(self, progress: SearchProgress) -> bool:
        """Tell whether the time is up."""
        elapsed_s = time.perf_counter() - self.began
        if progress.gap is not None:
            self.note(elapsed_s, progress.gap)
        return elapsed_s >= self.seconds

    def note(self, elapsed_s: float, gap: float) -> None:
        """Note a gap, if it is news."""
        reached = [goal for goal, at in self.target_s.items() if at is None and gap <= goal]
        self.target_s.update(dict.fromkeys(reached, elapsed_s))
        if reached or not self.noted or gap < (1.0 - NOTED_FALL) * self.noted[-1][1]:
            self.noted.append((elapsed_s, gap))


def run(task: ScaleTask) -> ScaleRun:
    """Plan in this process.

    Raises:
        WrongWalkError: the walk is not legal, not complete, or not what is said of it.
    """
    warm_up()
    peak_before_mb = peak_mb(os.getpid())
    # Compiled code takes more while it is loaded than it leaves behind. Where the system
    # cannot forget that, it counts as the plan's.
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text(FORGET_PEAK, encoding="ascii")
    idle_mb = resident_mb()
    problem = _problem(read_grid(task.file))
    planner = planner_for(task.seed)
    watch = GapWatch(task.budget_s)
    path = planner.plan(problem, watch)
    wall_s = time.perf_counter() - watch.began
    # Before it is judged: that takes memory, too.
    planning_mb = peak_mb(os.getpid())
    judged(problem, path)
    assert path.gap is not None, "a building has a bound above zero"
    watch.note(wall_s, path.gap)
    return ScaleRun(
        cells=problem.cells,
        seed=task.seed,
        budget_s=task.budget_s,
        first_walk_s=path.first_walk_s,
        target_s=tuple(watch.target_s.items()),
        noted=tuple(watch.noted),
        gap=path.gap,
        steps=path.steps,
        lower_bound_steps=path.lower_bound_steps,
        wall_s=wall_s,
        idle_mb=idle_mb,
        peak_mb=max(peak_before_mb, planning_mb),
        work=asdict(path.work),
    )


def _problem(grid: NamedGrid) -> CoverageProblem:
    return CoverageProblem.of(grid.lattice, grid.start)


if __name__ == "__main__":
    json.dump(asdict(run(ScaleTask(**json.load(sys.stdin)))), sys.stdout)
