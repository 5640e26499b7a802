"""Runs that two walks have in common, against what a walk is changed to."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.floor.runs import AFTER, BACKWARD, BEFORE, STEPS, common_runs

MOVES = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)], np.int32)


def walk_of(seed: int, steps: int) -> np.ndarray:
    moves = MOVES[np.random.default_rng(seed).integers(0, 4, steps)]
    return np.concatenate([np.zeros((1, 2), np.int32), np.cumsum(moves, axis=0, dtype=np.int32)])


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.data())
def test_runs_have_the_same_cells_and_share_no_step(seed, steps, data):
    before = walk_of(seed, steps)
    # A part of it is turned round, and something else comes between.
    first = data.draw(st.integers(0, steps))
    last = data.draw(st.integers(first, steps))
    lost = data.draw(st.integers(0, 3))
    after = np.concatenate([before[:first], before[first : last + 1][::-1], before[last + lost :]])
    least = data.draw(st.integers(1, 5))
    runs = common_runs(before, after, least)
    taken, given_to = np.zeros(len(before), int), np.zeros(len(after), int)
    for run in runs:
        begin, origin, count = run[AFTER], run[BEFORE], run[STEPS]
        assert count >= least
        way = -1 if run[BACKWARD] else 1
        for step in range(count + 1):
            assert (after[begin + step] == before[origin + way * step]).all()
        taken[min(origin, origin + way * count) :][:count] += 1
        given_to[begin : begin + count] += 1
    assert taken.max(initial=0) <= 1
    assert given_to.max(initial=0) <= 1
    assert (np.diff(runs[:, AFTER]) > 0).all()


def test_a_walk_that_is_the_same_is_one_run():
    walk = walk_of(3, 40)
    assert common_runs(walk, walk, 8).tolist() == [[0, 0, 40, 0]]
    assert common_runs(walk, walk[::-1].copy(), 8).tolist() == [[0, 40, 40, 1]]


def test_walks_far_apart_have_nothing_in_common():
    """In memory for one of them, not for all that lies between."""
    walk = walk_of(5, 40)
    for place in ((0, 4_000_000), (-4_000_000, 4_000_000), (100, 0), (0, -100), (-100, 0)):
        assert not len(common_runs(walk, walk + np.array(place, np.int32), 1))
        assert not len(common_runs(walk + np.array(place, np.int32), walk, 1))
