"""Rows of Table I, additional rows, and their measurement."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Self

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import NamedGrid, read_grid
from fasaco_edge.planners.own.loading import UserCode
from fasaco_edge.planners.own.problem import OwnPlanner
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath, WalkFigures, walk_figures
from fasaco_edge.planners.planner import Observer, ignore, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import planner_of
from tests.benchmarks.harness import check_names, grid_name


@dataclass(frozen=True, slots=True)
class Variant:
    """A planner as a row has it.

    Attributes:
        name: its name in figures.
        planner: its name in the registry.
        velocities: of its cohorts [cells/move]; () where there are no ants.
        q0, visibility: of the colony; the faithful rows have the defaults.
        closed: whether its walk ends where it began, as all the faithful ones do.
        own: the user's code in place of a planner of the registry.
    """

    name: str
    planner: str
    velocities: tuple[int, ...] = ()
    q0: float = 0.7
    visibility: str = "neighbour"
    closed: bool = True
    own: UserCode | None = None

    @classmethod
    def of(cls, own: UserCode) -> Self:
        """Return the row of a planner of the user's own."""
        return cls(own.name, own.name, own=own)

    def plan(
        self, problem: CoverageProblem, ants: int, seed: int, observe: Observer = ignore
    ) -> CoveragePath:
        """Return its walk; by one thread."""
        posed = replace(problem, end=problem.start if self.closed else None)
        if self.own is not None:
            return OwnPlanner(self.own, seed).plan(posed, never, observe)
        colony = ColonyConfig(
            ants=ants,
            velocities=self.velocities or (1,),
            q0=self.q0,
            seed=seed,
            visibility=self.visibility,
        )
        return planner_of(self.planner, colony).plan(posed, never, observe)


RISING = tuple(range(1, 9))
FALLING = RISING[::-1]

VARIANTS = {
    variant.name: variant
    for variant in (
        *(Variant(f"velocity-{velocity}", "fasaco", (velocity,)) for velocity in RISING),
        Variant("rising", "fasaco", RISING),
        Variant("falling", "fasaco", FALLING),
        Variant("aco-8-cohorts", "fasaco", (1,) * 8),
        Variant("spiral-stc", "spiral-stc"),
        Variant("zigzag", "zigzag"),
        Variant("stc", "stc"),
        Variant("falling-anywhere", "fasaco", FALLING, closed=False),
        Variant("falling-distance", "fasaco", FALLING, visibility="distance"),
        Variant("falling-open", "fasaco", FALLING, visibility="fewest-open"),
        Variant("falling-open-q98", "fasaco", FALLING, q0=0.98, visibility="fewest-open"),
        Variant("aco-8-cohorts-open-q98", "fasaco", (1,) * 8, q0=0.98, visibility="fewest-open"),
    )
}


@dataclass(frozen=True, slots=True)
class Run:
    """One planner's walk on one grid, start to start.

    Attributes:
        grid: name of the grid.
        cells: cells to cover.
        variant: name of the variant.
        seed: seed of its colony, if it has one.
        walk: the walk's figures.
        cpu_s: time of the one thread on a processor [s].
    """

    grid: str
    cells: int
    variant: str
    seed: int
    walk: WalkFigures
    cpu_s: float


def pose(grid: NamedGrid) -> CoverageProblem:
    """Return the problem of Table I on a grid: from its start back to its start."""
    return CoverageProblem.of(grid.lattice, grid.start, end=grid.start)


def measure(
    grids: Sequence[str], ants: int, seeds: int, say: Say, own: Sequence[UserCode] = ()
) -> Generator[Run, None, None]:
    """Yield every variant's run on each grid with each seed, kernels warm; then the user's own.

    Raises:
        FasacoError: a grid cannot be read or planned on, the colony is impossible, or a planner
            of the user's own fails.
    """
    check_names(grids)
    variants = (*VARIANTS.values(), *map(Variant.of, own))
    # Read first: a wrong name should not be found out after minutes.
    read = [read_grid(grid) for grid in grids]
    ColonyConfig(ants=ants)
    say("loading kernels")
    warm_up()
    for grid in read:
        problem = pose(grid)
        for variant in variants:
            variant.plan(problem, max(len(variant.velocities), 1), 0)
        for seed in range(seeds):
            say(f"{grid_name(grid.name)}: seed {seed}")
            for variant in variants:
                yield _timed(grid, problem, variant, ants, seed)


def _timed(
    grid: NamedGrid, problem: CoverageProblem, variant: Variant, ants: int, seed: int
) -> Run:
    before = time.thread_time()
    path = variant.plan(problem, ants, seed)
    cpu_s = time.thread_time() - before
    figures = walk_figures(grid.lattice, path.cells)
    return Run(grid_name(grid.name), problem.cells, variant.name, seed, figures, cpu_s)
