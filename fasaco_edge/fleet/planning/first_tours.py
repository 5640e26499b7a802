"""First tours of robots that share a ground, others at each attempt.

The ground is parted, each robot gets cells of about as much work as the others (``parts``), and a
tour over them by the project's search. One robot gets one tour over everything. Where there are too
many robots or cells to be parted, that is split in two, for two groups of robots, and each part
again, until every robot has one (``kernels.fleet.split``).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.planning.parts import Parting, can_part
from fasaco_edge.fleet.planning.tours import Tour, TourGround
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import SearchProgress, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal

# Proposals per cell of a robot's first tour, and of the only tour where there is one robot.
PROPOSALS, ALONE = 100, 1_000
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


@dataclass(frozen=True, slots=True)
class FirstTours:
    """Tours of a fleet's robots that together pass a ground.

    Attributes:
        lattice: the cells where robots fit.
        fleet: the robots.
        reached: bool (rows, cols), the ground: connected cells, with the starts in them.
        ground: the same for tours.
        stop: stopping criterion of the search for each tour.
    """

    lattice: CoverageLattice
    fleet: Fleet
    reached: NDArray[np.bool_]
    ground: TourGround
    stop: StoppingCriterion

    def find(self, attempt: int, pool: ThreadPoolExecutor) -> list[Tour]:
        """Return a tour for each robot."""
        robots = range(len(self.fleet.starts))
        cells = int(np.count_nonzero(self.reached))
        if not can_part(len(robots), cells):
            tours = self.ground.parted(self._tour(attempt, 0, None), robots)
            return [tours[robot] for robot in robots]
        parting = Parting(self.lattice, self.reached, self.ground.starts, self.ground.distances)
        owners = parting.owners((self.fleet.seed, attempt))
        return list(pool.map(partial(self._tour_over_part, owners, attempt), robots))

    def _tour_over_part(self, owners: NDArray[np.int32], attempt: int, robot: int) -> Tour:
        mine, start = owners == robot, self.ground.starts[robot]
        if not np.delete(mine, start).any():
            return np.array([start], np.int32)
        return self._tour(attempt, robot, ~mine.reshape(self.reached.shape))

    def _tour(self, attempt: int, robot: int, covered: NDArray[np.bool_] | None) -> Tour:
        """Return a tour from a robot's start over all cells but those covered."""
        start = self.fleet.starts[robot]
        problem = CoverageProblem.of(
            self.lattice,
            start,
            covered=covered,
            end=start,
            cost=self.fleet.cost,
            reachable=self.reached,
        )
        planner = NearOptimal(ColonyConfig(seed=(self.fleet.seed + attempt) % SEEDS))
        robots = len(self.fleet.starts)
        cells = int(np.count_nonzero(problem.to_cover))
        proposals = cells * (ALONE if robots == 1 else PROPOSALS)
        sharing = robots if covered is None else 1
        tour = planner.plan(problem, partial(_is_over, self.stop, proposals, sharing))
        return self.ground.tour_of(tour.cells)


def _is_over(
    stop: StoppingCriterion, proposals: int, robots: int, progress: SearchProgress
) -> bool:
    """Ask ``stop`` about a tour of which each of some robots gets a share."""
    if progress.work.proposals >= proposals:
        return True
    share = replace(progress, cost_s=progress.cost_s / robots, steps=progress.steps // robots)
    return stop(replace(share, lower_bound_cost_s=0.0))
