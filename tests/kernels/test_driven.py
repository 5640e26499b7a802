"""Floor that was driven over, against a slow count."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.kernels.floor.capsule import NEVER, Sweeps
from fasaco_edge.kernels.floor.driven import DRIVEN, OPEN, WANTED, note_driven
from tests.kernels.test_floor import SIDE, distances, scratch

# The way may begin and end outside of the raster.
POINTS = st.lists(st.tuples(*[st.floats(-6.0, SIDE + 6.0)] * 2), min_size=2, max_size=4)


@given(POINTS, st.floats(0.6, 7.0), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_what_was_driven_over_is_no_longer_open(points, radius, seed):
    rng = np.random.default_rng(seed)
    still_open = rng.random((SIDE, SIDE)) < 0.7
    before = still_open.copy()
    counts = np.where(still_open, rng.integers(0, 3, still_open.shape), NEVER).astype(np.int16)
    expected_counts = counts.copy()
    blocks = (counts == 0).reshape(SIDE // 8, 8, SIDE // 8, 8).sum(axis=(1, 3)).astype(np.int32)
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
    left = (counts == 0).reshape(SIDE // 8, 8, SIDE // 8, 8).sum(axis=(1, 3))
    assert (blocks == left).all()
