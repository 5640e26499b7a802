"""Division of a known building among robots: the parts of a mission, balanced by planned walks.

Each connected area is divided as a mission divides it (``fleet.mission.division``), and each part
is planned by itself. The plans give the cost of a cell in each part. With these costs the handicaps
are balanced again, in turn for the same seeds and for seeds at the centres of the parts, as long as
the longest walk gets shorter. The rest of the time goes into improving the longest walk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.mission.division import Robot, balanced_handicaps_s, middles
from fasaco_edge.fleet.mission.division import divide as divide_floor
from fasaco_edge.fleet.mission.travel import Seconds, Travel
from fasaco_edge.fleet.planning.bound import longest_bound
from fasaco_edge.grid.lattice import Cell, CoverageLattice
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
# Result of ``next`` after the last piece of work.
_ENDED = object()
Owners = NDArray[np.int64]


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
        rounds: number of divisions and of further searches, in all areas.
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
            the rounds of all areas.

    Raises:
        StartOutsideMap, StartBlocked: a robot cannot stand at its start; the text has its number,
            from 1.
        NothingToCover: no cell is coverable.
    """
    reached = [_reached(lattice, start, number) for number, start in enumerate(fleet.starts, 1)]
    areas: list[_Area] = []

    def is_over() -> bool:
        # Each area is divided once, whatever the time.
        return all(area.walks for area in areas) and stop(_progress(areas))

    left = list(range(len(fleet.starts)))
    with ThreadPoolExecutor(fleet.threads) as pool:
        while left:
            ground = reached[left[0]]
            robots = [robot for robot in left if ground[lattice.local(fleet.starts[robot])]]
            group = replace(fleet, starts=[fleet.starts[robot] for robot in robots])
            areas.append(_Area(lattice, group, ground, robots, pool, is_over))
            left = [robot for robot in left if robot not in robots]
        _run(areas, is_over)
    walks: list[NDArray[np.int32]] = [np.empty((0, 2), np.int32)] * len(fleet.starts)
    for area in areas:
        for robot, walk in zip(area.robots, area.walks, strict=True):
            walks[robot] = walk
    return Division(
        tuple(walks),
        tuple(fleet.cost.of_walk(walk) for walk in walks),
        sum(area.travel.cells.size for area in areas),
        max(area.bound_steps() for area in areas),
        sum(area.rounds for area in areas),
    )


def _reached(lattice: CoverageLattice, start: Cell, number: int) -> NDArray[np.bool_]:
    try:
        return CoverageProblem.of(lattice, start).to_cover
    except FasacoError as error:
        raise type(error)(f"robot {number}: {error}") from error


def _run(areas: list[_Area], is_over: Callable[[], bool]) -> None:
    """Divide each area once, then improve them round by round until stopped.

    Every other round improves the area with the longest walk, which sets the makespan; the other
    rounds take all areas in turn, whose walks should be short, too.
    """
    pieces = {id(area): area.pieces() for area in areas}
    for area in areas:
        next(pieces[id(area)])
    running, is_in_turn = deque(areas), False
    while running and not is_over():
        if is_in_turn:
            running.rotate(-1)
            area = running[-1]
        else:
            area = max(running, key=lambda area: area.costs_s.max())
        is_in_turn = not is_in_turn
        if next(pieces[id(area)], _ENDED) is _ENDED:
            running.remove(area)


def _progress(areas: Sequence[_Area]) -> SearchProgress:
    """Return the rounds of all areas, and the figures of the longest walk."""
    rounds = sum(area.rounds for area in areas)
    cost_s = max(float(area.costs_s.max()) for area in areas)
    steps = max(len(walk) - 1 for area in areas for walk in area.walks)
    return SearchProgress(SearchWork(perturbations=rounds), cost_s, steps)


class _Seeds(NamedTuple):
    """A division by seeds, see ``fleet.mission.division``.

    Attributes:
        seeds: a cell for each robot.
        times_s: travel times from them to each cell, float32 (k, n) [s].
        handicaps_s: float32 (k,) [s].
    """

    seeds: list[Cell]
    times_s: Seconds
    handicaps_s: Seconds

    def owner(self) -> Owners:
        """Return the robot of each cell, int64 (n,)."""
        owner: Owners = (self.times_s + self.handicaps_s[:, None]).argmin(axis=0)
        return owner


class _Area:
    """A connected area, and the robots that share it.

    Attributes:
        robots: their indices.
        walks, costs_s: the best so far, float64 (k,) [s].
        rounds: divisions and further searches so far.
        travel: travel times to its cells.
    """

    def __init__(
        self,
        lattice: CoverageLattice,
        fleet: Fleet,
        ground: NDArray[np.bool_],
        robots: list[int],
        pool: ThreadPoolExecutor,
        is_over: Callable[[], bool],
    ) -> None:
        self.robots, self.rounds = robots, 0
        self.walks: list[NDArray[np.int32]] = []
        self.costs_s = np.full(len(robots), np.inf)
        self.travel = Travel(lattice, np.flatnonzero(ground), 1)
        self._lattice, self._fleet, self._ground = lattice, fleet, ground
        self._pool, self._is_over = pool, is_over
        self._steps_s = np.full(len(robots), fleet.cost.step_s)
        self._owner: Owners = np.zeros(0, np.int64)

    def pieces(self) -> Iterator[None]:
        """Divide, round by round; then search on, walk by walk."""
        yield from self._even()
        yield from self._search_on()

    def bound_steps(self) -> int:
        """Return a lower bound on the steps of the longest walk."""
        times_s = self.travel.times_s(list(self._fleet.starts), np.ones(len(self.robots)))
        away = times_s.min(axis=0).round().astype(np.int64)
        return longest_bound(
            self._lattice, self._fleet.starts, self._ground, away, returns=self._fleet.returns
        )

    def _even(self) -> Iterator[None]:
        """Divide as a mission does, then in other ways while that shortens the longest walk."""
        fleet, cost = self._fleet, self._fleet.cost
        robots = [Robot(f"{n:04}", cell, cost.step_s) for n, cell in enumerate(fleet.starts)]
        turn_steps = cost.quarter_turn_s / cost.step_s
        first = divide_floor(self._lattice, self._ground, robots, turn_steps=turn_steps)
        handicaps_s = np.array(first.handicaps_s, np.float32)
        best = _Seeds(list(first.seeds), self._times_s(first.seeds), handicaps_s)
        self._offer(best.owner())
        yield
        tried, has_gained = {best.owner().tobytes()}, len(robots) > 1
        while has_gained:
            has_gained = False
            for other in self._others(best):
                if (parts := other.owner()).tobytes() in tried:
                    continue
                tried.add(parts.tobytes())
                if has_gained := self._offer(parts):
                    best = other
                yield
                if has_gained:
                    break

    def _others(self, best: _Seeds) -> Iterator[_Seeds]:
        """Yield divisions that may balance the best walks so far."""
        count = np.bincount(self._owner, minlength=len(self.robots))
        mean_s = self.costs_s.sum() / self._owner.size
        cells_s = np.where(count > 0, self.costs_s / np.maximum(count, 1), mean_s)
        cells_s = np.maximum(cells_s, self._steps_s)
        evened = balanced_handicaps_s(best.times_s, cells_s, best.handicaps_s)
        yield best._replace(handicaps_s=evened)
        seeds = middles(self._lattice, self.travel.cells, self._owner, best.seeds)
        times_s = self._times_s(seeds)
        yield _Seeds(seeds, times_s, balanced_handicaps_s(times_s, cells_s))

    def _times_s(self, seeds: Sequence[Cell]) -> Seconds:
        return self.travel.times_s(seeds, self._steps_s)

    def _offer(self, owner: Owners) -> bool:
        """Plan for each part of a division; return whether the longest walk is shorter."""
        robots = range(len(self.robots))
        walks = list(self._pool.map(lambda robot: self._walk(owner, robot, QUICK), robots))
        self.rounds += 1
        costs_s = np.array([self._fleet.cost.of_walk(walk) for walk in walks])
        if costs_s.max() >= self.costs_s.max():
            return False
        self.walks, self.costs_s, self._owner = walks, costs_s, owner
        return True

    def _search_on(self) -> Iterator[None]:
        """Search for the longest walk, with more work each time."""
        work = np.full(len(self.robots), QUICK)
        while work.min() < MOST:
            open_s = np.where(work < MOST, self.costs_s, -1.0)
            robot = int(open_s.argmax())
            work[robot] *= MORE
            walk = self._walk(self._owner, robot, int(work[robot]))
            cost_s = self._fleet.cost.of_walk(walk)
            if cost_s < self.costs_s[robot]:
                self.walks[robot], self.costs_s[robot] = walk, cost_s
            self.rounds += 1
            yield

    def _walk(self, owner: Owners, robot: int, per_cell: int) -> NDArray[np.int32]:
        """Return a walk of a robot over its part, int32 (n, 2)."""
        start = self._fleet.starts[robot]
        mine = np.zeros(self._ground.shape, np.bool_)
        mine.ravel()[self.travel.cells[owner == robot]] = True
        mine[self._lattice.local(start)] = False
        if not mine.any():
            return np.array([start], np.int32)
        problem = CoverageProblem.of(
            self._lattice,
            start,
            covered=~mine,
            end=start if self._fleet.returns else None,
            cost=self._fleet.cost,
        )
        most = per_cell * problem.cells

        def is_over(progress: SearchProgress) -> bool:
            return progress.work.proposals >= most or self._is_over()

        planner = NearOptimal(ColonyConfig(seed=self._fleet.seed))
        return planner.plan(problem, is_over).cells
