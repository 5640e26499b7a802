"""Pairs of robots that share their cells anew, for walks whose turns have a price.

Pairs with adjacent parts merge their tours, improve the result by local search, and split it again;
or one hands some cells to the other. Without a gain the worst robot's group grows.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.planning.first_tours import Fleet
from fasaco_edge.fleet.planning.tours import Tour, TourGround
from fasaco_edge.kernels import EAST, NORTH
from fasaco_edge.planners.search.walk_region import stream_of

# Probability that of a pair only some cells change owner; their number is drawn up to FEW or more.
SHIFTED, FEW = 0.5, 6
# After this many rounds without a gain the worst robot's group grows by one.
GAINLESS_PAIRS = 4


class Pairs:
    """Tours of robots, shared anew in rounds.

    Args:
        fleet: the robots.
        ground: their ground.
        tours: of each robot; together they pass all cells.
        first: number of the first round, for its random numbers.

    Attributes:
        tours: the tours now.
        costs_us: cost of each [us].
        gainless: rounds since the greatest of these was lowered.
    """

    def __init__(self, fleet: Fleet, ground: TourGround, tours: list[Tour], first: int) -> None:
        self._fleet, self._ground, self._round = fleet, ground, first
        self.tours = list(tours)
        self.costs_us = [ground.cost_us(tour) for tour in tours]
        self.gainless = 0
        # The robot that covers each cell, -1 for none; int32 (rows * cols,).
        self._owner = np.full(ground.lattice.steps.size, -1, np.int32)
        for robot in reversed(range(len(tours))):
            self._owner[tours[robot]] = robot

    def balance(self, pool: ThreadPoolExecutor) -> None:
        """Redistribute cells in groups of robots with adjacent parts.

        The worst robot's group is larger in every other round, the longer nothing was gained.
        """
        worst_us = max(self.costs_us)
        groups = self._groups(2 + self._round % 2 * (self.gainless // GAINLESS_PAIRS))
        # All results before the first is accepted, as accepting changes their input.
        found = list(pool.map(self._shared_anew, groups))
        for robots, tours in zip(groups, found, strict=True):
            self._accept(robots, tours)
        self._round += 1
        self.gainless = 0 if max(self.costs_us) < worst_us else self.gainless + 1

    def _touching(self) -> NDArray[np.bool_]:
        """Return which robots have adjacent parts, bool (k, k), symmetric."""
        robots = len(self.tours)
        touch = np.zeros((robots, robots), np.bool_)
        steps = self._ground.lattice.steps
        grid = self._owner.reshape(steps.shape)
        for direction, here, there in (
            (EAST, grid[:, :-1], grid[:, 1:]),
            (NORTH, grid[:-1], grid[1:]),
        ):
            is_open = steps[: here.shape[0], : here.shape[1]] >> direction & 1 > 0
            touch[here[is_open], there[is_open]] = True
        for robot, tour in enumerate(self.tours):
            touch[robot, self._owner[tour]] = True
        touch |= touch.T
        np.fill_diagonal(touch, False)
        return touch

    def _groups(self, size: int) -> list[tuple[int, ...]]:
        """Return groups of robots: the worst one with its neighbours, then pairs.

        Pairs that differ most come first, in random order among equals.
        """
        robots = len(self.tours)
        touch, costs_us = self._touching(), np.array(self.costs_us)
        random = np.random.default_rng((self._fleet.seed, self._round))
        # In every other round all small differences count as equal.
        alike_us = 2 * self._fleet.cost.step_us * (1 + 8 * (self._round % 2))
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
        random = np.random.default_rng((self._fleet.seed, self._round, robots[0]))
        if len(robots) == 2 and random.random() < SHIFTED:
            return self._shifted(robots, random)
        wanted = np.isin(self._owner, robots)
        wanted[[self._ground.starts[robot] for robot in robots]] = True
        tour = self.tours[robots[0]]
        for robot in robots[1:]:
            tour = self._ground.merged(tour, self.tours[robot])
        stream = stream_of(self._fleet.seed, self._round, robots[0])
        return self._ground.parted(self._ground.improved(tour, wanted, stream), robots)

    def _shifted(
        self, robots: tuple[int, ...], random: np.random.Generator
    ) -> dict[int, Tour] | None:
        """Return new tours of two robots: the one with the higher cost hands over some cells."""
        giver, taker = sorted(robots, key=lambda robot: -self.costs_us[robot])
        apart_us = self.costs_us[giver] - self.costs_us[taker]
        most = apart_us // self._fleet.cost.step_us // 2
        cells = self._piece(giver, taker, int(random.integers(1, max(most, FEW) + 1)), random)
        if not cells:
            return None
        tours = {}
        for robot in robots:
            wanted = self._owner == robot
            wanted[cells] = robot == taker
            wanted[self._ground.starts[robot]] = True
            stream = stream_of(self._fleet.seed, self._round, robot)
            tours[robot] = self._ground.improved(self.tours[robot], wanted, stream)
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
        before = [self.costs_us[robot] for robot in robots]
        after = [self._ground.cost_us(tours[robot]) for robot in robots]
        is_no_worse = (max(after), sum(after)) <= (max(before), sum(before))
        is_shorter = sum(after) < sum(before) and max(after) < max(self.costs_us)
        if not is_no_worse and not is_shorter:
            return
        theirs = np.isin(self._owner, robots)
        theirs[[self._ground.starts[robot] for robot in robots]] = True
        for robot, cost_us in zip(robots, after, strict=True):
            self.tours[robot], self.costs_us[robot] = tours[robot], cost_us
        for robot in reversed(robots):
            passed = np.zeros_like(theirs)
            passed[tours[robot]] = True
            self._owner[theirs & passed] = robot
