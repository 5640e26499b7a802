"""Division of a known building among robots: the parts of a mission, and a walk over each.

Robots that can reach one another share their floor as in a mission (``fleet.mission.division``).
While that shortens the longest walk, the parts are balanced again by what the planned walks cost.
The rest of the time goes into searching for a shorter longest walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.mission.division import Robot, balanced_handicaps_s, middles
from fasaco_edge.fleet.mission.division import divide as divide_floor
from fasaco_edge.fleet.mission.travel import Travel
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import SearchProgress, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal

# Proposals per cell of the search for each part while the parts are balanced.
QUICK = 40
# Proposals of each further search for the longest walk: as a multiple of the previous search, and
# limit per cell.
MORE, MOST = 3, 40_000


@dataclass(frozen=True, slots=True)
class Fleet:
    """Robots that share a building.

    Attributes:
        starts: start cell (row, col) of each robot.
        cost: prices of steps and turns, the same for all.
        returns: whether each robot returns to its start.
        seed: seed of the search.
        threads: number of threads; the result is the same for any number.
    """

    starts: Sequence[Cell]
    cost: CoverageCost
    returns: bool = True
    seed: int = 0
    threads: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """A walk for each robot; together they cover everything reachable.

    Attributes:
        walks: one per robot, int32 (n, 2), n >= 1: cells (row, col), its start first.
        costs_s: cost of each walk [s].
        cells: number of cells to cover.
        lower_bound_steps: lower bound on the steps of the longest walk.
        rounds: number of divisions and of further searches.
    """

    walks: tuple[NDArray[np.int32], ...]
    costs_s: tuple[float, ...]
    cells: int
    lower_bound_steps: int
    rounds: int


def divide(lattice: CoverageLattice, fleet: Fleet, stop: StoppingCriterion) -> Division:
    """Divide everything reachable among robots.

    Args:
        lattice: the cells where robots fit; starts of other robots are no obstacles.
        fleet: the robots, at least one.
        stop: stopping criterion; it sees cost and steps of the longest walk, and as perturbations
            the rounds. Each robot gets a walk, whatever the time.

    Raises:
        StartOutsideMap, StartBlocked: a robot cannot stand at its start; the text has its number,
            from 1.
        NothingToCover: no cell is coverable.
    """
    search = _Search(lattice, fleet, stop)
    reached = [_reached(lattice, start, number) for number, start in enumerate(fleet.starts, 1)]
    left, cells, bound = list(range(len(reached))), 0, 0
    grounds: list[tuple[NDArray[np.bool_], list[int]]] = []
    while left:
        ground = reached[left[0]]
        grounds.append((ground, [one for one in left if ground[lattice.local(fleet.starts[one])]]))
        left = [one for one in left if one not in grounds[-1][1]]
    for ground, robots in grounds:
        starts = [fleet.starts[robot] for robot in robots]
        travel = Travel(lattice, np.flatnonzero(ground), 1)
        away = travel.times_s(starts, np.ones(len(starts))).min(axis=0).round().astype(np.int64)
        least = _least_steps(lattice, starts, ground, away, returns=fleet.returns)
        cells, bound = cells + len(travel.cells), max(bound, least)
        search.divide(travel, robots)
    search.go_on()
    costs_s = tuple(search.costs_s.tolist())
    return Division(tuple(search.walks), costs_s, cells, bound, search.rounds)


def _reached(lattice: CoverageLattice, start: Cell, number: int) -> NDArray[np.bool_]:
    try:
        return CoverageProblem.of(lattice, start).to_cover
    except FasacoError as error:
        raise type(error)(f"robot {number}: {error}") from error


def _least_steps(
    lattice: CoverageLattice,
    starts: Sequence[Cell],
    reached: NDArray[np.bool_],
    away: NDArray[np.int64],
    *,
    returns: bool,
) -> int:
    """Return a lower bound on the steps of the longest walk, for any division of the cells.

    Walks of k robots that return, joined at neighbouring cells by at most 2 (k - 1) further steps,
    are one tour over everything: together they have at least as many steps as that tour's bound,
    less the further steps. An even share of that is a bound, and so is an even share of the visits
    of one colour of a chessboard, and the way to the farthest cell and back.

    Args:
        lattice: the cells where robots fit.
        starts: where they start.
        reached: bool (rows, cols), the cells to cover: connected, with the starts in them.
        away: int64 (n,), from the nearest start to each cell [steps].
        returns: whether each robot returns to its start.
    """
    cells, robots = int(np.count_nonzero(reached)), len(starts)
    if not returns:
        return max(int(away.max()), -(-(cells - robots) // robots))
    least = 2 * int(away.max())
    if cells <= robots:
        return least
    # If robots stay at their starts, which they cover without a step, the others have longer walks.
    rows, cols = np.nonzero(reached)
    odd = int(np.count_nonzero((rows + cols) & 1))
    problem = CoverageProblem.of(lattice, starts[0], end=starts[0], reachable=reached)
    tour = lower_bound_steps(replace(problem, to_cover=reached))
    share = -(-max(2 * max(odd, cells - odd), tour - 2 * (robots - 1)) // robots)
    return max(least, share + share % 2)


class _Search:
    """The search for all robots' walks.

    Attributes:
        walks, costs_s: the best so far, float64 (k,) [s]; infinite without a walk.
        rounds: divisions and further searches so far.
    """

    def __init__(self, lattice: CoverageLattice, fleet: Fleet, stop: StoppingCriterion) -> None:
        count = len(fleet.starts)
        self.walks = [np.array([start], np.int32) for start in fleet.starts]
        self.costs_s, self.rounds = np.full(count, np.inf), 0
        self._lattice, self._fleet, self._stop = lattice, fleet, stop
        self._parts = [np.zeros(lattice.steps.shape, np.bool_)] * count

    def divide(self, travel: Travel, robots: list[int]) -> None:
        """Divide cells among robots, again while that shortens the longest of their walks."""
        starts, cost = self._fleet.starts, self._fleet.cost
        named = [Robot(f"{robot:04}", starts[robot], cost.step_s) for robot in robots]
        wanted = np.zeros(self._lattice.steps.shape, np.bool_)
        wanted.ravel()[travel.cells] = True
        turn_steps = cost.quarter_turn_s / cost.step_s
        first = divide_floor(self._lattice, wanted, named, turn_steps=turn_steps)
        steps_s = np.full(len(robots), cost.step_s)
        seeds = [part.seed for part in first.parts]
        handicaps_s = np.array([part.handicap_s for part in first.parts], np.float32)
        times_s = travel.times_s(seeds, steps_s)
        owner = (times_s + handicaps_s[:, None]).argmin(axis=0)
        has_gained = self._offer(travel, robots, owner)
        while has_gained and not self._is_over():
            count = np.bincount(owner, minlength=len(robots))
            cells_s = np.maximum(self.costs_s[robots] / np.maximum(count, 1), steps_s)
            # First with these seeds, then with seeds in the centres of the parts.
            for moved in (seeds, middles(self._lattice, travel.cells, owner, seeds)):
                times_s = travel.times_s(moved, steps_s)
                first_s = handicaps_s if moved is seeds else None
                others_s = balanced_handicaps_s(times_s, cells_s, first_s)
                tried = (times_s + others_s[:, None]).argmin(axis=0)
                if has_gained := self._offer(travel, robots, tried):
                    seeds, handicaps_s, owner = moved, others_s, tried
                    break

    def _offer(self, travel: Travel, robots: list[int], owner: NDArray[np.int64]) -> bool:
        """Plan for each part of a division; return whether the longest walk is shorter."""
        parts = []
        for number, robot in enumerate(robots):
            part = np.zeros(self._lattice.steps.shape, np.bool_)
            part.ravel()[travel.cells[owner == number]] = True
            part[self._lattice.local(self._fleet.starts[robot])] = False
            parts.append(part)
        with ThreadPoolExecutor(self._fleet.threads) as pool:
            walks = list(pool.map(partial(self._walk, per_cell=QUICK), robots, parts))
        self.rounds += 1
        costs_s = [self._fleet.cost.of_walk(walk) for walk in walks]
        if max(costs_s) >= self.costs_s[robots].max():
            return False
        for robot, part, walk, cost_s in zip(robots, parts, walks, costs_s, strict=True):
            self._parts[robot], self.walks[robot], self.costs_s[robot] = part, walk, cost_s
        return True

    def go_on(self) -> None:
        """Search for the longest walk, with more work each time."""
        work = np.full(len(self.walks), QUICK)
        while work.min() < MOST and not self._is_over():
            robot = int(np.where(work < MOST, self.costs_s, -1.0).argmax())
            work[robot] *= MORE
            walk = self._walk(robot, self._parts[robot], int(work[robot]))
            cost_s = self._fleet.cost.of_walk(walk)
            if cost_s < self.costs_s[robot]:
                self.walks[robot], self.costs_s[robot] = walk, cost_s
            self.rounds += 1

    def _is_over(self) -> bool:
        """Return whether to stop: never before each robot has a walk."""
        if not np.isfinite(self.costs_s).all():
            return False
        work, steps = SearchWork(perturbations=self.rounds), max(map(len, self.walks)) - 1
        return self._stop(SearchProgress(work, float(self.costs_s.max()), steps))

    def _walk(self, robot: int, part: NDArray[np.bool_], per_cell: int) -> NDArray[np.int32]:
        """Return a walk of a robot over its part, int32 (n, 2)."""
        start, fleet = self._fleet.starts[robot], self._fleet
        if not part.any():
            return np.array([start], np.int32)
        end = start if fleet.returns else None
        problem = CoverageProblem.of(self._lattice, start, covered=~part, end=end, cost=fleet.cost)
        most = per_cell * problem.cells

        def is_over(progress: SearchProgress) -> bool:
            return progress.work.proposals >= most or self._is_over()

        return NearOptimal(ColonyConfig(seed=fleet.seed)).plan(problem, is_over).cells
