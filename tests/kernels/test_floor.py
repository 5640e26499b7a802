"""Floor kernels against slow references that look at every pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.kernels.floor.capsule import (
    MOST_CAPSULES,
    NEVER,
    Scratch,
    Sweeps,
    is_clear,
    prepare,
    sweep,
    swept_more,
)
from fasaco_edge.kernels.floor.line import turn_between
from fasaco_edge.kernels.floor.places import connected, find_places, within

SIDE = 40
COORDINATES = st.floats(8.0, 31.0)
POINTS = st.tuples(COORDINATES, COORDINATES) | st.tuples(st.integers(8, 31), st.integers(8, 31))


def scratch() -> Scratch:
    rows = (np.zeros((MOST_CAPSULES, 2), np.int64) for _ in range(2))
    return Scratch(np.zeros((MOST_CAPSULES, 8)), *rows)


def distances(a: tuple[float, float], b: tuple[float, float]) -> np.ndarray:
    """Return the distance of each pixel's centre from a segment, (SIDE, SIDE)."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(float)
    dy, dx = b[0] - a[0], b[1] - a[1]
    square = dy * dy + dx * dx
    along = ((y - a[0]) * dy + (x - a[1]) * dx) / square if square > 1e-18 else np.zeros_like(y)
    along = np.clip(along, 0.0, 1.0)
    return np.hypot(y - a[0] - along * dy, x - a[1] - along * dx)


def square_distance(a: tuple[float, float], b: tuple[float, float], i: int, j: int) -> float:
    """Return about the distance of a segment from a pixel's square, from many of its points."""
    steps = np.linspace(0.0, 1.0, 2001)
    y, x = a[0] + steps * (b[0] - a[0]), a[1] + steps * (b[1] - a[1])
    return float(np.hypot(np.maximum(abs(y - i) - 0.5, 0), np.maximum(abs(x - j) - 0.5, 0)).min())


def sums(blocked: np.ndarray) -> np.ndarray:
    rows, cols = blocked.shape
    table = np.zeros((rows, cols + 1), np.int32)
    np.cumsum(blocked, axis=1, out=table[:, 1:])
    return table


@given(POINTS, POINTS, st.integers(0, SIDE - 1), st.integers(0, SIDE - 1), st.floats(1.0, 7.5))
def test_a_way_is_clear_of_a_pixel_that_is_a_radius_away(a, b, i, j, radius):
    blocked = np.zeros((SIDE, SIDE), np.bool_)
    blocked[i, j] = True
    away = square_distance(a, b, i, j)
    if abs(away - radius) > 0.02:
        assert is_clear(sums(blocked), *map(float, (*a, *b)), radius) == (away > radius)


def test_a_wall_as_far_as_the_radius_is_not_touched():
    blocked = np.zeros((SIDE, SIDE), np.bool_)
    blocked[:, 25] = True
    assert is_clear(sums(blocked), 10.0, 17.5, 30.0, 17.5, 7.0)
    assert not is_clear(sums(blocked), 10.0, 17.6, 30.0, 17.6, 7.0)


def test_what_lies_outside_is_blocked():
    free = np.zeros((SIDE, SIDE), np.int32)
    table = np.concatenate([free, free[:, :1]], axis=1)
    assert is_clear(table, 10.0, 10.0, 10.0, 32.0, 7.0)
    assert not is_clear(table, 10.0, 10.0, 10.0, 33.0, 7.0)


@given(st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=5), st.floats(0.5, 7.0))
def test_sweeps_are_counted_and_taken_back(segments, radius):
    counts = np.zeros((SIDE, SIDE), np.int16)
    sweeps = Sweeps(counts, np.full((SIDE // 8, SIDE // 8), 64, np.int32))
    expected, is_near = np.zeros((SIDE, SIDE), int), np.zeros((SIDE, SIDE), np.bool_)
    for a, b in segments:
        away = distances(a, b)
        expected += away <= radius
        # On the rim a rounding decides.
        is_near |= abs(away - radius) < 1e-5
        sweep(sweeps, *map(float, (*a, *b)), radius, 1, scratch())
    assert (counts == expected)[~is_near].all()
    left = (counts == 0).reshape(SIDE // 8, 8, SIDE // 8, 8).sum(axis=(1, 3))
    assert (sweeps.left == left).all()
    for a, b in segments:
        sweep(sweeps, *map(float, (*a, *b)), radius, -1, scratch())
    assert not counts.any()
    assert (sweeps.left == 64).all()


SEGMENTS = st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=4)


@settings(max_examples=300)
@given(SEGMENTS, SEGMENTS, SEGMENTS, st.floats(0.5, 7.0))
def test_what_a_change_sweeps_more_is_what_sweeping_it_shows(before, after, others, radius):
    counts = np.zeros((SIDE, SIDE), np.int16)
    counts[:, 20:24] = NEVER
    sweeps = Sweeps(counts, np.zeros((SIDE // 8, SIDE // 8), np.int32))
    for a, b in (*before, *others):
        sweep(sweeps, *map(float, (*a, *b)), radius, 1, scratch())
    memory, was = scratch(), counts.copy()
    for number, (a, b) in enumerate((*before, *after)):
        prepare(memory.capsules, number, *map(float, (*a, *b)), radius)
    more = swept_more(counts, memory, len(before), len(after), radius)
    assert (counts == was).all()
    for a, b in before:
        sweep(sweeps, *map(float, (*a, *b)), radius, -1, scratch())
    for a, b in after:
        sweep(sweeps, *map(float, (*a, *b)), radius, 1, scratch())
    assert more == np.count_nonzero(was == 0) - np.count_nonzero(counts == 0)


@given(st.floats(0.0, 2 * math.pi), st.floats(-math.pi, math.pi))
def test_a_turn_is_the_angle_between_two_directions(heading, turn):
    after = heading + turn
    u, v = (math.sin(heading), math.cos(heading)), (math.sin(after), math.cos(after))
    assert turn_between(*u, *v) == pytest.approx(abs(turn), abs=2e-5)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6.0))
def test_pixels_within_reach_of_marked_ones(seed, radius):
    marked = np.random.default_rng(seed).random((SIDE, SIDE)) < 0.01
    expected, near = np.zeros_like(marked), np.zeros_like(marked)
    for i, j in np.argwhere(marked):
        away = distances((i, j), (i, j))
        expected |= away <= radius
        near |= abs(away - radius) < 1e-3
    assert (within(marked, radius) == expected)[~near].all()


def test_places_are_where_the_disc_fits_and_connected_ones_can_be_come_to():
    free = np.zeros((SIDE, SIDE), np.bool_)
    free[3:37, 3:18] = free[3:37, 22:37] = True
    free[10:13, 18:22] = True  # a door, too narrow
    places = np.zeros_like(free)
    find_places(sums(~free), 4.0, places)
    assert places[7:33, 7:14].all()
    assert places[7:33, 26:33].all()
    assert np.count_nonzero(places) == 2 * 26 * 7
    one_side = connected(places, 8, 8)
    assert np.count_nonzero(one_side) == 26 * 7
    assert one_side[20, 10]
