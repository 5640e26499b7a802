"""Floor that is still to sweep, against a slow count."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.floor.open_floor import (
    CAUSE,
    CAUSE_SHIFT,
    OPEN,
    PASSED,
    SWEPT,
    WANTED,
    pass_line,
    set_causes,
    set_open,
)
from fasaco_edge.kernels.floor.sweeps import NEVER, Sweeps
from tests.kernels.test_floor import SIDE, distances, scratch
from tests.support.examples import examples

# The way may begin and end outside of the raster.
POINTS = st.lists(st.tuples(*[st.floats(-6.0, SIDE + 6.0)] * 2), min_size=2, max_size=4)


@given(POINTS, st.floats(0.6, 7.0), st.integers(0, 2**32 - 1))
@examples(60)
def test_floor_passed_by_the_line_is_neither_open_nor_swept(points, radius, seed):
    rng = np.random.default_rng(seed)
    before = rng.random((SIDE, SIDE)) < 0.7
    counts = np.where(before, rng.integers(0, 3, before.shape), NEVER).astype(np.int16)
    expected_counts, blocks = counts.copy(), left_of(counts)
    state = np.where(before, WANTED | OPEN, WANTED).astype(np.uint8)
    sweeps = Sweeps(counts, blocks)
    closed = pass_line(sweeps, state, np.array(points), radius, scratch())
    still_open, passed = (state & OPEN) > 0, (state & PASSED) > 0
    assert (state & (WANTED | SWEPT) == WANTED).all()
    over, near = np.zeros_like(passed), np.zeros_like(passed)
    for a, b in pairwise(points):
        away = distances(a, b)
        over |= away <= radius
        near |= abs(away - radius) < 1e-6
    assert (passed == over)[~near].all()
    assert (still_open == (before & ~passed)).all()
    assert closed == np.count_nonzero(before & passed)
    expected_counts[before & passed] += NEVER
    assert (counts == expected_counts).all()
    assert (blocks == left_of(counts)).all()


def left_of(counts):
    return (counts == 0).reshape(SIDE // 8, 8, SIDE // 8, 8).sum(axis=(1, 3)).astype(np.int32)


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.integers(0, SIDE - 9)] * 2),
    st.booleans(),
    st.floats(0.0, 1.0),
)
@examples(60)
def test_open_floor_is_wanted_unswept_and_two_pixels_wide(seed, corner, is_asked, share):
    rng = np.random.default_rng(seed)
    flags = WANTED * (rng.random((SIDE, SIDE)) < 0.8) | SWEPT * (rng.random((SIDE, SIDE)) < share)
    passed = rng.random(flags.shape) < 0.1
    was_open = wide(flags & (WANTED | SWEPT) == WANTED) & ~passed
    state = (
        flags | OPEN * was_open | PASSED * passed | rng.integers(0, 4, flags.shape) << CAUSE_SHIFT
    ).astype(np.uint8)
    swept_times = rng.integers(0, 3, state.shape)
    counts = np.where(was_open, swept_times, swept_times + NEVER).astype(np.int16)
    sweeps, before = Sweeps(counts, left_of(counts)), state.copy()
    rows, cols = rng.integers(1, SIDE + 1 - np.array(corner))
    part = np.s_[corner[0] : corner[0] + rows, corner[1] : corner[1] + cols]
    wanted, swept = rng.random((rows, cols)) < 0.8, rng.random((rows, cols)) < share
    told = wanted if is_asked else np.zeros((0, 0), bool)
    more = set_open(sweeps, state, corner, told, swept)
    expected_wanted, expected_swept = (before & WANTED) > 0, (before & SWEPT) > 0
    if is_asked:
        expected_wanted[part] = wanted
    expected_swept[part] = swept
    expected_open = wide(expected_wanted & ~expected_swept) & ~passed
    assert (((state & WANTED) > 0) == expected_wanted).all()
    assert (((state & SWEPT) > 0) == expected_swept).all()
    assert (((state & OPEN) > 0) == expected_open).all()
    assert ((state & (CAUSE | PASSED)) == (before & (CAUSE | PASSED))).all()
    assert (counts == np.where(expected_open, swept_times, swept_times + NEVER)).all()
    assert (sweeps.left == left_of(counts)).all()
    both = WANTED | SWEPT
    assert more == (
        np.count_nonzero(expected_wanted) - np.count_nonzero(before & WANTED),
        np.count_nonzero(expected_wanted & expected_swept)
        - np.count_nonzero(before & both == both),
        np.count_nonzero(expected_open) - np.count_nonzero(was_open),
    )


def wide(mask):
    """Which pixels are one of two by two marked ones."""
    found = np.zeros_like(mask)
    for row, col in np.argwhere(mask[:-1, :-1] & mask[:-1, 1:] & mask[1:, :-1] & mask[1:, 1:]):
        found[row : row + 2, col : col + 2] = True
    return found


def test_pixels_are_counted_by_what_keeps_them_out_of_reach():
    rng = np.random.default_rng(1)
    state = rng.integers(0, 32, (SIDE, SIDE), np.uint8)
    before, causes = state.copy(), rng.integers(0, 4, (9, 11), np.uint8)
    pixels = np.bincount((state & CAUSE).ravel() >> CAUSE_SHIFT, minlength=4)
    set_causes(state, (5, 7), causes, pixels)
    now = (state & CAUSE) >> CAUSE_SHIFT
    assert (now[5:14, 7:18] == causes).all()
    now[5:14, 7:18] = ((before & CAUSE) >> CAUSE_SHIFT)[5:14, 7:18]
    assert (now == (before & CAUSE) >> CAUSE_SHIFT).all()
    assert ((state & ~np.uint8(CAUSE)) == (before & ~np.uint8(CAUSE))).all()
    assert (pixels == np.bincount((state & CAUSE).ravel() >> CAUSE_SHIFT, minlength=4)).all()
