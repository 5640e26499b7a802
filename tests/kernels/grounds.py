"""Grounds and walks for the kernels of local search, and a plain recount of what they keep.

Arrays have no cell more than the kernels' docstrings ask for, and stand between
guards: whatever writes beside an array leaves its mark on them.
"""

import itertools
from collections import Counter
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.ants.fold import AntRules, DiscColony
from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.parity import Tally
from fasaco_edge.kernels.local_search.perturbation import SearchMemory
from fasaco_edge.kernels.local_search.walk_array import (
    COST,
    FRAME,
    LENGTH,
    ROOM_BIT,
    SPARE_CELLS,
    Ground,
    Prices,
    Walk,
    recount,
)
from fasaco_edge.planners.search.search_trail import colony_for
from tests import naive
from tests.support.grids import with_passages_closed

GUARD, MARK = 64, 77

PRICES = (
    Prices(1_000_000, 0, True),
    Prices(1_000_000, 0, False),
    Prices(700_000, 1_100_000, True),
    Prices(700_000, 1_100_000, False),
    Prices(1_000, 3_600_000_000, True),
    Prices(700_000, 1_100_000, True, row_us=900_000),
    Prices(1_000_000, 0, False, col_us=300_000),
    Prices(700_000, 1_100_000, True, room_us=2_000_000),
    Prices(1_000_000, 0, False, row_us=300_000, room_us=5_000_000),
)


def room_of(cell):
    """Each cell's room, where there is a price for rooms."""
    return cell[0] // 3, cell[1] // 2


def guarded(shape, dtype, value=0):
    """An array that knows when something was written beside it."""
    whole = np.full(np.prod(shape, dtype=int) + 2 * GUARD, MARK, dtype)
    inner = whole[GUARD:-GUARD].reshape(shape)
    inner[...] = value
    return inner


def assert_guards_hold(*groups):
    for name, array in itertools.chain(*(group._asdict().items() for group in groups)):
        if isinstance(array, np.ndarray) and array.base is not None:
            margins = np.concatenate((array.base[:GUARD], array.base[-GUARD:]))
            assert (margins == MARK).all(), name


class Task(NamedTuple):
    """A lattice's steps, which of its cells are to be covered, and a walk that covers them."""

    steps: np.ndarray
    wanted: np.ndarray
    walk: list

    @property
    def width(self):
        return self.steps.shape[1] + 2 * FRAME

    def framed(self, cell):
        return (cell[0] + FRAME) * self.width + cell[1] + FRAME

    def unframed(self, cell):
        row, col = divmod(int(cell), self.width)
        return row - FRAME, col - FRAME

    def ground(self):
        needed = np.pad(self.wanted.astype(np.int32), FRAME).ravel()
        bits = np.zeros_like(self.steps)
        for row, col in np.ndindex(bits.shape):
            room, ways = room_of((row, col)), ((0, 1), (1, 0), (0, -1), (-1, 0))
            for direction, (up, right) in enumerate(ways):
                is_other = room_of((row + up, col + right)) != room
                bits[row, col] |= is_other << direction
        bits = (bits & self.steps) << ROOM_BIT
        steps = np.pad(self.steps | bits, FRAME).ravel()
        offsets = np.array([1, self.width, -1, -self.width], np.int64)
        return Ground(steps, needed, offsets, steps.size)

    def cells(self):
        return np.array([self.framed(cell) for cell in self.walk], np.int32)


def drawn_task(seed, side=7):
    """A ground with walls and thin walls, and a clumsy walk over all or part of it."""
    random = np.random.default_rng(seed)
    shape = random.integers(side // 2 + 1, side + 1, 2)
    if random.random() < 0.15:
        shape[random.integers(2)] = 1
    floor = random.random(shape) < random.choice((1.0, 0.9, 0.75))
    floor.flat[random.integers(floor.size)] = True
    ground = CoverageLattice.from_free(floor)
    steps = with_passages_closed(ground, random.choice((0.0, 0.1, 0.2)), random).steps
    # Of three places to start in the one from where most can be reached.
    starts = random.permutation(np.argwhere(floor))[:3].tolist()
    start = max(map(tuple, starts), key=lambda cell: len(naive.distances(steps, cell)))
    return task_on(steps, start, random, random.choice((1.0, 1.0, 0.4)))


def tasks(most=7):
    return st.builds(drawn_task, st.integers(0, 2**32), st.integers(1, most))


def task_on(steps, start, random, share=1.0):
    """A walk to some of the reachable cells in random order, each by a shortest way."""
    around = naive.neighbours(steps)
    wanted = np.zeros(steps.shape, bool)
    for cell in naive.distances(steps, start):
        wanted[cell] = random.random() < share
    walk, left = [start], {tuple(cell) for cell in np.argwhere(wanted).tolist()} - {start}
    while left:
        goal = sorted(left)[random.integers(len(left))]
        away = naive.distances(steps, goal)
        while walk[-1] != goal:
            nearer = [there for there in around[walk[-1]].values() if away[there] < away[walk[-1]]]
            walk.append(nearer[random.integers(len(nearer))])
        left -= set(walk)
    return Task(steps, wanted, walk)


def walk_on(ground, cells, prices, room=None, jumps=0):
    """The walk with all that is known of it."""
    both = ground.bound + jumps
    walk = Walk(
        cells=guarded(len(cells) + 40 if room is None else room, np.int32, -1),
        place=guarded(both, np.int32),
        visits=guarded(both, np.int32),
        spare=guarded(both, np.int32),
        spare_at=guarded(both, np.int32),
        counts=guarded(3, np.int64),
    )
    walk.cells[: len(cells)] = cells
    recount(ground, walk, len(cells), prices)
    return walk


def tally_on(ground, room, jumps=0):
    size = ground.bound
    tally = Tally(
        times=guarded((size, 2), np.int16),
        order_of_old=guarded((size, 4), np.int8, -1),
        rays=guarded(size, np.int64),
        reached=guarded(size, np.int64),
        distance=guarded(size, np.int32),
        growth=guarded(size, np.int32),
        parent=guarded(size, np.int32),
        crossed=guarded(size, np.int64),
        order=guarded(size, np.int32),
        near=guarded(4 * size, np.int32),
        far=guarded(4 * size, np.int32),
        loops=guarded((size, 2), np.int64),
        marked=guarded(size, np.int64),
        clock=guarded(2, np.int64),
        stack=guarded(room, np.int32),
        counts=guarded(1, np.int64),
        jump_ends=guarded((jumps, 2), np.int32),
        next_jump=guarded((jumps, 2), np.int32),
        jumped=guarded(jumps, np.uint8),
        links=guarded(size, np.int32, -1),
    )
    rays(ground, tally.rays)
    return tally


def memory_on(ground, room):
    size = ground.bound
    return SearchMemory(
        saved=guarded(room, np.int32),
        best=guarded(room, np.int32),
        best_counts=guarded(3, np.int64),
        touched=guarded(size, np.int32),
        area=guarded(size, np.int32),
        marked=guarded(size, np.int32),
        work=guarded(2, np.int64),
    )


def colony_on(ground, prices, ants=4, radius=(1, 4)):
    """Memory for ants on a ground, whose arrays know when something was written beside them."""
    eta = prices.step_us / (prices.step_us + np.arange(5) * prices.quarter_turn_us)
    rules = AntRules(0.9, 0.1, 0.1, eta**2.0, ants, radius, np.array([8, 2, 1]), 1.0)
    plain = colony_for(ground.steps.size, rules)._asdict()
    return DiscColony(
        **{
            name: guarded(it.shape, it.dtype, it) if isinstance(it, np.ndarray) else it
            for name, it in plain.items()
        }
    )


def stream(seed):
    return np.random.SeedSequence(seed).generate_state(1, np.uint64) | np.uint64(1)


def cells_of(walk):
    return walk.cells[: walk.counts[LENGTH]].tolist()


def steps_taken(cells):
    """How often each step is walked, in whatever direction."""
    return Counter(tuple(sorted(step)) for step in itertools.pairwise(cells))


def assert_legal(task, cells):
    """Each step is one of the mask's."""
    around = naive.neighbours(task.steps)
    walk = [task.unframed(cell) for cell in cells]
    for here, there in itertools.pairwise(walk):
        assert there in around[here].values(), (here, there)
    return walk


def assert_counts(ground, walk):
    """What is kept of a walk, but for its cost, is what counting gives."""
    cells = cells_of(walk)
    visits = Counter(cells)
    assert walk.visits.tolist() == [visits[cell] for cell in range(walk.visits.size)]
    assert all(cells[walk.place[cell]] == cell for cell in visits)
    spare = walk.spare[: walk.counts[SPARE_CELLS]].tolist()
    assert sorted(spare) == sorted(c for c in visits if visits[c] > ground.needed[c])
    assert all(walk.spare_at[cell] == index for index, cell in enumerate(spare))
    assert_guards_hold(walk)


def assert_sound(task, ground, walk, prices):
    """The walk is one, covers what it has to, and all that is kept of it is true."""
    assert_counts(ground, walk)
    way = assert_legal(task, cells_of(walk))
    assert {tuple(cell) for cell in np.argwhere(task.wanted).tolist()} <= set(way)
    assert way[0] == task.walk[0]
    assert prices.free_end or way[-1] == task.walk[-1]
    assert walk.counts[COST] == naive.walk_us(way, prices, room_of)
