"""FaSACO: Algorithm 1 of Carr and Wang 2022, its colony, and the threads that ants walk on.

Line 1: for each cohort, in the order of ``ColonyConfig.velocities``; lines 2 to
5: every ant walks until all cells are visited (``kernels.ants.colony.walk_ants``);
line 7: the best walk so far is strengthened by equation (8); line 9: the
cheapest walk is returned, which is the shortest where only steps cost. A colony
whose only velocity is 1 is plain ACO.

Deviations: delta phi of equation (8) is what the cells would cost at a step each
over what the walk costs. For steps alone that is ``cells / steps``, proportional
to 1 over the length as the paper has it and about 1 at best on any map, so that
tau0 needs no tuning to the map's size. A walk may have to end in a given cell:
ants go there by a shortest way when all is covered.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.colony import ColonyState, Rules, deposit, settle, walk_ants
from fasaco_edge.kernels.ants.graph import Graph
from fasaco_edge.planners.colony import VISIBILITIES, ColonyConfig
from fasaco_edge.planners.cost import MICROSECONDS
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import (
    ColonySnapshot,
    Observer,
    SearchProgress,
    SearchWork,
    StoppingCriterion,
    ignore,
    never,
)
from fasaco_edge.planners.problem import CoverageProblem, graph_of, scratch_for

# Ants of a group walk at the same time. Larger groups keep more threads busy,
# smaller ones end the search sooner when it is to stop: a group covers
# about this many cells, some ten milliseconds.
LARGEST_GROUP = 32
SMALLEST_GROUP = 2
CELLS_PER_GROUP = 64_000

# Initial capacity for a walk; one that needs more is walked again with more.
STEPS_PER_CELL = 2


class Colony:
    """The pheromone trail, the best walk so far, and memory for the ants' walks."""

    def __init__(
        self,
        config: ColonyConfig,
        problem: CoverageProblem,
        graph: Graph,
        pool: ThreadPoolExecutor,
        threads: int,
    ) -> None:
        self.trail = np.full((graph.steps.size, 4), config.tau0)
        self.best = np.empty(0, np.int32)
        self.best_us = 0
        self._cells = problem.cells
        self._state = ColonyState(graph, self.trail, _rules(config, problem))
        self._pool = pool
        self._scratches = [scratch_for(graph) for _ in range(threads)]
        shape = group_size(problem.cells), STEPS_PER_CELL * problem.cells + 2
        self._walks = np.empty(shape, np.int32)

    def walk(self, velocity: int, streams: NDArray[np.int64]) -> tuple[NDArray[np.int32], int]:
        """Let a group walk and update the trail by equation (7).

        Args:
            velocity: cells an ant keeps straight on for.
            streams: the ants' random streams, int64 (ants, 4), of a group at most.

        Returns:
            The group's cheapest walk, flat cells int32 (n,), and its cost [us].
        """
        ants = len(streams)
        lengths = np.empty(ants, np.int64)
        before = streams.copy()
        self._walk_on_threads(velocity, streams, lengths)
        while lengths.max() > self._walks.shape[1]:
            # A walk did not fit: the same ants again, with more memory.
            self._walks = np.empty((len(self._walks), 2 * int(lengths.max())), np.int32)
            streams[:] = before
            self._walk_on_threads(velocity, streams, lengths)
        ant, cost_us = settle(self._state, self._walks, lengths)
        walk = self._walks[ant, : lengths[ant]].copy()
        self.offer(walk, cost_us)
        return walk, cost_us

    def offer(self, walk: NDArray[np.int32], cost_us: int) -> None:
        """Let a walk, flat cells int32 (n,), be the best if it is cheaper, or the first."""
        if not self.best.size or cost_us < self.best_us:
            self.best, self.best_us = walk, cost_us

    def strengthen(self) -> None:
        """Strengthen the trail along the best walk by equation (8)."""
        # Whole numbers divided once: for steps alone it is cells / steps to the last bit.
        step_us = self._state.rules.step_us
        amount = self._cells * step_us / max(self.best_us, step_us)
        deposit(self._state, amount, self.best)

    def progress(self, walked: int) -> SearchProgress:
        """Return how far the search is after so many ants."""
        return SearchProgress(
            SearchWork(ants=walked), self.best_us / MICROSECONDS, self.best.size - 1
        )

    def _walk_on_threads(
        self, velocity: int, streams: NDArray[np.int64], lengths: NDArray[np.int64]
    ) -> None:
        def share(thread: int) -> None:
            mine = slice(*(len(streams) * edge // threads for edge in (thread, thread + 1)))
            walk_ants(
                self._state,
                self._scratches[thread],
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


class Group(NamedTuple):
    """Ants that walk at the same time.

    Attributes:
        cohort: number of their cohort.
        velocity: of theirs [cells/move].
        streams: a random stream for each, int64 (ants, 4), independent of all others.
        is_last: whether it is the last group of the cohort.
    """

    cohort: int
    velocity: int
    streams: NDArray[np.int64]
    is_last: bool


def group_size(cells: int) -> int:
    """Return how many ants walk at the same time over so many cells."""
    return min(max(CELLS_PER_GROUP // cells, SMALLEST_GROUP), LARGEST_GROUP)


def groups_of(config: ColonyConfig, cells: int) -> Iterator[Group]:
    """Yield all ants of a colony over so many cells, group by group."""
    size = group_size(cells)
    for number, cohort in enumerate(config.cohorts()):
        words = np.random.SeedSequence((config.seed, number)).generate_state(4 * cohort.ants)
        streams = words.astype(np.int64).reshape(-1, 4)
        for end in range(size, cohort.ants + size, size):
            yield Group(number, cohort.velocity, streams[end - size : end], end >= cohort.ants)


def _rules(config: ColonyConfig, problem: CoverageProblem) -> Rules:
    # An ant goes as far as it is fast; a cell has three open neighbours at most.
    reach = max(*config.velocities, 4)
    powers = np.array([(1.0 / (index + 1)) ** config.beta for index in range(reach)])
    cost = problem.cost
    return Rules(
        q0=config.q0,
        alpha=config.alpha,
        tau0=config.tau0,
        start=problem.flat_start,
        end=problem.flat_end,
        step_us=cost.step_us,
        quarter_turn_us=cost.quarter_turn_us,
        visibility=VISIBILITIES.index(config.visibility),
        powers=powers,
    )


def snapshot_of(
    problem: CoverageProblem,
    trail: NDArray[np.float64],
    cohort: int,
    velocity: int,
    ants: int,
    steps: int,
) -> ColonySnapshot:
    """Return what an observer sees after so many ants; ``trail`` is float64 (n, 4)."""
    lattice = problem.lattice
    rows, cols = lattice.steps.shape
    trail = trail.reshape(rows, cols, 4)
    into, moves = np.zeros((rows, cols)), np.zeros((rows, cols), np.uint8)
    # From where a move leads, and to where: one array at a time is several times as fast as all
    # four directions at once.
    ahead, behind = np.s_[1:], np.s_[:-1]
    for direction, here, there in (
        (0, np.s_[:, behind], np.s_[:, ahead]),
        (1, np.s_[behind], np.s_[ahead]),
        (2, np.s_[:, ahead], np.s_[:, behind]),
        (3, np.s_[ahead], np.s_[behind]),
    ):
        legal = (lattice.steps >> np.uint8(direction)) & np.uint8(1)
        into[there] += trail[..., direction][here] * legal[here]
        # A step is legal both ways or not at all, so moves in are as many as moves out.
        moves += legal
    mean = np.divide(into, moves, out=into, where=moves > 0).astype(np.float32)
    return ColonySnapshot(lattice.window, lattice.cell_m, mean, cohort, velocity, ants, steps)


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
        """Return the cheapest walk the colony found; see ``CoveragePlanner.plan``."""
        began, first_walk_s, walked = time.perf_counter(), 0.0, 0
        with ThreadPoolExecutor(self.threads) as pool:
            colony = Colony(self.config, problem, graph_of(problem), pool, self.threads)
            for cohort, velocity, streams, is_last in groups_of(self.config, problem.cells):
                colony.walk(velocity, streams)
                first_walk_s = first_walk_s or time.perf_counter() - began
                walked += len(streams)
                if stop(colony.progress(walked)):
                    break
                if is_last:
                    colony.strengthen()
                    if observe is not ignore:
                        trail, steps = colony.trail, colony.best.size - 1
                        observe(snapshot_of(problem, trail, cohort, velocity, walked, steps))
        progress = colony.progress(walked)
        return CoveragePath(
            problem.cells_of(colony.best),
            planner=self.name,
            seed=self.config.seed,
            work=progress.work,
            cost_s=progress.cost_s,
            first_walk_s=first_walk_s,
        )


def plain_aco(config: ColonyConfig, threads: int) -> Fasaco:
    """Return plain ant colony optimisation: FaSACO with one cohort of velocity 1."""
    return Fasaco(replace(config, velocities=(1,)), threads, name="aco")
