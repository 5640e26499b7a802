"""FaSACO: Algorithm 1 of Carr and Wang 2022.

Line 1: for each cohort, in the order of ``ColonyConfig.velocities``; lines 2 to
5: every ant walks until all cells are visited (``kernels.colony.walk_ants``);
line 7: the best walk so far is strengthened by equation (8); line 9: the
shortest walk is returned. A colony whose only velocity is 1 is plain ACO.

Deviations: delta phi of equation (8) is ``cells / steps``, proportional to 1
over the length as the paper has it and in (0, 1] on any map, so that tau0 needs
no tuning to the map's size.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.colony import Field, Rules, Scratch, deposit, walk_ants
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.observation import ColonySnapshot, Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem

# Between two looks at the stopping criterion ants cover about this many cells:
# some ten milliseconds.
CELLS_PER_BATCH = 20_000


@dataclass(frozen=True, slots=True)
class Fasaco:
    """Fast-spanning ant colony optimisation."""

    config: ColonyConfig = field(default_factory=ColonyConfig)

    def plan(
        self,
        problem: CoverageProblem,
        stop: StoppingCriterion = never,
        observe: Observer = ignore,
    ) -> CoveragePath:
        """Return the shortest walk the colony found; see ``CoveragePlanner.plan``."""
        config = self.config
        ground = _field(problem, config.tau0)
        rules = Rules(config.q0, config.alpha, config.tau0, problem.return_home)
        scratch = _scratch(ground.steps.size)
        cols = problem.lattice.window.cols
        row, col = problem.lattice.local(problem.start)
        best = np.empty(0, np.int64)
        walked = 0
        batch = max(1, CELLS_PER_BATCH // problem.cells)
        for number, cohort in enumerate(config.cohorts()):
            streams = _streams(config.seed, number, cohort.ants)
            for first in range(0, cohort.ants, batch):
                ants = streams[first : first + batch]
                best = walk_ants(
                    ground, rules, scratch, row * cols + col, cohort.velocity, ants, best
                )
                walked += len(ants)
                if stop(walked):
                    return self._path(problem, best, walked)
            steps = best.size - 1
            deposit(ground, config.alpha, problem.cells / max(steps, 1), best)
            observe(_snapshot(problem, ground, number, cohort.velocity, walked, steps))
        return self._path(problem, best, walked)

    def _path(self, problem: CoverageProblem, walk: NDArray[np.int64], ants: int) -> CoveragePath:
        window = problem.lattice.window
        rows, cols = np.divmod(walk, window.cols)
        cells = np.column_stack((rows + window.row0, cols + window.col0)).astype(np.int32)
        return CoveragePath(cells, planner="fasaco", seed=self.config.seed, ants=ants)


def _field(problem: CoverageProblem, tau0: float) -> Field:
    steps = problem.lattice.steps
    cols = steps.shape[1]
    return Field(
        steps=steps.ravel(),
        to_cover=problem.to_cover.astype(np.uint8).ravel(),
        offsets=np.array([1, cols, -1, -cols], np.int64),
        trail=np.full((steps.size, 4), tau0),
    )


def _scratch(size: int) -> Scratch:
    return Scratch(
        open=np.empty(size, np.uint8),
        seen=np.zeros(size, np.int64),
        came_from=np.zeros(size, np.int8),
        queue=np.empty(size, np.int64),
        searches=np.zeros(1, np.int64),
    )


def _streams(seed: int, cohort: int, ants: int) -> NDArray[np.int64]:
    """Return a random stream for each ant, int64 (ants, 4), independent of all others."""
    words = np.random.SeedSequence((seed, cohort)).generate_state(4 * ants)
    return words.astype(np.int64).reshape(ants, 4)


def _snapshot(
    problem: CoverageProblem, field: Field, cohort: int, velocity: int, ants: int, steps: int
) -> ColonySnapshot:
    lattice = problem.lattice
    rows, cols = lattice.steps.shape
    into = np.zeros((rows, cols))
    trail = field.trail.reshape(rows, cols, 4)
    legal = (lattice.steps[..., None] >> np.arange(4, dtype=np.uint8)) & 1
    trail = trail * legal
    into[:, 1:] += trail[:, :-1, 0]
    into[1:] += trail[:-1, :, 1]
    into[:, :-1] += trail[:, 1:, 2]
    into[:-1] += trail[1:, :, 3]
    # A step is legal both ways or not at all, so moves in are as many as moves out.
    moves = legal.sum(axis=2)
    mean = np.divide(into, moves, out=np.zeros_like(into), where=moves > 0)
    return ColonySnapshot(
        lattice.window, lattice.cell_m, mean.astype(np.float32), cohort, velocity, ants, steps
    )
