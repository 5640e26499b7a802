"""FaSACO: Algorithm 1 of Carr and Wang 2022.

Line 1: for each cohort, in the order of ``ColonyConfig.velocities``; lines 2 to
5: every ant walks until all cells are visited (``kernels.colony.walk_ants``);
line 7: the best walk so far is strengthened by equation (8); line 9: the
shortest walk is returned. A colony whose only velocity is 1 is plain ACO.

Deviations: delta phi of equation (8) is ``cells / steps``, proportional to 1
over the length as the paper has it and about 1 at best on any map, so that tau0
needs no tuning to the map's size.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.colony import Rules, deposit, settle, walk_ants
from fasaco_edge.kernels.search import Graph
from fasaco_edge.planners.colony import VISIBILITIES, ColonyConfig
from fasaco_edge.planners.graph import cells_of, flat_start, graph_of, scratch_for
from fasaco_edge.planners.observation import ColonySnapshot, Observer
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, ignore, never
from fasaco_edge.planners.problem import CoverageProblem

# Ants of a group walk at the same time. Larger groups keep more threads busy,
# smaller ones leave the search sooner when it is told to stop: a group covers
# about this many cells, some ten milliseconds.
LARGEST_GROUP = 32
SMALLEST_GROUP = 2
CELLS_PER_GROUP = 64_000

# Room for a walk to begin with; one that needs more is walked again with more.
STEPS_PER_CELL = 2


@dataclass(frozen=True, slots=True)
class Fasaco:
    """Fast-spanning ant colony optimisation, on ``threads`` threads."""

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    name: str = "fasaco"

    def plan(
        self,
        problem: CoverageProblem,
        stop: StoppingCriterion = never,
        observe: Observer = ignore,
    ) -> CoveragePath:
        """Return the shortest walk the colony found; see ``CoveragePlanner.plan``."""
        config = self.config
        graph = graph_of(problem)
        with ThreadPoolExecutor(self.threads) as pool:
            colony = _Colony(config, problem, graph, pool, self.threads)
            walked = 0
            for number, cohort in enumerate(config.cohorts()):
                streams = _streams(config.seed, number, cohort.ants)
                for first in range(0, cohort.ants, colony.group):
                    ants = streams[first : first + colony.group]
                    colony.walk(cohort.velocity, ants)
                    walked += len(ants)
                    if stop(walked):
                        return self._path(problem, colony.best, walked)
                steps = colony.best.size - 1
                deposit(
                    graph, colony.trail, config.alpha, problem.cells / max(steps, 1), colony.best
                )
                if observe is not ignore:
                    observe(
                        _snapshot(problem, colony.trail, number, cohort.velocity, walked, steps)
                    )
            return self._path(problem, colony.best, walked)

    def _path(self, problem: CoverageProblem, walk: NDArray[np.int32], ants: int) -> CoveragePath:
        cells = cells_of(problem, walk)
        return CoveragePath(cells, planner=self.name, seed=self.config.seed, ants=ants)


class _Colony:
    """The trail and the best walk so far, and the room that ants walk in."""

    def __init__(
        self,
        config: ColonyConfig,
        problem: CoverageProblem,
        graph: Graph,
        pool: ThreadPoolExecutor,
        threads: int,
    ) -> None:
        self.group = min(max(CELLS_PER_GROUP // problem.cells, SMALLEST_GROUP), LARGEST_GROUP)
        self.trail = np.full((graph.steps.size, 4), config.tau0)
        self.best = np.empty(0, np.int32)
        self._graph = graph
        self._rules = _rules(config, problem.return_home)
        self._start = flat_start(problem)
        self._pool = pool
        self._scratches = [scratch_for(graph) for _ in range(threads)]
        self._walks = np.empty((self.group, STEPS_PER_CELL * problem.cells + 2), np.int32)

    def walk(self, velocity: int, streams: NDArray[np.int64]) -> None:
        """Let a group walk, settle its trail by equation (7), keep the best walk."""
        ants = len(streams)
        lengths = np.empty(ants, np.int64)
        before = streams.copy()
        self._walk_on_threads(velocity, streams, lengths)
        while lengths.max() > self._walks.shape[1]:
            # Too little room for a walk: the same ants again, with more.
            self._walks = np.empty((self.group, 2 * int(lengths.max())), np.int32)
            streams[:] = before
            self._walk_on_threads(velocity, streams, lengths)
        shortest = settle(self._graph, self.trail, self._rules, self._walks, lengths)
        if not self.best.size or lengths[shortest] < self.best.size:
            self.best = self._walks[shortest, : lengths[shortest]].copy()

    def _walk_on_threads(
        self, velocity: int, streams: NDArray[np.int64], lengths: NDArray[np.int64]
    ) -> None:
        def share(thread: int) -> None:
            mine = slice(*(len(streams) * edge // threads for edge in (thread, thread + 1)))
            walk_ants(
                self._graph,
                self.trail,
                self._rules,
                self._scratches[thread],
                self._start,
                velocity,
                streams[mine],
                self._walks[mine],
                lengths[mine],
            )

        threads = len(self._scratches)
        others = [self._pool.submit(share, thread) for thread in range(1, threads)]
        share(0)
        for other in others:
            other.result()


def _rules(config: ColonyConfig, return_home: bool) -> Rules:
    # An ant goes as far as it is fast; a cell has three open neighbours at most.
    reach = max(*config.velocities, 4)
    powers = np.array([(1.0 / (index + 1)) ** config.beta for index in range(reach)])
    visibility = VISIBILITIES.index(config.visibility)
    return Rules(config.q0, config.alpha, config.tau0, return_home, visibility, powers)


def _streams(seed: int, cohort: int, ants: int) -> NDArray[np.int64]:
    """Return a random stream for each ant, int64 (ants, 4), independent of all others."""
    words = np.random.SeedSequence((seed, cohort)).generate_state(4 * ants)
    return words.astype(np.int64).reshape(ants, 4)


def _snapshot(
    problem: CoverageProblem,
    trail: NDArray[np.float64],
    cohort: int,
    velocity: int,
    ants: int,
    steps: int,
) -> ColonySnapshot:
    lattice = problem.lattice
    rows, cols = lattice.steps.shape
    into = np.zeros((rows, cols))
    legal = (lattice.steps[..., None] >> np.arange(4, dtype=np.uint8)) & 1
    trail = trail.reshape(rows, cols, 4) * legal
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
