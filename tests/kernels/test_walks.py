"""Reachability and shortest walks against a ring-by-ring twin."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk
from tests import naive
from tests.support.examples import examples
from tests.support.grids import problems


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
