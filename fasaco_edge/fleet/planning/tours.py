"""Tours over a ground, and operations on them: merging, improving, splitting into parts.

A tour is a closed walk, int32 (n,), n >= 1: flat cells ``row * cols + col`` of the lattice's
arrays; a step leads from the last cell to the first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.fleet.split import best_split, ways_from
from fasaco_edge.kernels.lattice.reach import shortest_walk
from fasaco_edge.kernels.local_search.regions import Box
from fasaco_edge.kernels.local_search.walk_array import FRAME
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.search.effort import effort_for
from fasaco_edge.planners.search.walk_region import WalkRegion
from fasaco_edge.planners.walk_before import completed

# Proposals per visit of an improved tour, and perturbations of it.
PROPOSALS, PERTURBATIONS = 20, 4

Tour = NDArray[np.int32]


class TourGround:
    """A lattice, the cost of tours on it, and the robots' starts.

    Attributes:
        lattice: the cells where robots fit.
        cost: prices of steps and turns.
        starts: flat cells.
        distances: int32 (k, rows * cols): distance from each start to each cell, in steps.
    """

    def __init__(
        self, lattice: CoverageLattice, cost: CoverageCost, starts: Sequence[Cell]
    ) -> None:
        self.lattice, self.cost = lattice, cost
        self._steps, self._cols = lattice.steps, lattice.steps.shape[1]
        self.starts = [row * self._cols + col for row, col in map(lattice.local, starts)]
        self.distances = np.array([ways_from(self._steps, start) for start in self.starts])
        self._offsets = np.array([1, self._cols, -1, -self._cols], np.int64)

    def tour_of(self, cells: NDArray[np.int32]) -> Tour:
        """Return the tour of a closed walk, cells (row, col) int32 (n, 2)."""
        tour: Tour = self._flat(cells)
        return tour[:-1] if len(tour) > 1 else tour

    def walk_of(self, tour: Tour, start: int) -> NDArray[np.int32]:
        """Return a tour as a walk from ``start`` and back, cells (row, col) int32 (n, 2)."""
        tour = np.roll(tour, -int(np.argmax(tour == start)))
        return self._cells(np.append(tour, tour[0]) if len(tour) > 1 else tour)

    def cost_us(self, tour: Tour) -> int:
        """Return the cost of a tour, including its first turn [us]."""
        return 0 if len(tour) == 1 else int(self._visit_costs(tour).sum())

    def merged(self, first: Tour, second: Tour) -> Tour:
        """Return two tours merged into one, at a common cell, or else at neighbours."""
        place = np.full(self._steps.size, -1, np.int64)
        place[second] = np.arange(len(second))
        meets = np.flatnonzero(place[first] >= 0)
        if meets.size:
            at = int(meets[0])
            inner = np.roll(second, -place[first[at]])
            return np.concatenate((first[:at], inner, first[at:]))
        for direction, offset in enumerate(self._offsets.tolist()):
            is_open = self._steps.ravel()[first] >> direction & 1 > 0
            beside = np.where(is_open, first + offset, first)
            near = np.flatnonzero(place[beside] >= 0)
            if near.size:
                at = int(near[0])
                inner = np.roll(second, -place[beside[at]])
                return np.concatenate((first[: at + 1], inner, inner[:1], first[at:]))
        path = self._shortest(int(first[0]), int(second[0]))
        return np.concatenate((path[:-1], second, path[:0:-1], first))

    def parted(self, tour: Tour, robots: Sequence[int]) -> dict[int, Tour]:
        """Split a tour until each robot has a part, with the shortest path to it and back."""
        tours = {}
        parts = [(tour, np.array(robots))]
        while parts:
            part, theirs = parts.pop()
            if len(theirs) == 1:
                tours[int(theirs[0])] = self._reached(int(theirs[0]), part)
            else:
                parts += self._split(part, theirs)
        return tours

    def improved(self, tour: Tour, wanted: NDArray[np.bool_], random: NDArray[np.uint64]) -> Tour:
        """Return a tour over ``wanted`` cells, improved by local search.

        Args:
            tour: the tour so far.
            wanted: bool (rows * cols,), the cells to visit from now on; those not on the tour must
                be connected to it by others of them.
            random: stream, uint64 (1,); advanced.
        """
        problem = self._cut_out(tour, wanted)
        framed = FramedGround.of(problem)
        assert problem.before is not None
        walk = completed(problem, framed, problem.before)
        region = WalkRegion(framed.rows, framed.cols, 4 * walk.size, 1)
        everywhere = np.zeros(framed.ground.bound, np.int32)
        if region.load(framed, walk, Box(everywhere, 0, FRAME, FRAME, framed.rows, framed.cols)):
            region.improve(0, PROPOSALS * walk.size, random)
            region.go_back()
            region.perturb(effort_for(problem.cost).rules, PERTURBATIONS, random)
            walk = region.put_back()
        return self.tour_of(problem.cells_of(framed.unframed(walk)))

    def beside(self, cell: int) -> list[int]:
        """Return the neighbours of a flat cell that a step leads to."""
        mask = int(self._steps[divmod(cell, self._cols)])
        offsets = enumerate(self._offsets.tolist())
        return [cell + offset for direction, offset in offsets if mask >> direction & 1]

    def _flat(self, cells: NDArray[np.int32]) -> NDArray[np.int32]:
        window = self.lattice.window
        flat = (cells - (window.row0, window.col0)) @ (self._cols, 1)
        return flat.astype(np.int32)

    def _cells(self, flat: NDArray[np.int32]) -> NDArray[np.int32]:
        rows, cols = np.divmod(flat, self._cols)
        window = self.lattice.window
        return np.column_stack((rows + window.row0, cols + window.col0)).astype(np.int32)

    def _shortest(self, begin: int, end: int) -> NDArray[np.int32]:
        """Return a shortest path between two flat cells, with both, int32 (n,)."""
        path = shortest_walk(self._steps, divmod(begin, self._cols), divmod(end, self._cols))
        return (path @ (self._cols, 1)).astype(np.int32)

    def _visit_costs(self, tour: Tour) -> NDArray[np.int64]:
        """Return the cost of each visit: the turn in it and the step out of it [us]."""
        after = np.roll(tour, -1) - tour
        before = np.roll(after, 1)
        quarters = np.where(after == before, 0, np.where(after == -before, 2, 1)).astype(np.int64)
        costs: NDArray[np.int64] = self.cost.step_us + self.cost.quarter_turn_us * quarters
        return costs

    def _split(self, tour: Tour, robots: NDArray[np.int64]) -> list[tuple[Tour, NDArray[np.int64]]]:
        """Split a tour in two, each with some of the robots."""
        found, order = np.zeros(5, np.int64), np.zeros(len(robots), np.int64)
        costs_us = np.concatenate(([0], np.cumsum(np.tile(self._visit_costs(tour), 2))))
        distances, step_us = self.distances[robots], self.cost.step_us
        is_split = len(tour) > 1 and best_split(
            self._steps.ravel(), self._offsets, tour, costs_us, distances, step_us, found, order
        )
        if not is_split:
            return [(tour, robots[:1]), (tour[:1], robots[1:])]  # fewer cells than robots
        first, count, second, rest, share = found.tolist()
        twice = np.concatenate((tour, tour))
        return [
            (twice[first : first + count], robots[order[:share]]),
            (twice[second : second + rest], robots[order[share:]]),
        ]

    def _reached(self, robot: int, part: Tour) -> Tour:
        """Return a part of a tour with the shortest path to it from a robot's start, and back."""
        part = np.roll(part, -int(np.argmin(self.distances[robot][part])))
        if part[0] == self.starts[robot]:
            return part
        path = self._shortest(self.starts[robot], int(part[0]))
        if len(part) == 1:
            return np.concatenate((path, path[-2:0:-1]))
        return np.concatenate((path[:-1], part, path[:0:-1]))

    def _cut_out(self, tour: Tour, wanted: NDArray[np.bool_]) -> CoverageProblem:
        """Return the problem of covering ``wanted`` around a tour, its ``before``."""
        whole = self.lattice.window
        rows, cols = np.divmod(np.concatenate((tour, np.flatnonzero(wanted))), self._cols)
        top, left = int(rows.min()), int(cols.min())
        inside = slice(top, int(rows.max()) + 1), slice(left, int(cols.max()) + 1)
        steps = self._steps[inside].copy()
        # No step leaves the window.
        steps[:, -1] &= ~np.uint8(1 << EAST)
        steps[-1] &= ~np.uint8(1 << NORTH)
        steps[:, 0] &= ~np.uint8(1 << WEST)
        steps[0] &= ~np.uint8(1 << SOUTH)
        row0, col0 = whole.row0 + top, whole.col0 + left
        window = Window(row0, col0, row0 + steps.shape[0], col0 + steps.shape[1])
        states = self.lattice.states[inside].copy()
        lattice = CoverageLattice(window, self.lattice.cell_m, states, steps)
        before = self._cells(np.append(tour, tour[0]))
        row, col = before[0].tolist()
        to_cover = wanted.reshape(self._steps.shape)[inside].copy()
        return CoverageProblem(
            lattice,
            (row, col),
            to_cover,
            np.zeros_like(to_cover),
            end=(row, col),
            cost=self.cost,
            before=before,
        )
