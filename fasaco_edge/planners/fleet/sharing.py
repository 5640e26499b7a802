"""Fleet search: walks of similar cost for several robots that share a connected ground.

1. The ground is parted: each robot gets connected cells around its start, about as many as the
   others (``kernels.fleet.parts``), and a tour over them by the project's search.
2. In every other attempt instead: one tour over everything, split in two, for two groups of robots,
   and each part again, until every robot has one (``kernels.fleet.split``). That adds hardly a
   step, but balances only what is beside the paths from the starts.
3. All walks are improved together by simulated annealing (``kernels.fleet.annealing``).
4. In rounds, pairs of robots with adjacent parts merge their tours, improve the result by local
   search, and split it again; or one hands some cells to the other. Without a gain the groups grow,
   and finally everything restarts with other parts.

The objective is the makespan: the cost of the longest walk.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels import EAST, NORTH
from fasaco_edge.planners.cost import MICROSECONDS, CoverageCost, SearchWork
from fasaco_edge.planners.fleet.annealing import PIECES, FleetWalks, can_anneal
from fasaco_edge.planners.fleet.bound import longest_bound
from fasaco_edge.planners.fleet.parts import can_part, owners_of_parts
from fasaco_edge.planners.fleet.tours import Tour, TourGround
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import AnyOf, SearchProgress, StoppingCriterion, WorkLimit
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.search.walk_region import stream_of

# Proposals per cell of the first tours; perturbations of a walk with a free end.
TOUR_PROPOSALS = 1_000
OPEN = SearchWork(perturbations=200)
# Probability that of a pair only some cells change owner; their number is drawn up to FEW or more.
SHIFTED, FEW = 0.5, 6
# After this many rounds without a gain the worst robot's group grows by one.
GAINLESS_PAIRS = 4
# After this many rounds without a gain everything restarts.
GAINLESS_ROUNDS = 40
# Proposals per cell of the annealings of an attempt.
ANNEALED = (1_000, 2_000, 4_000)
# Fewest rounds of these.
ANNEALINGS = PIECES * len(ANNEALED)
# Upper limit of a seed.
SEEDS = 2**63


@dataclass(frozen=True, slots=True)
class Fleet:
    """Robots that share a ground.

    Attributes:
        starts: start cell (row, col) of each.
        returns: whether each returns to its start.
        cost: prices of steps and turns, the same for all.
        seed: seed of local search.
        threads: number of threads; the result is the same for any number.
    """

    starts: Sequence[Cell]
    cost: CoverageCost
    returns: bool = True
    seed: int = 0
    threads: int = 1


class _Best(NamedTuple):
    """The best division so far: tours, owner of each cell, greatest cost [us]."""

    tours: list[Tour]
    owner: NDArray[np.int32]
    worst_us: int


class Sharing:
    """A running division of one connected area of a lattice, a generator of pauses."""

    def __init__(self, lattice: CoverageLattice, fleet: Fleet, reached: NDArray[np.bool_]) -> None:
        self._lattice, self._fleet, self._reached = lattice, fleet, reached
        self._ground = TourGround(lattice, fleet.cost, fleet.starts)
        self._starts = self._ground.starts
        self._tours: list[Tour] = []
        self._costs_us: list[int] = []
        # The robot that covers each cell, -1 for none; int32 (rows * cols,).
        self._owner = np.full(lattice.steps.size, -1, np.int32)
        self._best = _Best([], self._owner, 0)
        self.cells = int(np.count_nonzero(reached))
        self.rounds = 0
        self.lower_bound_steps = longest_bound(
            lattice, fleet.starts, reached, self._ground.distances, returns=fleet.returns
        )
        self._least_us = self.lower_bound_steps * fleet.cost.step_us

    def progress(self) -> SearchProgress:
        """Return progress: figures of the longest walk of the best division so far."""
        steps = max(map(len, self._best.tours), default=0)
        work = SearchWork(perturbations=self.rounds)
        return SearchProgress(work, self._best.worst_us / MICROSECONDS, steps)

    def run(self, stop: StoppingCriterion) -> Iterator[None]:
        """Divide, balance and improve repeatedly; pause after each piece of work."""
        with ThreadPoolExecutor(self._fleet.threads) as pool:
            for attempt in itertools.count():
                self._begin(stop, attempt)
                self._note_best()
                yield
                yield from self._anneal(attempt)
                gainless, least_us = 0, max(self._costs_us)
                while gainless < GAINLESS_ROUNDS:
                    if len(self._starts) == 1 or self._is_proven():
                        return
                    # Larger groups alternate with pairs.
                    self._balance(2 + self.rounds % 2 * (gainless // GAINLESS_PAIRS), pool)
                    self.rounds += 1
                    worst_us = max(self._costs_us)
                    gainless = 0 if worst_us < least_us else gainless + 1
                    least_us = min(least_us, worst_us)
                    self._note_best()
                    yield

    def _anneal(self, attempt: int) -> Iterator[None]:
        """Improve all walks together."""
        if not can_anneal(len(self._starts), self.cells) or self._is_proven():
            return
        walks = FleetWalks(self._lattice, self._reached, self._starts, self._fleet.cost)
        walks.load(self._tours)
        stream = stream_of(self._fleet.seed, attempt)
        for proposals in ANNEALED:
            for _ in walks.improve(proposals, stream):
                self.rounds += 1
                self._set_tours(walks.tours())
                self._note_best()
                yield

    def _set_tours(self, tours: list[Tour]) -> None:
        """Take other tours of all robots; the first that passes a cell has it."""
        self._tours = tours
        self._costs_us = [self._ground.cost_us(tour) for tour in tours]
        for robot in reversed(range(len(tours))):
            self._owner[tours[robot]] = robot

    def _note_best(self) -> None:
        worst_us = max(self._costs_us)
        if not self._best.tours or worst_us < self._best.worst_us:
            self._best = _Best(list(self._tours), self._owner.copy(), worst_us)

    def _is_proven(self) -> bool:
        return self._best.worst_us <= self._least_us

    def _begin(self, stop: StoppingCriterion, attempt: int) -> None:
        """Find first tours, others at each attempt."""
        if attempt % 2 == 0 and can_part(len(self._starts), self.cells):
            self._begin_with_parts(stop, attempt)
        else:
            self._begin_with_tour(stop, attempt)
        self._costs_us = [self._ground.cost_us(tour) for tour in self._tours]

    def _begin_with_parts(self, stop: StoppingCriterion, attempt: int) -> None:
        """Part the ground, and plan a tour of each robot over its part."""
        seed, shape = (self._fleet.seed, attempt), self._reached.shape
        self._owner = owners_of_parts(
            self._lattice, self._reached, self._starts, self._ground.distances, seed
        )
        self._tours = []
        for robot, flat in enumerate(self._starts):
            mine = (self._owner == robot).reshape(shape)
            alone = np.array([flat], np.int32)
            is_covered = not np.delete(mine.ravel(), flat).any()
            self._tours.append(alone if is_covered else self._tour(robot, ~mine, stop, attempt))

    def _begin_with_tour(self, stop: StoppingCriterion, attempt: int) -> None:
        """Plan a tour over everything, and split it for the robots."""
        tour, robots = self._tour(0, None, stop, attempt), range(len(self._starts))
        tours = self._ground.parted(tour, robots)
        self._tours = [tours[robot] for robot in robots]
        for robot in reversed(robots):
            self._owner[tours[robot]] = robot

    def _tour(
        self,
        robot: int,
        covered: NDArray[np.bool_] | None,
        stop: StoppingCriterion,
        attempt: int,
    ) -> Tour:
        """Return a tour from a robot's start over all cells but those covered."""
        start = self._fleet.starts[robot]
        problem = CoverageProblem.of(
            self._lattice,
            start,
            covered=covered,
            end=start,
            cost=self._fleet.cost,
            reachable=self._reached,
        )
        planner = NearOptimal(ColonyConfig(seed=(self._fleet.seed + attempt) % SEEDS))
        robots = len(self._starts) if covered is None else 1
        cells = int(np.count_nonzero(problem.to_cover))
        tour = planner.plan(problem, partial(_is_tour_over, stop, cells, robots))
        return self._ground.tour_of(tour.cells)

    def _balance(self, size: int, pool: ThreadPoolExecutor) -> None:
        """Redistribute cells in groups of robots with adjacent parts.

        The worst robot's group has ``size`` members, the others have two.
        """
        groups = self._groups(size)
        # All results before the first is accepted, as accepting changes their input.
        found = list(pool.map(self._shared_anew, groups))
        for robots, tours in zip(groups, found, strict=True):
            self._accept(robots, tours)

    def _touching(self) -> NDArray[np.bool_]:
        """Return which robots have adjacent parts, bool (k, k), symmetric."""
        robots = len(self._tours)
        touch = np.zeros((robots, robots), np.bool_)
        steps = self._lattice.steps
        grid = self._owner.reshape(steps.shape)
        for direction, here, there in (
            (EAST, grid[:, :-1], grid[:, 1:]),
            (NORTH, grid[:-1], grid[1:]),
        ):
            is_open = steps[: here.shape[0], : here.shape[1]] >> direction & 1 > 0
            touch[here[is_open], there[is_open]] = True
        for robot, tour in enumerate(self._tours):
            touch[robot, self._owner[tour]] = True
        touch |= touch.T
        np.fill_diagonal(touch, False)
        return touch

    def _groups(self, size: int) -> list[tuple[int, ...]]:
        """Return groups of robots: the worst one with its neighbours, then pairs.

        Pairs that differ most come first, in random order among equals.
        """
        robots = len(self._tours)
        touch, costs_us = self._touching(), np.array(self._costs_us)
        random = np.random.default_rng((self._fleet.seed, self.rounds))
        # In every other round all small differences count as equal.
        alike_us = 2 * self._fleet.cost.step_us * (1 + 8 * (self.rounds % 2))
        apart = np.abs(costs_us[:, None] - costs_us) + alike_us * random.random((robots, robots))
        apart = np.where(touch, apart + apart.T, -1.0)
        free = np.ones(robots, np.bool_)
        groups: list[tuple[int, ...]] = []
        while (apart := np.where(free[:, None] & free, apart, -1.0)).max() >= 0.0:
            # The first group is that of the worst robot, which may be larger.
            most = 2 if groups else size
            group = [int(np.argmax(costs_us if most > 2 else apart.max(axis=1)))]
            while len(group) < most and apart[group].max() >= 0.0:
                group.append(int(apart[group].max(0).argmax()))
                apart[:, group] = -1.0
            free[group] = False
            groups.append(tuple(sorted(group)))
        return [group for group in groups if len(group) > 1]

    def _shared_anew(self, robots: tuple[int, ...]) -> dict[int, Tour] | None:
        """Return new tours of these robots over all their cells; None for none."""
        random = np.random.default_rng((self._fleet.seed, self.rounds, robots[0]))
        if len(robots) == 2 and random.random() < SHIFTED:
            return self._shifted(robots, random)
        wanted = np.isin(self._owner, robots)
        wanted[[self._starts[robot] for robot in robots]] = True
        tour = self._tours[robots[0]]
        for robot in robots[1:]:
            tour = self._ground.merged(tour, self._tours[robot])
        stream = stream_of(self._fleet.seed, self.rounds, robots[0])
        return self._ground.parted(self._ground.improved(tour, wanted, stream), robots)

    def _shifted(
        self, robots: tuple[int, ...], random: np.random.Generator
    ) -> dict[int, Tour] | None:
        """Return new tours of two robots: the one with the higher cost hands over some cells."""
        giver, taker = sorted(robots, key=lambda robot: -self._costs_us[robot])
        apart_us = self._costs_us[giver] - self._costs_us[taker]
        most = apart_us // self._fleet.cost.step_us // 2
        cells = self._piece(giver, taker, int(random.integers(1, max(most, FEW) + 1)), random)
        if not cells:
            return None
        tours = {}
        for robot in robots:
            wanted = self._owner == robot
            wanted[cells] = robot == taker
            wanted[self._starts[robot]] = True
            stream = stream_of(self._fleet.seed, self.rounds, robot)
            tours[robot] = self._ground.improved(self._tours[robot], wanted, stream)
        return tours

    def _piece(self, giver: int, taker: int, size: int, random: np.random.Generator) -> list[int]:
        """Return about ``size`` connected cells of one robot adjacent to the other's part."""
        theirs = self._owner
        rim = [
            cell
            for cell in np.flatnonzero(theirs == taker).tolist()
            for beside in self._ground.beside(cell)
            if theirs[beside] == giver
        ]
        if not rim:
            return []
        begin = rim[int(random.integers(len(rim)))]
        found = [cell for cell in self._ground.beside(begin) if theirs[cell] == giver][:1]
        seen = set(found)
        for cell in found:
            for beside in self._ground.beside(cell):
                if len(found) < size and beside not in seen and theirs[beside] == giver:
                    seen.add(beside)
                    found.append(beside)
        return found

    def _accept(self, robots: tuple[int, ...], tours: dict[int, Tour] | None) -> None:
        """Replace the tours of these robots, unless the new ones are worse."""
        if tours is None:
            return
        before = [self._costs_us[robot] for robot in robots]
        after = [self._ground.cost_us(tours[robot]) for robot in robots]
        is_no_worse = (max(after), sum(after)) <= (max(before), sum(before))
        is_shorter = sum(after) < sum(before) and max(after) < max(self._costs_us)
        if not is_no_worse and not is_shorter:
            return
        theirs = np.isin(self._owner, robots)
        theirs[[self._starts[robot] for robot in robots]] = True
        for robot, cost_us in zip(robots, after, strict=True):
            self._tours[robot], self._costs_us[robot] = tours[robot], cost_us
        for robot in reversed(robots):
            passed = np.zeros_like(theirs)
            passed[tours[robot]] = True
            self._owner[theirs & passed] = robot

    def walks(self, stop: StoppingCriterion) -> list[NDArray[np.int32]]:
        """Return the walks, cells (row, col) int32 (n, 2)."""
        return [self._walk(robot, stop) for robot in range(len(self._best.tours))]

    def _walk(self, robot: int, stop: StoppingCriterion) -> NDArray[np.int32]:
        walk = self._ground.walk_of(self._best.tours[robot], self._starts[robot])
        mine = (self._best.owner == robot).reshape(self._lattice.steps.shape)
        if self._fleet.returns or len(walk) < 3 or not mine.any():
            return walk
        problem = CoverageProblem.of(
            self._lattice,
            self._fleet.starts[robot],
            covered=~mine,
            cost=self._fleet.cost,
            before=walk,
            reachable=self._reached,
        )
        planner = NearOptimal(ColonyConfig(seed=self._fleet.seed))
        found = planner.plan(replace(problem, is_full=True), AnyOf(WorkLimit(OPEN), stop))
        return found.cells


def _is_tour_over(
    stop: StoppingCriterion, cells: int, robots: int, progress: SearchProgress
) -> bool:
    """Ask ``stop`` about a tour over cells, of which each of the robots gets a share."""
    if progress.work.proposals >= TOUR_PROPOSALS * cells:
        return True
    share = replace(progress, cost_s=progress.cost_s / robots, steps=progress.steps // robots)
    return stop(replace(share, lower_bound_cost_s=0.0))
