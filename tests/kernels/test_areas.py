"""Connected areas against a flood, cell by cell."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk
from tests import naive
from tests.support.examples import examples
from tests.support.grids import problems

SHAPES = [(0, 0), (1, 1), (1, 9), (9, 1), (0, 5), (5, 0)]


def assert_agrees(kinds):
    areas, expected = find_areas(kinds), naive.areas(kinds)
    assert areas.labels.shape == kinds.shape
    found = [
        (int(kind), frozenset(map(tuple, np.argwhere(areas.labels == number + 1).tolist())))
        for number, kind in enumerate(areas.kinds)
    ]
    assert found == expected
    assert areas.cells.tolist() == [len(cells) for _, cells in expected]
    inner = list(map(tuple, areas.inner.tolist()))
    assert inner == [naive.inner_cell(cells) for _, cells in expected]
    allowed = kinds == 0
    beside = list(map(tuple, cells_beside(areas, allowed).tolist()))
    free = set(map(tuple, np.argwhere(allowed).tolist()))
    assert beside == [naive.cell_beside(cells, free) for _, cells in expected]


@examples(200)
@given(st.integers(0, 9), st.integers(0, 9), st.integers(0, 2**32), st.integers(2, 4))
def test_areas_are_those_a_flood_finds(rows, cols, seed, kinds):
    grid = np.random.default_rng(seed).integers(0, kinds, (rows, cols)).astype(np.uint8)
    assert_agrees(grid)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("value", [0, 1, 5])
def test_areas_of_small_and_uniform_grids(shape, value):
    assert_agrees(np.full(shape, value, np.uint8))


def test_a_hundred_thousand_chambers_are_distinguished():
    side = 640
    grid = np.zeros((side, side), np.uint8)
    grid[::2, ::2] = 1
    areas = find_areas(grid)
    assert len(areas.cells) == (side // 2) ** 2
    assert (areas.cells == 1).all()


# Reachability and shortest walks against a ring-by-ring twin.


def assert_legal(steps, walk):
    around = naive.neighbours(steps)
    for here, there in itertools.pairwise(walk):
        assert tuple(there) in around[tuple(here)].values()


@examples(100)
@given(ground=problems(), goal=st.integers(0, 80))
def test_twin_reaches_the_same_cells_in_as_many_steps(ground, goal):
    lattice, start = ground
    steps, start = lattice.steps, lattice.local(start)
    away = naive.distances(steps, start)
    reached = {tuple(cell) for cell in np.argwhere(reachable_from(steps, *start)).tolist()}
    assert reached == set(away)
    goal = divmod(goal % steps.size, steps.shape[1])
    walk = shortest_walk(steps, start, goal)
    assert walk.dtype == np.int32
    if goal not in away:
        assert walk.shape == (0, 2)
        return
    assert len(walk) - 1 == away[goal]
    assert (tuple(walk[0]), tuple(walk[-1])) == (start, goal)
    assert_legal(steps, walk.tolist())
