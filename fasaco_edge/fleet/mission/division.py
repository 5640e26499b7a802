"""Division of the remaining cells among the robots at work: a seed and a handicap for each.

A cell belongs to the robot with the least sum of its handicap and the travel time from its seed. So
each part is connected, and cells that a map shows later have an owner, too. Handicaps balance the
workload of the parts. Seeds start at the robots, or far from one another; then they move to the
centres of the parts (Lloyd's algorithm, with travel times as distances). ``divide`` selects the
division with the shortest makespan for robots that always walk to their nearest open cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.travel import Seconds, Travel, cell_of, on_ground, times_of, ways
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels.fleet.nearest import walk_parts
from fasaco_edge.mission.events import Part

# Largest number of cells used; of a larger area, every second (third, ...) cell is used.
# Limit on rounds x robots x cells; it reduces the number of rounds, but not below one.
MOST_CELLS, MOST_SEARCHED = 2_000, 3_000_000
# Rounds of moving the seeds; updates of the handicaps; ratio of each update's size to the previous.
ROUNDS, CHANGES, DAMPING = 3, 30, 0.85
# Number of searches for handicaps with the same seeds; each uses the times per cell that resulted
# from the previous search.
EVENED = 3
# Factor on the makespan of the old seeds, below 1 to favour them.
# Weight of the cost of moved cells: their share of all cells, times the robots' mean time.
STABLE, CHANGED = 0.9, 1.0


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot that takes a part; ``step_s`` is its time to sweep one cell [s]."""

    name: str
    cell: Cell
    step_s: float


@dataclass(frozen=True, slots=True)
class Division:
    """Assignment of cells to robots, as it is sent to other robots.

    Attributes:
        parts: one for each robot at work, sorted by their names.
    """

    parts: tuple[Part, ...]

    @classmethod
    def of(cls, parts: Iterable[Part]) -> Division:
        """Return the division of parts in any order."""
        return cls(tuple(sorted(parts, key=lambda part: part.robot)))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the robots, sorted."""
        return tuple(part.robot for part in self.parts)

    def busiest(self, owners: NDArray[np.int8], robot: str) -> str:
        """Return the name of the robot, other than ``robot``, that owns the most cells, or "".

        Args:
            owners: int8 (n,), the index of each cell's robot.
            robot: a name.
        """
        cells = np.bincount(owners, minlength=len(self.parts)).tolist()
        others = {name: n for name, n in zip(self.names, cells, strict=True) if n and name != robot}
        return max(others, key=lambda name: others[name], default="")

    def owners(self, lattice: CoverageLattice) -> NDArray[np.int8]:
        """Return the index of each cell's robot, int8 (rows, cols)."""
        first = np.full(lattice.steps.size, np.float32(np.inf))
        owners = np.zeros(lattice.steps.size, np.int8)
        # One robot at a time: all at once would take much memory on large lattices.
        for index, part in enumerate(self.parts):
            times_s = times_of(ways(lattice, part.seed), np.float32(part.step_s))
            times_s += np.float32(part.handicap_s)
            is_earlier = times_s < first
            owners[is_earlier] = index
            np.minimum(first, times_s, out=first)
        return owners.reshape(lattice.steps.shape)


def divide(
    lattice: CoverageLattice,
    wanted: NDArray[np.bool_],
    robots: Sequence[Robot],
    before: Division | None = None,
    turn_steps: float = 0.0,
) -> Division:
    """Divide cells among robots; the robots' order makes no difference.

    Args:
        lattice: the cells where robots fit.
        wanted: bool (rows, cols), the cells to divide.
        robots: at least one. A robot that can reach none of the cells gets a seed at its own cell,
            and so owns the cells that it alone can reach.
        before: the last division; its seeds are kept unless other seeds shorten the makespan by
            much, and cells keep their robot if a change gains nothing.
        turn_steps: time of a quarter turn, in steps.
    """
    cells = np.flatnonzero(wanted)
    every = -(-len(cells) // MOST_CELLS) or 1
    travel = Travel(lattice, cells[::every], every)
    reached = [robot for robot in robots if travel.has_ways_from(robot.cell)]
    divided = {robot.name: Part(robot.name, robot.cell, 0.0, robot.step_s) for robot in robots}
    if len(reached) > 1:
        reached.sort(key=lambda robot: robot.name)
        seeds, handicaps_s = _divided(travel, reached, before, turn_steps)
        for robot, seed, handicap_s in zip(reached, seeds, handicaps_s, strict=True):
            divided[robot.name] = Part(robot.name, seed, handicap_s, robot.step_s)
    return Division.of(divided.values())


def _divided(
    travel: Travel, robots: Sequence[Robot], before: Division | None, turn_steps: float
) -> tuple[list[Cell], list[float]]:
    """Return seeds and handicaps [s] for robots that can reach the cells, see ``divide``."""
    lattice, cells = travel.lattice, travel.cells
    starts, steps_s = [robot.cell for robot in robots], np.array([one.step_s for one in robots])
    from_starts_s = travel.times_s(starts, steps_s)
    choice = _Choice(travel, starts, steps_s, _owners_before(before, robots, travel), turn_steps)
    names = [robot.name for robot in robots]
    if before is not None and set(before.names) & set(names):
        kept = {part.robot: (part.seed, part.handicap_s) for part in before.parts}
        # A seed that is out of reach on this robot's map would need a huge handicap.
        kept = {name: pair for name, pair in kept.items() if travel.has_ways_from(pair[0])}
        pairs = [kept.get(robot.name, (robot.cell, 0.0)) for robot in robots]
        seeds, old_s = [seed for seed, _ in pairs], np.array([s for _, s in pairs], np.float32)
        times_s = travel.times_s(seeds, steps_s)
        balanced_s = (balanced_handicaps_s(times_s, steps_s, first_s) for first_s in (old_s, None))
        for handicaps_s in (old_s, *balanced_s):
            choice.offer(seeds, handicaps_s, times_s, STABLE)
    rounds = max(1, min(ROUNDS, MOST_SEARCHED // (len(robots) * lattice.steps.size)))
    for begin in (starts, _spread(travel, from_starts_s)):
        seeds = begin
        for _ in range(rounds):
            times_s, cells_s = travel.times_s(seeds, steps_s), steps_s
            for _ in range(EVENED if rounds > 1 else 1):
                handicaps_s = balanced_handicaps_s(times_s, cells_s)
                owner, ends_s = choice.offer(seeds, handicaps_s, times_s)
                cells_s = _cells_s(owner, ends_s, steps_s)
            seeds = middles(lattice, cells, owner, seeds)
    return choice.seeds, choice.handicaps_s.tolist()


class _Choice:
    """The best of the divisions offered: seeds, and handicaps, float32 (k,) [s]."""

    def __init__(
        self,
        travel: Travel,
        starts: Sequence[Cell],
        steps_s: NDArray[np.float64],
        before: NDArray[np.int64],
        turn_steps: float,
    ) -> None:
        self.seeds: list[Cell] = []
        self.handicaps_s = np.zeros(0, np.float32)
        self._travel, self._before, self._turn_steps = travel, before, turn_steps
        # Which robots had cells: moving cells to a robot without cells costs nothing.
        self._had = np.bincount(before[before >= 0], minlength=len(starts)) > 0
        self._steps_s = steps_s
        lattice, cols = travel.lattice, travel.lattice.steps.shape[1]
        ground = [on_ground(lattice, *lattice.local(start)) for start in starts]
        self._starts = np.array([row * cols + col for row, col in ground], np.int64)
        # Writable, as kernels would be compiled again for read-only arrays.
        self._steps = lattice.steps.ravel().copy()
        self._offsets = np.array([1, cols, -1, -cols], np.int64)
        self._cost_s = np.inf

    def offer(
        self, seeds: list[Cell], handicaps_s: Seconds, times_s: Seconds, factor: float = 1.0
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Take a division if it costs less.

        Args:
            seeds, handicaps_s: the division.
            times_s: travel times from its seeds, float32 (k, n) [s].
            factor: multiplies its makespan.

        Returns:
            the owner of each cell, int64 (n,), and when each robot ends, float64 (k,) [s].
        """
        owner: NDArray[np.int64] = (times_s + handicaps_s[:, None]).argmin(axis=0)
        ends_s = self._ends_s(owner)
        changed = np.count_nonzero((self._before >= 0) & (owner != self._before) & self._had[owner])
        changed_s = changed / len(owner) * float(ends_s.mean())
        cost_s = factor * float(ends_s.max()) + CHANGED * changed_s
        if cost_s < self._cost_s:
            self.seeds, self.handicaps_s, self._cost_s = seeds, handicaps_s, cost_s
        return owner, ends_s

    def _ends_s(self, owner: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return when each robot ends, float64 (k,) [s], if it always walks to its nearest cell.

        If only every second, third ... cell is used, each cell of a part counts as one step.
        """
        if self._travel.every > 1:
            steps = self._travel.every * np.bincount(owner, minlength=len(self._starts))
        else:
            walks = walk_parts(self._steps, self._offsets, self._travel.cells, owner, self._starts)
            steps = walks[:, 0] + self._turn_steps * walks[:, 1]
        ends_s: NDArray[np.float64] = steps * self._steps_s
        return ends_s


def _cells_s(
    owner: NDArray[np.int64], ends_s: NDArray[np.float64], steps_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return each robot's time per cell, float64 (k,) [s]; the average for a robot without cells.

    The least value is the time of a step, as a robot that stands on its only cell ends at 0 s.
    """
    count = np.bincount(owner, minlength=len(ends_s))
    mean_s = ends_s.sum() / len(owner)
    return np.maximum(np.where(count > 0, ends_s / np.maximum(count, 1), mean_s), steps_s)


def _owners_before(
    before: Division | None, robots: Sequence[Robot], travel: Travel
) -> NDArray[np.int64]:
    """Return the index of the robot that had each cell, int64 (n,); -1 for an absent robot."""
    if before is None:
        return np.full(len(travel.cells), -1)
    index = {robot.name: number for number, robot in enumerate(robots)}
    numbers = np.array([index.get(name, -1) for name in before.names])
    steps_s = np.array([part.step_s for part in before.parts])
    times_s = travel.times_s([part.seed for part in before.parts], steps_s)
    handicaps_s = np.array([part.handicap_s for part in before.parts], np.float32)
    owners: NDArray[np.int64] = numbers[(times_s + handicaps_s[:, None]).argmin(axis=0)]
    return owners


def balanced_handicaps_s(
    times_s: Seconds, steps_s: NDArray[np.float64], first_s: Seconds | None = None
) -> Seconds:
    """Return handicaps, float32 (k,), that balance the load, for travel times float32 (k, n).

    The search starts from the given handicaps, and keeps them unless others balance better.
    """
    handicaps = np.zeros(len(times_s), np.float32) if first_s is None else first_s
    best, least = handicaps, np.inf
    change = float(np.ptp(times_s)) / 2
    for _ in range(CHANGES):
        owner = (times_s + handicaps[:, None]).argmin(axis=0)
        load_s = np.bincount(owner, minlength=len(times_s)) * steps_s
        if load_s.max() < least:
            best, least = handicaps, load_s.max()
        handicaps = (handicaps + change * (load_s / load_s.mean() - 1.0)).astype(np.float32)
        change *= DAMPING
    return best


def _spread(travel: Travel, from_starts_s: Seconds) -> list[Cell]:
    """Return seeds far from one another, each assigned to a robot near it."""
    count, nearest_s = len(from_starts_s), from_starts_s.min(axis=0)
    places: list[Cell] = []
    seeds: list[int] = []
    for _ in range(count):
        seeds.append(int(nearest_s.argmax()))
        places.append(cell_of(travel.lattice, int(travel.cells[seeds[-1]])))
        (times_s,) = travel.times_s(places[-1:], np.ones(1))
        nearest_s = np.minimum(nearest_s, times_s) if len(seeds) > 1 else times_s
    apart_s, order = from_starts_s[:, seeds].copy(), [0] * count
    for _ in range(count):
        robot, seed = divmod(int(apart_s.argmin()), count)
        order[robot] = seed
        apart_s[robot], apart_s[:, seed] = np.inf, np.inf
    return [places[seed] for seed in order]


def middles(
    lattice: CoverageLattice, cells: NDArray[np.int64], owner: NDArray[np.int64], seeds: list[Cell]
) -> list[Cell]:
    """Return the cell nearest to the centre of each part; the seed for an empty part."""
    rows, cols = np.divmod(cells, lattice.steps.shape[1])
    found = []
    for robot, seed in enumerate(seeds):
        own = np.flatnonzero(owner == robot)
        if not own.size:
            found.append(seed)
            continue
        off = (rows[own] - rows[own].mean()) ** 2 + (cols[own] - cols[own].mean()) ** 2
        found.append(cell_of(lattice, int(cells[own[off.argmin()]])))
    return found
