"""Division of a building among several robots: one walk each, per connected area."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.fleet.first_tours import Fleet
from fasaco_edge.planners.fleet.sharing import Sharing
from fasaco_edge.planners.planner import StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """A walk for each robot; together they cover everything reachable.

    Attributes:
        walks: one per robot, int32 (n, 2), n >= 1: cells (row, col), its start first.
        costs_s: cost of each walk [s].
        cells: number of cells to cover.
        lower_bound_steps: lower bound on the steps of the longest walk.
        rounds: number of rounds of pairs.
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
        stop: stopping criterion; it sees cost and steps of the longest walk.

    Raises:
        StartOutsideMap, StartBlocked: a robot cannot stand at its start; the text has its number,
            from 1.
        NothingToCover: no cell is coverable.
    """
    reached = [_reached(lattice, start, number) for number, start in enumerate(fleet.starts, 1)]
    walks: list[NDArray[np.int32]] = [np.empty((0, 2), np.int32)] * len(fleet.starts)
    cells = least = rounds = 0
    left = list(range(len(fleet.starts)))
    while left:
        # Robots in the same connected area share it.
        here = lattice.local(fleet.starts[left[0]])
        together = [robot for robot in left if reached[robot][here]]
        group = replace(fleet, starts=[fleet.starts[robot] for robot in together])
        sharing = Sharing(lattice, group, reached[left[0]])
        for _ in sharing.run(stop):
            if stop(sharing.progress()):
                break
        for robot, walk in zip(together, sharing.walks(stop), strict=True):
            walks[robot] = walk
        cells += sharing.cells
        least, rounds = max(least, sharing.lower_bound_steps), rounds + sharing.rounds
        left = [robot for robot in left if robot not in together]
    costs_s = tuple(fleet.cost.of_walk(walk) for walk in walks)
    return Division(tuple(walks), costs_s, cells, least, rounds)


def _reached(lattice: CoverageLattice, start: Cell, number: int) -> NDArray[np.bool_]:
    try:
        problem = CoverageProblem.of(lattice, start)
    except FasacoError as error:
        raise type(error)(f"robot {number}: {error}") from error
    return problem.to_cover
