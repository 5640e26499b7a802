"""Division of a building among several robots: one walk each, per connected area."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.planning.first_tours import Fleet
from fasaco_edge.fleet.planning.sharing import Sharing
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import SearchProgress, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem

# What ``next`` returns after the last piece of work.
_ENDED = object()


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """A walk for each robot; together they cover everything reachable.

    Attributes:
        walks: one per robot, int32 (n, 2), n >= 1: cells (row, col), its start first.
        costs_s: cost of each walk [s].
        cells: number of cells to cover.
        lower_bound_steps: lower bound on the steps of the longest walk.
        rounds: number of pieces of annealing and rounds of pairs, in all areas.
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
        stop: stopping criterion; it sees cost and steps of the longest walk, and the rounds of all
            connected areas.

    Raises:
        StartOutsideMap, StartBlocked: a robot cannot stand at its start; the text has its number,
            from 1.
        NothingToCover: no cell is coverable.
    """
    reached = [_reached(lattice, start, number) for number, start in enumerate(fleet.starts, 1)]
    areas: list[_Area] = []
    left = list(range(len(fleet.starts)))
    while left:
        here = lattice.local(fleet.starts[left[0]])
        robots = [robot for robot in left if reached[robot][here]]
        group = replace(fleet, starts=[fleet.starts[robot] for robot in robots])
        sharing = Sharing(lattice, group, reached[left[0]])
        areas.append(_Area(robots, sharing, sharing.run(stop)))
        left = [robot for robot in left if robot not in robots]
    _run(areas, stop)
    walks: list[NDArray[np.int32]] = [np.empty((0, 2), np.int32)] * len(fleet.starts)
    for area in areas:
        for robot, walk in zip(area.robots, area.sharing.walks(stop), strict=True):
            walks[robot] = walk
    shared = [area.sharing for area in areas]
    cells, rounds = sum(one.cells for one in shared), sum(one.rounds for one in shared)
    least = max(one.lower_bound_steps for one in shared)
    costs_s = tuple(fleet.cost.of_walk(walk) for walk in walks)
    return Division(tuple(walks), costs_s, cells, least, rounds)


@dataclass(frozen=True, slots=True, eq=False)
class _Area:
    """A connected area, and the robots that share it.

    Attributes:
        robots: their indices.
        sharing: its division.
        pieces: pieces of work on that.
    """

    robots: list[int]
    sharing: Sharing
    pieces: Iterator[None]

    @property
    def cost_s(self) -> float:
        """Cost of the longest walk [s]."""
        return self.sharing.progress().cost_s


def _run(areas: Sequence[_Area], stop: StoppingCriterion) -> None:
    """Divide each area once, then improve them piece by piece until stopped.

    Every other piece is of the area with the longest walk, which decides when all are done; the
    others are of all areas in turn, whose walks should be short, too.
    """
    for area in areas:
        next(area.pieces)
    running, is_in_turn = deque(areas), False
    while running and not stop(_progress(areas)):
        if is_in_turn:
            running.rotate(-1)
            area = running[-1]
        else:
            area = max(running, key=lambda area: area.cost_s)
        is_in_turn = not is_in_turn
        if next(area.pieces, _ENDED) is _ENDED:
            running.remove(area)


def _progress(areas: Sequence[_Area]) -> SearchProgress:
    """Return the progress of all areas: their work, and figures of the longest walk."""
    each = [area.sharing.progress() for area in areas]
    work = SearchWork(perturbations=sum(one.work.perturbations for one in each))
    return SearchProgress(work, max(one.cost_s for one in each), max(one.steps for one in each))


def _reached(lattice: CoverageLattice, start: Cell, number: int) -> NDArray[np.bool_]:
    try:
        problem = CoverageProblem.of(lattice, start)
    except FasacoError as error:
        raise type(error)(f"robot {number}: {error}") from error
    return problem.to_cover
