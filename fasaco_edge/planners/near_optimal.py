"""FaSACO with local search: a complete walk at once, then better ones until it is stopped.

1. One or more simple walks, the cheapest kept: the first complete walk, within milliseconds
   (``baselines.first_walks``).
2. Local search improves it, region by region where the ground is large.
3. Perturbations, each followed by local search, go on from there.
4. Where perturbations gain nothing any more, the next ants of the colony walk; the
   walk of the best of them goes through 2 and 3, and the trail is strengthened along
   the best walk of all, by equation (8): ants begin where the search has been good.

The search ends when it is stopped, when the walk meets its lower bound, when all ants
have walked, or on a large ground, where no ants restart it, when perturbations gain
nothing any more. Its work is counted; the same counts give the same walk.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from fasaco_edge.planners.baselines import first_walks
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.cost import MICROSECONDS
from fasaco_edge.planners.effort import effort_for
from fasaco_edge.planners.fasaco import Colony, Group, groups_of, snapshot_of
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import (
    Observer,
    SearchProgress,
    SearchWork,
    StoppingCriterion,
    ignore,
    never,
)
from fasaco_edge.planners.problem import (
    CoverageProblem,
    FramedGround,
    graph_of,
    lower_bound_steps,
)
from fasaco_edge.planners.regions import EDGE, WalkRegion, is_one_region, regions_of, stream_of
from fasaco_edge.planners.repair import can_repair, repaired

# Proposals between two pauses: about a millisecond.
PROPOSALS_AT_ONCE = 30_000

# Perturbations of a region in a pass, where there are several regions.
PERTURBATIONS_IN_PASS = 8

# Where there are several regions the search ends after so many passes without gain.
GAINLESS_PASSES = 10

# Perturbations between two looks at the whole walk, where it is one region.
PERTURBATIONS_IN_VISIT = 64

# Visits of a walk that local search has memory for.
VISITS_PER_CELL = 4

# Distinguishes the random stream from those of the ants.
LOCAL_SEARCH = 1 << 32

# How often the walk may cross the rim of a region.
JUMPS = 8 * EDGE


# What a search restarts from where perturbations gain nothing any more: the colony's next
# ants; the same on a trail that nothing strengthens; or never.
ANTS, FLAT, NEVER = RESTARTS = ("ants", "flat", "never")

# A repaired walk with more steps than this above its bound is not worth keeping, unless
# a search finds no better one.
POOR_GAP = 0.25


def is_poor(path: CoveragePath) -> bool:
    """Return whether a repaired walk is so long that a new one is to be looked for."""
    return path.gap is not None and path.gap > POOR_GAP


@dataclass(frozen=True, slots=True)
class NearOptimal:
    """The colony with local search; ants walk on ``threads`` threads.

    Attributes:
        restarts: one of ``RESTARTS``; other values than the default are there to
            measure what ants and their trail are worth.
    """

    config: ColonyConfig = field(default_factory=ColonyConfig)
    threads: int = 1
    restarts: str = ANTS
    name: str = "fasaco"

    def plan(
        self,
        problem: CoverageProblem,
        stop: StoppingCriterion = never,
        observe: Observer = ignore,
    ) -> CoveragePath:
        """Return the cheapest walk found; see ``CoveragePlanner.plan``.

        A walk that was still to be driven (``problem.before``) is repaired; only where
        that leaves it far above its bound the colony searches anew.
        """
        path = None
        if can_repair(problem):
            path = repaired(problem, self.name, self.config.seed, stop)
            if problem.only_better or not is_poor(path):
                return path
        found = self._search(problem, stop, observe)
        return found if path is None or found.cost_s < path.cost_s else path

    def _search(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        with ThreadPoolExecutor(self.threads) as pool:
            search = Search(self, problem, pool, observe)
            for _ in search.run():
                if stop(search.progress()):
                    break
            path = search.path()
            if observe is not ignore:
                search.show()
            return path


class Search:
    """A running search: a generator of pauses, at which it may be abandoned."""

    def __init__(
        self,
        planner: NearOptimal,
        problem: CoverageProblem,
        pool: ThreadPoolExecutor,
        observe: Observer,
    ) -> None:
        self._began = time.perf_counter()
        self._planner, self._problem, self._pool, self._observe = planner, problem, pool, observe
        self._graph = graph_of(problem)
        self._framed = FramedGround.of(problem)
        self._prices = self._framed.prices
        self._effort = effort_for(problem.cost)
        self._is_whole = is_one_region(self._framed.rows, self._framed.cols, problem.cells)
        self._random = stream_of(planner.config.seed, LOCAL_SEARCH)
        self._ants = 0
        self._first_walk_s = 0.0
        self._bound = 0
        # The walk under way and the best of those before it, in framed cells.
        self._walk, self._walk_us = np.empty(0, np.int32), 0
        self._best, self._best_us = self._walk, 0
        self._since_gain = self._perturbed_in_pass = 0
        self._passes = 0
        self._groups = groups_of(planner.config, problem.cells)
        self._colony: Colony | None = None
        self._cohort, self._velocity = 0, planner.config.velocities[0]
        self._region = WalkRegion(0, 0, 0, 0)

    def run(self) -> Iterator[None]:
        """Search until nothing is left to do; pause after each piece of work."""
        yield from self._begin()
        if not self._is_proven():
            yield from self._improve()
        may_restart = self._is_whole and self._planner.restarts != NEVER
        while not self._is_proven():
            before = self._work
            yield from self._perturb()
            # The walk is too long for its memory, or in no region: nothing could be perturbed.
            stuck = self._work == before
            if not self._is_whole and self._since_gain >= GAINLESS_PASSES * self._perturbed_in_pass:
                return
            if stuck or (self._since_gain >= self._effort.patience and may_restart):
                group = next(self._groups, None) if may_restart else None
                if group is None:
                    return
                yield from self._restart(group)

    def progress(self) -> SearchProgress:
        """Return how far the search is.

        What a region has gained counts before it is put back; but not where turns cost, as
        the turns at its rim are known only then.
        """
        best_us, steps = self._best_us, self._best.size - 1
        exact = self._is_whole or not self._prices.quarter_turn_us
        if self._region.is_loaded and exact:
            here_us = self._walk_us + self._region.gain_us
            if here_us < best_us:
                best_us, steps = here_us, self._walk.size - 1 + self._region.longer_by
        return SearchProgress(self._work, best_us / MICROSECONDS, steps, self._bound)

    def path(self) -> CoveragePath:
        """Return the best walk."""
        self._unload()
        # A search that was stopped at once has no bound yet.
        self._bound = self._bound or lower_bound_steps(self._problem)
        return CoveragePath(
            self._problem.cells_of(self._framed.unframed(self._best)),
            planner=self._planner.name,
            seed=self._planner.config.seed,
            work=self._work,
            cost_s=self._best_us / MICROSECONDS,
            lower_bound_steps=self._bound,
            first_walk_s=self._first_walk_s,
        )

    @property
    def _work(self) -> SearchWork:
        return self._region.work + SearchWork(ants=self._ants)

    def _is_proven(self) -> bool:
        """Return whether no walk can be better: it has no step and no turn too many."""
        if self._best_us == self._bound * self._prices.step_us:
            return True
        return not self._prices.quarter_turn_us and self.progress().steps == self._bound

    def _new_region(self) -> WalkRegion:
        framed, cells = self._framed, self._problem.cells
        if self._is_whole:
            # Few cells may lie far apart: then most of the walk is between them.
            visits = max(VISITS_PER_CELL * cells, 2 * self._walk.size)
            return WalkRegion(framed.rows, framed.cols, visits, 1)
        return WalkRegion(EDGE, EDGE, VISITS_PER_CELL * EDGE * EDGE, JUMPS)

    def _begin(self) -> Iterator[None]:
        for walk in first_walks(self._problem, self._graph):
            cost_us = self._problem.cost_us(walk)
            self._ants += 1
            if not self._first_walk_s:
                self._first_walk_s = time.perf_counter() - self._began
            if not self._walk.size or cost_us < self._walk_us:
                self._walk, self._walk_us = self._framed.framed(walk), cost_us
                self._best, self._best_us = self._walk, self._walk_us
            yield
        self._region = self._new_region()
        self._bound = lower_bound_steps(self._problem)

    def _regions(self) -> Iterator[None]:
        """Load each region of the next pass in turn."""
        for box in regions_of(self._framed, self._problem.cells, self._passes):
            if self._region.load(self._framed, self._walk, box):
                yield
                self._unload()
        self._passes += 1

    def _unload(self) -> None:
        """Put the region's best walk back, if that is a gain or costs nothing."""
        if not self._region.is_loaded:
            return
        walk = self._region.put_back()
        cost_us = self._problem.cost_us(walk)
        if cost_us < self._walk_us:
            self._since_gain = 0
        if cost_us <= self._walk_us:
            self._walk, self._walk_us = walk, cost_us
        if cost_us < self._best_us:
            self._best, self._best_us = walk, cost_us

    def _improve(self) -> Iterator[None]:
        """Improve the whole walk, without perturbations; twice where there are several regions."""
        effort = self._effort
        for _ in range(1 if self._is_whole else 2):
            for _ in self._regions():
                at_each = effort.proposals * self._region.best_length // len(effort.temperatures_us)
                for temperature_us in effort.temperatures_us:
                    for proposals in _pieces(at_each, PROPOSALS_AT_ONCE):
                        self._region.improve(temperature_us, proposals, self._random)
                        yield
                        if self._is_proven():
                            return
                self._region.go_back()

    def _perturb(self) -> Iterator[None]:
        """Perturb the walk in every region."""
        rules = self._effort.rules
        times = PERTURBATIONS_IN_VISIT if self._is_whole else PERTURBATIONS_IN_PASS
        self._perturbed_in_pass = 0
        for _ in self._regions():
            proposals = rules.proposals * self._region.best_length
            if rules.radius >= 0:
                proposals = min(proposals, PROPOSALS_AT_ONCE // 4)
            for piece in _pieces(times, max(PROPOSALS_AT_ONCE // proposals, 1)):
                self._region.perturb(rules, piece, self._random)
                self._since_gain += piece
                self._perturbed_in_pass += piece
                yield
                if self._is_proven():
                    return

    def _restart(self, group: Group) -> Iterator[None]:
        """Let the next ants walk, on a trail strengthened along the best walk; improve theirs."""
        colony = self._colony_of_ants()
        if self._planner.restarts == ANTS:
            self._strengthen(colony)
        walk, self._walk_us = colony.walk(group.velocity, group.streams)
        self._walk = self._framed.framed(walk)
        self._ants += len(group.streams)
        self._since_gain = 0
        self._cohort, self._velocity = group.cohort, group.velocity
        yield
        yield from self._improve()

    def show(self) -> None:
        """Offer the trail to the observer, strengthened along the best walk; the search is over."""
        colony = self._colony_of_ants()
        self._strengthen(colony)
        steps = self._best.size - 1
        cohort, velocity = self._cohort, self._velocity
        self._observe(snapshot_of(self._problem, colony.trail, cohort, velocity, self._ants, steps))

    def _colony_of_ants(self) -> Colony:
        if self._colony is None:
            self._colony = Colony(
                self._planner.config, self._problem, self._graph, self._pool, self._planner.threads
            )
        return self._colony

    def _strengthen(self, colony: Colony) -> None:
        colony.offer(self._framed.unframed(self._best), self._best_us)
        colony.strengthen()


def _pieces(total: int, largest: int) -> Iterator[int]:
    """Yield whole numbers up to ``largest`` that add up to ``total``."""
    for begun in range(0, total, largest):
        yield min(largest, total - begun)
