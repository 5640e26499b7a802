"""Ranges and counts of a noisy scanner's rays, against the slow twin of the ideal scanner's."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.raycast import Scanner
from tests.campaigns.lab.rays import count_rays, ranges_of
from tests.kernels.test_raycast import (
    FREE_AT_MOST,
    as_window,
    bounding_window,
    circle,
    naive_pixels,
    random_truth,
)
from tests.support.examples import examples


@examples(60)
@given(seed=st.integers(0, 1000), degrees=st.integers(-400, 400), reach=st.floats(0.1, 30))
def test_ranges_end_where_rays_stop(seed, degrees, reach):
    truth = random_truth(seed, (15, 20), 0.1)
    x, y = np.random.default_rng(seed).uniform(0, 15, 2).tolist()
    truth[int(y), int(x)] = 0
    directions = circle(24, math.radians(degrees) + 0.01)
    scanner = Scanner(x, y, reach, FREE_AT_MOST)
    none = np.zeros(truth.shape, bool)
    ways = ranges_of(truth, none, scanner, directions, np.ones(24, bool))
    for (dx, dy), way in zip(directions.tolist(), ways.tolist(), strict=True):
        seen = naive_pixels(x, y, dx, dy, reach, truth.shape)
        inside = [at for at in seen if 0 <= at[0] < 15 and 0 <= at[1] < 20]
        is_stopped = [not 0 <= truth[at] <= FREE_AT_MOST for at in inside]
        first = is_stopped.index(True) if any(is_stopped) else None
        returns = first is not None and truth[inside[first]] > 0
        assert (way > 0) == returns
        if returns:
            beyond = way + 1e-6
            assert (math.floor(y + beyond * dy), math.floor(x + beyond * dx)) == inside[first]
    # What is thin is gone by, by some.
    goes_by = np.arange(24) % 2 == 0
    by = ranges_of(truth, truth > FREE_AT_MOST, scanner, directions, goes_by)
    assert (by[goes_by] <= 0.0).all()
    assert np.array_equal(by[~goes_by], ways[~goes_by])


@examples(60)
@given(
    begin=st.tuples(st.floats(-2, 22), st.floats(-2, 17)),
    ends=st.lists(st.tuples(st.floats(-3, 23), st.floats(-3, 18)), min_size=1, max_size=8),
    seed=st.integers(0, 100),
)
def test_rays_are_counted_once_a_pixel_and_where_they_end(begin, ends, seed):
    hits, passes = np.zeros((15, 20), np.int32), np.zeros((15, 20), np.int32)
    is_hit = np.random.default_rng(seed).random(len(ends)) < 0.5
    points = np.array(ends, np.float64)
    window = count_rays(hits, passes, begin, points, is_hit, 1)
    assert as_window(window) == bounding_window(passes > 0)
    starts_inside = 0 <= begin[0] < 20 and 0 <= begin[1] < 15
    assert passes.any() == starts_inside
    if starts_inside:
        expected = np.zeros_like(hits)
        for (x, y), hit in zip(ends, is_hit.tolist(), strict=True):
            if hit and 0 <= x < 20 and 0 <= y < 15:
                expected[math.floor(y), math.floor(x)] += 1
        assert np.array_equal(hits, expected)
        assert passes.max() <= len(ends)
        assert passes[math.floor(begin[1]), math.floor(begin[0])] == len(ends)
    count_rays(hits, passes, begin, points, is_hit, -1)
    assert not hits.any()
    assert not passes.any()
