"""Reachability and shortest walks against a ring-by-ring twin."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk
from tests import naive
from tests.support.examples import examples
from tests.support.grids import ROOMS, free, lattice, problems


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


@pytest.mark.parametrize("room", ROOMS)
def test_a_walk_to_where_one_stands_is_that_cell(room):
    ground, start = ROOMS[room]
    assert shortest_walk(ground.steps, start, start).tolist() == [list(start)]


def test_no_walk_leads_through_a_wall():
    ground = lattice("..#..", "..#..")
    assert shortest_walk(ground.steps, (0, 0), (0, 4)).shape == (0, 2)
    assert reachable_from(ground.steps, 0, 0).tolist() == [[1, 1, 0, 0, 0]] * 2


def test_a_blocked_cell_reaches_itself_alone():
    ground = lattice("###")
    assert reachable_from(ground.steps, 0, 1).tolist() == [[0, 1, 0]]


def test_the_last_line_of_a_drawn_grid_is_row_0():
    assert free("#.", "..").tolist() == [[True, True], [False, True]]
