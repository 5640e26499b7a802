"""Floor that was driven over, against a slow count."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.floor.driven import (
    CAUSE,
    CAUSE_SHIFT,
    DRIVEN,
    OPEN,
    WANTED,
    note_driven,
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
def test_what_was_driven_over_is_no_longer_open(points, radius, seed):
    rng = np.random.default_rng(seed)
    still_open = rng.random((SIDE, SIDE)) < 0.7
    before = still_open.copy()
    counts = np.where(still_open, rng.integers(0, 3, still_open.shape), NEVER).astype(np.int16)
    expected_counts = counts.copy()
    blocks = left_of(counts)
    state = np.where(still_open, WANTED | OPEN, WANTED).astype(np.uint8)
    sweeps = Sweeps(counts, blocks)
    closed = note_driven(sweeps, state, np.array(points), radius, scratch())
    still_open, driven = (state & OPEN) > 0, (state & DRIVEN) > 0
    assert (state & WANTED).all()
    over, near = np.zeros_like(driven), np.zeros_like(driven)
    for a, b in pairwise(points):
        away = distances(a, b)
        over |= away <= radius
        near |= abs(away - radius) < 1e-6
    assert (driven == over)[~near].all()
    assert (still_open == (before & ~driven)).all()
    assert closed == np.count_nonzero(before & driven)
    expected_counts[before & driven] += NEVER
    assert (counts == expected_counts).all()
    assert (blocks == left_of(counts)).all()


def left_of(counts):
    return (counts == 0).reshape(SIDE // 8, 8, SIDE // 8, 8).sum(axis=(1, 3)).astype(np.int32)


@given(st.integers(0, 2**32 - 1), st.tuples(*[st.integers(0, SIDE - 9)] * 2), st.booleans())
@examples(60)
def test_what_is_open_is_asked_for_and_neither_swept_nor_driven_over(seed, corner, is_asked):
    rng = np.random.default_rng(seed)
    state = rng.integers(0, 8, (SIDE, SIDE), np.uint8) | rng.integers(0, 4, (SIDE, SIDE)) << 3
    state = state.astype(np.uint8)
    was_open = (state & OPEN) > 0
    swept_times = rng.integers(0, 3, state.shape)
    counts = np.where(was_open, swept_times, swept_times + NEVER).astype(np.int16)
    sweeps, before = Sweeps(counts, left_of(counts)), state.copy()
    rows, cols = rng.integers(1, SIDE - np.array(corner))
    part = np.s_[corner[0] : corner[0] + rows, corner[1] : corner[1] + cols]
    wanted, swept = rng.random((2, rows, cols)) < 0.5
    told = wanted if is_asked else np.zeros((0, 0), bool)
    more = set_open(sweeps, state, corner, told, swept)
    expected_wanted, expected_open = (before & WANTED) > 0, was_open.copy()
    if is_asked:
        expected_wanted[part] = wanted
    expected_open[part] = (expected_wanted & ((before & DRIVEN) == 0))[part] & ~swept
    assert (((state & WANTED) > 0) == expected_wanted).all()
    assert (((state & OPEN) > 0) == expected_open).all()
    kept = 255 - WANTED - OPEN
    assert ((state & kept) == (before & kept)).all(), "what is driven, and the cause"
    assert (counts == np.where(expected_open, swept_times, swept_times + NEVER)).all()
    assert (sweeps.left == left_of(counts)).all()
    was_wanted = np.count_nonzero(before & WANTED)
    assert more == (
        np.count_nonzero(expected_wanted) - was_wanted,
        np.count_nonzero(expected_open) - np.count_nonzero(was_open),
    )


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
