"""Floor kernels against slow references that look at every pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.floor import bits, capsule, seconds, sweeps
from fasaco_edge.kernels.floor.bits import packed, spread, unpacked
from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.floor.line import MOST_CAPSULES
from fasaco_edge.kernels.floor.places import connected, disc_rows, places_of, within
from fasaco_edge.kernels.floor.sweeps import COLUMNS, NEVER, Scratch, Sweeps
from tests.support.examples import examples
from tests.support.inner import entry

any_between = entry(bits.any_between)
is_marked = entry(bits.is_marked)
is_clear_but = entry(capsule.is_clear_but)
is_near = entry(capsule.is_near)
turn_between = entry(seconds.turn_between)
exchange = entry(sweeps.exchange)
prepare = entry(sweeps.prepare)
sweep = entry(sweeps.sweep)
swept_more = entry(sweeps.swept_more)

SIDE = 40
COORDINATES = st.floats(8.0, 31.0)
POINTS = st.tuples(COORDINATES, COORDINATES) | st.tuples(st.integers(8, 31), st.integers(8, 31))
# A robot beside its map is beside the raster, too.
ANYWHERE = st.floats(-30.0, SIDE + 30.0)
SEGMENT = st.tuples(POINTS, POINTS) | st.tuples(*[st.tuples(ANYWHERE, ANYWHERE)] * 2)
SEGMENTS = st.lists(SEGMENT, min_size=1, max_size=4)


def scratch() -> Scratch:
    rows = (np.zeros((MOST_CAPSULES, 2), np.int64) for _ in range(2))
    return Scratch(np.zeros((MOST_CAPSULES, len(COLUMNS))), *rows)


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


def bits_of(blocked: np.ndarray) -> np.ndarray:
    return packed(blocked, beyond=True)


@given(POINTS, POINTS, st.integers(0, SIDE - 1), st.integers(0, SIDE - 1), st.floats(1.0, 7.5))
def test_a_way_is_clear_of_a_pixel_that_is_a_radius_away(a, b, i, j, radius):
    blocked = np.zeros((SIDE, SIDE), np.bool_)
    blocked[i, j] = True
    away = square_distance(a, b, i, j)
    if abs(away - radius) > 0.02:
        way = *map(float, (*a, *b)), radius
        blocker, is_far = np.full(2, -99), away > radius
        assert is_clear(bits_of(blocked), *way) == is_far
        assert is_clear_but(bits_of(blocked), *way, blocker) == is_far
        assert blocker.tolist() == ([-99, -99] if is_far else [i, j])
        assert not (is_far and is_near(float(i), float(j), *way))


def test_a_wall_as_far_as_the_radius_is_not_touched():
    blocked = np.zeros((SIDE, SIDE), np.bool_)
    blocked[:, 25] = True
    assert is_clear(bits_of(blocked), 10.0, 17.5, 30.0, 17.5, 7.0)
    assert not is_clear(bits_of(blocked), 10.0, 17.6, 30.0, 17.6, 7.0)


def test_floor_outside_the_raster_is_blocked():
    table = bits_of(np.zeros((SIDE, SIDE), np.bool_))
    assert is_clear(table, 10.0, 10.0, 10.0, 32.0, 7.0)
    assert not is_clear(table, 10.0, 10.0, 10.0, 33.0, 7.0)


@given(SEGMENTS, st.floats(0.5, 7.0))
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


@examples(300)
@given(SEGMENTS, SEGMENTS, SEGMENTS, st.floats(0.5, 7.0))
def test_the_predicted_gain_equals_the_counted_one(before, after, others, radius):
    counts = np.zeros((SIDE, SIDE), np.int16)
    counts[:, 20:24] = NEVER
    sweeps = Sweeps(counts, np.zeros((SIDE // 8, SIDE // 8), np.int32))
    for a, b in (*before, *others):
        sweep(sweeps, *map(float, (*a, *b)), radius, 1, scratch())
    memory, was = scratch(), counts.copy()
    for number, (a, b) in enumerate((*before, *after)):
        prepare(memory.capsules, number, *map(float, (*a, *b)), radius)
    more = swept_more(counts, memory, len(before), len(after), radius, np.inf)
    assert (counts == was).all()
    # Once more is lost than may be, the rest is not looked at.
    least = swept_more(counts, memory, len(before), len(after), radius, 5.0)
    assert least == more or least < -5
    exchange(sweeps, memory, len(before), len(after), radius)
    exchanged = counts.copy()
    counts[:] = was
    for a, b in before:
        sweep(sweeps, *map(float, (*a, *b)), radius, -1, scratch())
    for a, b in after:
        sweep(sweeps, *map(float, (*a, *b)), radius, 1, scratch())
    assert more == np.count_nonzero(was == 0) - np.count_nonzero(counts == 0)
    assert (exchanged == counts).all()


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
    found = unpacked(within(packed(marked, beyond=False), radius), SIDE)
    assert (found == expected)[~near].all()


@given(st.floats(0.6, 12.0) | st.integers(1, 24).map(lambda halves: halves / 2), st.randoms())
@examples(60)
def test_a_place_is_where_a_way_of_no_length_is_clear(radius, random):
    blocked = np.zeros((SIDE, SIDE), np.bool_)
    for _ in range(6):
        blocked[random.randrange(SIDE), random.randrange(SIDE)] = True
    rim = disc_rows(radius)[0] + 1
    blocked[:rim] = blocked[-rim:] = blocked[:, :rim] = blocked[:, -rim:] = True
    table = bits_of(blocked)
    places = unpacked(places_of(table, disc_rows(radius)), SIDE)
    for i, j in np.ndindex(places.shape):
        y, x = float(i), float(j)
        assert places[i, j] == is_clear(table, y, x, y, x, radius)


def test_places_are_where_the_disc_fits_and_connect_if_reachable():
    free = np.zeros((SIDE, SIDE), np.bool_)
    free[3:37, 3:18] = free[3:37, 22:37] = True
    free[10:13, 18:22] = True  # a door, too narrow
    places = unpacked(places_of(bits_of(~free), disc_rows(4.0)), SIDE)
    assert places[7:33, 7:14].all()
    assert places[7:33, 26:33].all()
    assert np.count_nonzero(places) == 2 * 26 * 7
    one_side = connected(places, 8, 8)
    assert np.count_nonzero(one_side) == 26 * 7
    assert one_side[20, 10]


@given(st.integers(1, 200), st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_bits_are_what_was_packed(cols, seed, share):
    mask = np.random.default_rng(seed).random((3, cols)) < share
    for beyond in (False, True):
        bits = packed(mask, beyond=beyond)
        assert (unpacked(bits, cols) == mask).all()
        assert (unpacked(bits, 64 * bits.shape[1])[:, cols:] == beyond).all()
    first = seed % cols
    last = first + seed // 7 % (cols - first)
    assert any_between(bits[1], first, last) == mask[1, first : last + 1].any()
    assert is_marked(bits, 2, last) == mask[2, last]


@given(st.integers(1, 150), st.integers(0, 2**32 - 1), st.floats(0.5, 9.0))
@examples(40)
def test_bits_spread_as_far_as_a_disc(cols, seed, radius):
    mask = np.random.default_rng(seed).random((24, cols)) < 0.02
    reach = disc_rows(radius)
    expected = np.zeros_like(mask)
    for i, j in np.argwhere(mask):
        for away, half in enumerate(reach):
            for row in {i - away, i + away} & set(range(24)):
                expected[row, max(j - half, 0) : j + half + 1] = True
    assert (unpacked(spread(packed(mask, beyond=False), reach), cols) == expected).all()
