"""FaSACO: Algorithm 1 of Carr and Wang 2022, its colony, and the ants' threads.

Line 1: for each cohort, in the order of ``ColonyConfig.velocities``; lines 2 to 5: every ant walks
until all cells are visited (``kernels.ants.colony.walk_ants``); line 7: the best walk so far is
strengthened by equation (8); line 9: the cheapest walk is returned, which is the shortest if only
steps cost. A colony whose only velocity is 1 is plain ACO.

Deviations: delta phi of equation (8) is the cost of one step per cell over the cost of the walk.
For steps alone this is ``cells / steps``: proportional to 1 / length as in the paper, and about 1
at best on any map, so tau0 needs no tuning to the map's size. If a walk must end in a given cell,
ants go there by a shortest path once all cells are covered.

With a living trail (``planners.living_trail``) and a previous walk, the search continues instead of
restarting. The ants start from that trail, and their number is proportional to the share of new
cells among the cells to cover. The best walk so far is the previous walk, with invalid parts cut
out and new cells inserted.
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
from fasaco_edge.kernels.lattice.reach import walk_cost
from fasaco_edge.planners.cost import MICROSECONDS, SearchWork
from fasaco_edge.planners.living_trail import TrailSnapshot, legal, mean_into
from fasaco_edge.planners.paper.colony import VISIBILITIES, ColonyConfig
from fasaco_edge.planners.path import CoveragePath, Saved
from fasaco_edge.planners.planner import (
    ColonySnapshot,
    Observer,
    SearchProgress,
    StoppingCriterion,
    ignore,
    never,
)
from fasaco_edge.planners.problem import CoverageProblem, FramedGround, graph_of, scratch_for
from fasaco_edge.planners.walk_before import HELD_CELLS, completed

# Limit on the ants of a group, which walk at the same time. Larger groups keep more threads busy,
# smaller groups respond to ``stop`` sooner. A group covers CELLS_PER_GROUP, in about 10 ms.
LARGEST_GROUP = 32
SMALLEST_GROUP = 2
CELLS_PER_GROUP = 64_000

# Least number of ants, if hardly any cell is new.
FEWEST_ANTS = 64

# Initial memory for a walk; if a walk is longer, its group walks again with more memory.
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
        self.trail = _first_trail(config, problem)
        self.best = np.empty(0, np.int32)
        self.best_us = 0
        self._cells, self._cost = problem.cells, problem.cost
        self._state = ColonyState(graph, self.trail, _rules(config, problem))
        self._pool = pool
        self._scratches = [scratch_for(graph) for _ in range(threads)]
        shape = group_size(problem.cells), STEPS_PER_CELL * problem.cells + 2
        self._walks = np.empty(shape, np.int32)

    def walk(self, velocity: int, streams: NDArray[np.int64]) -> tuple[NDArray[np.int32], int]:
        """Let a group walk, and update the trail by equation (7).

        Args:
            velocity: number of cells an ant goes straight on.
            streams: the ants' random streams, int64 (ants, 4), at most one group.

        Returns:
            The group's cheapest walk, flat cells int32 (n,), and its cost [us].
        """
        ants = len(streams)
        lengths = np.empty(ants, np.int64)
        before = streams.copy()
        self._walk_on_threads(velocity, streams, lengths)
        while lengths.max() > self._walks.shape[1]:
            # A walk did not fit: the same ants walk again, with more memory.
            self._walks = np.empty((len(self._walks), 2 * int(lengths.max())), np.int32)
            streams[:] = before
            self._walk_on_threads(velocity, streams, lengths)
        ant, cost_us = settle(self._state, self._walks, lengths)
        walk = self._walks[ant, : lengths[ant]].copy()
        self.offer(walk, cost_us)
        return walk, cost_us

    def offer(self, walk: NDArray[np.int32], cost_us: int) -> None:
        """Take a walk, flat cells int32 (n,), as the best if it is the first or the cheapest."""
        if not self.best.size or cost_us < self.best_us:
            self.best, self.best_us = walk, cost_us

    def strengthen(self) -> None:
        """Strengthen the trail along the best walk by equation (8)."""
        deposit(self._state, self._cost.quality(self._cells, self.best_us), self.best)

    def progress(self, walked: int) -> SearchProgress:
        """Return the progress of the search after this many ants."""
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


def _first_trail(config: ColonyConfig, problem: CoverageProblem) -> NDArray[np.float64]:
    """Return the living trail, or a uniform one: pheromone by flat cell and direction, above 0."""
    if problem.trail is None:
        return np.full((problem.to_cover.size, 4), config.tau0)
    trail = problem.trail.on(problem.lattice.window).astype(np.float64).reshape(-1, 4)
    return np.where(trail > 0, trail, config.tau0)


class Group(NamedTuple):
    """Ants that walk at the same time.

    Attributes:
        cohort: index of their cohort.
        velocity: their velocity [cells/move].
        streams: a random stream for each ant, int64 (ants, 4), independent of all others.
        is_last: whether it is the last group of its cohort.
    """

    cohort: int
    velocity: int
    streams: NDArray[np.int64]
    is_last: bool


def group_size(cells: int) -> int:
    """Return the number of ants that walk at the same time, for this many cells."""
    return min(max(CELLS_PER_GROUP // cells, SMALLEST_GROUP), LARGEST_GROUP)


def groups_of(config: ColonyConfig, cells: int) -> Iterator[Group]:
    """Yield all ants of a colony, group by group."""
    size = group_size(cells)
    for number, cohort in enumerate(config.cohorts()):
        words = np.random.SeedSequence((config.seed, number)).generate_state(4 * cohort.ants)
        streams = words.astype(np.int64).reshape(-1, 4)
        for end in range(size, cohort.ants + size, size):
            yield Group(number, cohort.velocity, streams[end - size : end], end >= cohort.ants)


def ants_for(config: ColonyConfig, problem: CoverageProblem) -> int:
    """Return the number of ants; with a previous walk it is proportional to the new cells."""
    if problem.trail is None or problem.before is None or not problem.can_repair:
        return config.ants
    window = problem.lattice.window
    new = problem.to_cover.copy()
    at = problem.before - np.array((window.row0, window.col0))
    new[tuple(at[((at >= 0) & (at < new.shape)).all(axis=1)].T)] = False
    ants = -(-config.ants * int(np.count_nonzero(new)) // problem.cells)
    return min(config.ants, max(ants, FEWEST_ANTS, len(config.velocities)))


def _walk_before(problem: CoverageProblem) -> NDArray[np.int32] | None:
    """Return the previous walk, completed, flat cells int32 (n,); None for none."""
    if problem.trail is None or problem.before is None or not problem.can_repair:
        return None
    framed = FramedGround.of(problem)
    return framed.unframed(completed(problem, framed, problem.before, HELD_CELLS))


def _rules(config: ColonyConfig, problem: CoverageProblem) -> Rules:
    # ``powers`` is read at a move's length minus 1, or at a number of open neighbours, 0 to 3.
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
    """Return the observer's view after this many ants; ``trail`` is float64 (n, 4)."""
    lattice, ways = problem.lattice, _legal_trail(problem, trail)
    mean = mean_into(ways)
    return ColonySnapshot(lattice.window, lattice.cell_m, mean, cohort, velocity, ants, steps, ways)


def _legal_trail(problem: CoverageProblem, trail: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return a trail, float64 (n, 4), as float32 (rows, cols, 4); 0 where there is no step."""
    steps = legal(problem.lattice.steps)
    return (trail.reshape(steps.shape) * steps).astype(np.float32)


@dataclass(frozen=True, slots=True)
class Fasaco:
    """Fast-spanning ant colony optimisation, on ``threads`` threads."""

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    name: str = "fasaco"

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion = never, observe: Observer = ignore
    ) -> CoveragePath:
        """Return the cheapest walk of the colony; see ``CoveragePlanner.plan``."""
        began, first_walk_s, walked, first_us = time.perf_counter(), 0.0, 0, 0
        config = replace(self.config, ants=ants_for(self.config, problem))
        with ThreadPoolExecutor(self.threads) as pool:
            colony = Colony(config, problem, graph_of(problem), pool, self.threads)
            if (before := _walk_before(problem)) is not None:
                cost = problem.cost
                colony.offer(before, int(walk_cost(before, cost.step_us, cost.quarter_turn_us)))
                first_us = colony.best_us
            for cohort, velocity, streams, is_last in groups_of(config, problem.cells):
                colony.walk(velocity, streams)
                first_us = first_us or colony.best_us
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
            saved=Saved(ants=(first_us - colony.best_us) / MICROSECONDS),
            trail=TrailSnapshot(problem.lattice.window, _legal_trail(problem, colony.trail)),
        )


def plain_aco(config: ColonyConfig, threads: int) -> Fasaco:
    """Return plain ant colony optimisation: FaSACO with one cohort of velocity 1."""
    return Fasaco(replace(config, velocities=(1,)), threads, name="aco")
