"""Fleet search: walks of similar cost for several robots that share a connected ground.

Each robot gets a tour (``first_tours``), and all are improved together by simulated annealing
(``annealing``). After some short attempts the best one is annealed for longer; where turns have a
price, pairs of robots share theirs anew instead (``pairs``). Then everything begins
anew. The objective is the makespan: the cost of the longest walk.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.planning.annealing import DOUBLED, FleetWalks
from fasaco_edge.fleet.planning.bound import longest_bound
from fasaco_edge.fleet.planning.first_tours import FirstTours, Fleet
from fasaco_edge.fleet.planning.pairs import Pairs
from fasaco_edge.fleet.planning.parts import can_part
from fasaco_edge.fleet.planning.tours import Tour, TourGround
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import MICROSECONDS, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import AnyOf, SearchProgress, StoppingCriterion, WorkLimit
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.search.walk_region import stream_of

# Perturbations of a walk with a free end.
OPEN = SearchWork(perturbations=200)
# Rounds of pairs without a gain after which everything begins anew, where turns have a price.
GAINLESS_ROUNDS = 40


class _Best(NamedTuple):
    """The best division so far: tours, and the greatest cost [us]."""

    tours: list[Tour]
    worst_us: int


class Sharing:
    """A running division of one connected area of a lattice, a generator of pauses."""

    def __init__(self, lattice: CoverageLattice, fleet: Fleet, reached: NDArray[np.bool_]) -> None:
        self._lattice, self._fleet, self._reached = lattice, fleet, reached
        self._ground = TourGround(lattice, fleet.cost, fleet.starts)
        self._best = _Best([], 0)
        self.cells = int(np.count_nonzero(reached))
        self.rounds = 0
        self.lower_bound_steps = longest_bound(
            lattice, fleet.starts, reached, self._ground.distances, returns=fleet.returns
        )

    def progress(self) -> SearchProgress:
        """Return progress: figures of the longest walk of the best division so far."""
        steps = max(map(len, self._best.tours), default=0)
        work = SearchWork(perturbations=self.rounds)
        return SearchProgress(work, self._best.worst_us / MICROSECONDS, steps)

    def run(self, stop: StoppingCriterion) -> Iterator[None]:
        """Divide and improve repeatedly; pause after each piece of work."""
        first = FirstTours(self._lattice, self._fleet, self._reached, self._ground, stop)
        least_us = self.lower_bound_steps * self._fleet.cost.step_us
        with ThreadPoolExecutor(self._fleet.threads) as pool:
            for generation in itertools.count():
                for tours in self._found(first, generation, pool):
                    self._take(tours)
                    yield
                    if len(tours) == 1 or self._best.worst_us <= least_us:
                        return

    def _found(
        self, first: FirstTours, generation: int, pool: ThreadPoolExecutor
    ) -> Iterator[list[Tour]]:
        """Find tours of all robots and improve them together; yield them after each piece."""
        cost, seed, robots = self._fleet.cost, self._fleet.seed, len(self._fleet.starts)
        if not can_part(robots, self.cells):
            tours = first.find(generation, pool)
            yield tours
        else:
            walks = FleetWalks(self._lattice, self._reached, self._ground.starts, cost)
            plan = walks.schedule
            proposals = min(plan.per_cell * self.cells, plan.most) << generation // DOUBLED
            attempts = []
            for attempt in walks.attempts(generation):
                tours = first.find(attempt, pool)
                yield tours
                walks.load(tours)
                for _ in walks.improve(proposals, plan.hot, stream_of(seed, attempt)):
                    self.rounds += 1
                    yield walks.tours()
                attempts.append((walks.score, attempt, walks.tours()))
            (_, attempt, tours) = min(attempts, key=lambda found: found[:2])
            if plan.again:
                walks.load(tours)
                stream = stream_of(seed, attempt, 1)
                for _ in walks.improve(plan.again * proposals, plan.again_hot, stream):
                    self.rounds += 1
                    yield walks.tours()
        pairs = Pairs(self._fleet, self._ground, tours, self.rounds)
        while pairs.gainless < GAINLESS_ROUNDS and cost.quarter_turn_us and robots > 1:
            pairs.balance(pool)
            self.rounds += 1
            yield pairs.tours

    def _take(self, tours: list[Tour]) -> None:
        """Keep tours if they are the best so far."""
        worst_us = max(map(self._ground.cost_us, tours))
        if not self._best.tours or worst_us < self._best.worst_us:
            self._best = _Best(list(tours), worst_us)

    def walks(self, stop: StoppingCriterion) -> list[NDArray[np.int32]]:
        """Return the walks, cells (row, col) int32 (n, 2)."""
        return [self._walk(robot, stop) for robot in range(len(self._best.tours))]

    def _walk(self, robot: int, stop: StoppingCriterion) -> NDArray[np.int32]:
        tours = self._best.tours
        walk = self._ground.walk_of(tours[robot], self._ground.starts[robot])
        if self._fleet.returns or len(walk) < 3:
            return walk
        # Cells that several robots pass are covered by the first of them.
        covered = np.ones(self._reached.size, np.bool_)
        covered[tours[robot]] = False
        for tour in tours[:robot]:
            covered[tour] = True
        if covered.all():
            return walk
        problem = CoverageProblem.of(
            self._lattice,
            self._fleet.starts[robot],
            covered=covered.reshape(self._reached.shape),
            cost=self._fleet.cost,
            before=walk,
            reachable=self._reached,
        )
        planner = NearOptimal(ColonyConfig(seed=self._fleet.seed))
        found = planner.plan(replace(problem, is_full=True), AnyOf(WorkLimit(OPEN), stop))
        return found.cells
