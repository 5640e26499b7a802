"""Closed walks of robots: connected, complete, with their starts in them, and as they are told."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.annealing import anneal
from fasaco_edge.kernels.fleet.walks import DEGREE, STEP, TURNS, add_tour, driven, walks_of
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.search.walk_region import stream_of
from tests import naive
from tests.support.drawn import free_cells, ground
from tests.support.examples import examples

FULL = 256


def begun(free, starts, turn=0):
    """Walks along trees, there and back, of each robot to the cells nearest to it."""
    lattice = CoverageLattice.from_free(free)
    cols = free.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    flat = [row * cols + col for row, col in starts]
    ways = [naive.distances(lattice.steps, start) for start in starts]
    links = np.zeros((len(starts), free.size), np.uint8)
    for cell in ways[0]:
        robot = min(range(len(starts)), key=lambda one: ways[one][cell])
        if cell in starts:
            robot = starts.index(cell)
        here = cell[0] * cols + cell[1]
        while here != flat[robot]:
            nearer = [
                direction
                for direction in range(4)
                if lattice.steps.ravel()[here] >> direction & 1
                and ways[robot][divmod(here + offsets[direction], cols)]
                < ways[robot][divmod(here, cols)]
            ]
            there = here + offsets[nearer[0]]
            links[robot, here] |= 2 << 2 * nearer[0]
            links[robot, there] |= 2 << 2 * ((nearer[0] + 2) & 3)
            here = there
    reached = np.flatnonzero(reachable_from(lattice.steps, *starts[0]))
    steps = lattice.steps.ravel()
    return walks_of(steps, offsets, reached, np.array(flat, np.int64), links, turn)


def check(walks, turn=0):
    """All that the walks tell of themselves holds, and each can be driven."""
    passed = np.zeros(walks.steps.size, np.bool_)
    visits = DEGREE[walks.links].sum(axis=0) // 2
    for robot, start in enumerate(walks.starts.tolist()):
        links = walks.links[robot]
        assert (DEGREE[links] % 2 == 0).all()
        walk = driven(links.copy(), walks.offsets, start, int(DEGREE[links].sum()) + 2)
        assert walk[0] == walk[-1] == start
        assert (len(walk) - 1) * 2 == DEGREE[links].sum()
        for here, there in pairwise(walk.tolist()):
            (direction,) = np.flatnonzero(walks.offsets == there - here)
            assert walks.steps[here] >> direction & 1
        has = np.zeros_like(passed)
        has[walk] = True
        passed |= has
        assert (has == (walks.sets >> robot & 1)).all()
        assert set(np.flatnonzero(links)) <= set(walk.tolist())
        cost = STEP // 2 * DEGREE[links].sum() + turn * TURNS[links].sum()
        assert walks.costs[robot] == cost
    assert passed[walks.cells].all()
    assert (visits == walks.visits).all()
    count = walks.spare_at[-1]
    assert set(walks.spare[:count].tolist()) == set(np.flatnonzero(visits > 1).tolist())


@given(data=st.data())
@examples(40, suppress_health_check=[HealthCheck.too_slow])
def test_walks_stay_connected_and_complete(data):
    free = free_cells(data)
    cells = ground(CoverageLattice.from_free(free).steps, free)
    if len(cells) < 2:
        return
    starts = data.draw(st.lists(st.sampled_from(cells), min_size=2, max_size=4, unique=True))
    turn, heat = data.draw(st.sampled_from([0, 80])), data.draw(st.sampled_from([0, 48, 400]))
    walks, stream = begun(free, starts, turn), stream_of(data.draw(st.integers(0, 9)))
    check(walks, turn)
    for weight in (1, 32, FULL):
        anneal(walks, turn, heat, heat, weight, 700, stream)
        check(walks, turn)


@pytest.mark.parametrize("seed", range(2))
def test_walks_on_a_map_stay_connected_and_complete(seed):
    """Larger parts, handed over where both robots pass the same cells."""
    free = np.random.default_rng(seed).random((30, 30)) > 0.12
    steps = CoverageLattice.from_free(free).steps
    starts = sorted(naive.distances(steps, tuple(np.argwhere(free)[40].tolist())))[100:104]
    walks, stream = begun(free, starts), stream_of(seed)
    for weight in (1, 8, 32, FULL):
        for _ in range(4):
            anneal(walks, 0, 190, 190, weight, 20_000, stream)
            check(walks)


def test_a_hall_is_shared_alike_with_hardly_a_step_too_many():
    walks = begun(np.ones((12, 20), np.bool_), [(0, 0), (0, 1), (11, 19)])
    anneal(walks, 0, 190, 48, FULL, 400_000, stream_of(1))
    check(walks)
    assert walks.costs.max() <= 82 * STEP
    assert walks.costs.sum() <= 244 * STEP


def test_the_same_numbers_give_the_same_walks():
    found = [begun(np.ones((9, 11), np.bool_), [(0, 0), (8, 10)]) for _ in range(2)]
    for walks in found:
        anneal(walks, 0, 190, 48, FULL, 20_000, stream_of(3))
    assert (found[0].links == found[1].links).all()


@pytest.mark.parametrize(("shape", "tour"), [((2, 3), [0, 1, 2, 1, 4, 3]), ((3, 1), [0, 1, 2, 1])])
def test_a_tour_becomes_steps_and_a_tour_again(shape, tour):
    steps = CoverageLattice.from_free(np.ones(shape, np.bool_)).steps
    offsets = np.array([1, shape[1], -1, -shape[1]], np.int64)
    links = np.zeros(steps.size, np.uint8)
    add_tour(steps.ravel(), offsets, links, np.array(tour, np.int32))
    assert DEGREE[links].sum() == 2 * len(tour)
    walk = driven(links.copy(), offsets, 0, 12)
    pairs = [
        Counter(frozenset(pair) for pair in pairwise(one)) for one in (walk.tolist(), [*tour, 0])
    ]
    assert pairs[0] == pairs[1]
