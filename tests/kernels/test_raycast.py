"""The scanner's rays and the disc, against slow and obvious twins."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, disc_is_free, reveal_disc
from tests.support.examples import examples

FREE_AT_MOST = 25


def circle(rays, turn=0.0):
    angles = np.arange(rays) * (2 * np.pi / rays) + turn
    return np.column_stack((np.cos(angles), np.sin(angles)))


def naive_pixels(x, y, dx, dy, reach, shape):
    """All pixels of one ray in order: every border it crosses, sorted by distance."""
    size = max(shape) + 2
    first_row, first_col = math.floor(y), math.floor(x)
    crossings = []
    if dy != 0:
        borders = range(first_row + 1, size) if dy > 0 else range(first_row, -size, -1)
        crossings += [((border - y) / dy, 0, 1 if dy > 0 else -1) for border in borders]
    if dx != 0:
        borders = range(first_col + 1, size) if dx > 0 else range(first_col, -size, -1)
        crossings += [((border - x) / dx, 1, 1 if dx > 0 else -1) for border in borders]
    pixels = [(first_row, first_col)]
    for distance, axis, step in sorted(crossings):
        if distance > reach:
            break
        row, col = pixels[-1]
        pixels.append((row + step, col) if axis == 0 else (row, col + step))
    return pixels


def naive_cast(truth, known, scanner, directions):
    before = known.copy()
    for dx, dy in directions:
        for row, col in naive_pixels(scanner.x, scanner.y, dx, dy, scanner.reach, truth.shape):
            if not (0 <= row < truth.shape[0] and 0 <= col < truth.shape[1]):
                break
            known[row, col] = truth[row, col]
            if not 0 <= truth[row, col] <= scanner.free_at_most:
                break
    return bounding_window(known != before)


def bounding_window(changed):
    rows, cols = np.nonzero(changed)
    return (min(rows), min(cols), max(rows) + 1, max(cols) + 1) if len(rows) else None


def naive_touched(rows, cols, x, y, radius):
    """Which of the pixels have a point nearer than the radius."""
    touched = set()
    for row in rows:
        for col in cols:
            nearest_x, nearest_y = sorted((col, x, col + 1))[1], sorted((row, y, row + 1))[1]
            if (nearest_x - x) ** 2 + (nearest_y - y) ** 2 < radius**2:
                touched.add((row, col))
    return touched


def as_window(returned):
    return None if returned[0] > returned[2] else returned


def random_truth(seed, shape, blocked):
    draw = np.random.default_rng(seed)
    values = draw.choice([0, 25], size=shape)
    obstacles = draw.choice([26, 100, -1], size=shape)
    return np.where(draw.random(shape) < blocked, obstacles, values).astype(np.int8)


TRUTHS = {
    "empty": np.zeros((0, 0), np.int8),
    "one row": np.array([[0, 0, 0, 0, 100, 0, 0]], np.int8),
    "one column": np.array([[0, 0, 0, 0, -1, 0, 0]], np.int8).T.copy(),
    "all blocked": np.full((5, 6), 100, np.int8),
    "all free": np.zeros((9, 8), np.int8),
    "sparse": random_truth(1, (40, 30), 0.03),
    "dense": random_truth(2, (25, 41), 0.2),
}


@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize(("x", "y"), [(2.5, 0.5), (0.25, 3.7), (3.0, 4.0), (9.0, 9.5), (-1, 2)])
@pytest.mark.parametrize("reach", [0.2, 6.0, 100.0])
def test_rays_see_what_the_twin_sees(name, x, y, reach):
    truth = TRUTHS[name]
    known, expected = np.full_like(truth, -1), np.full_like(truth, -1)
    scanner = Scanner(x, y, reach, FREE_AT_MOST)
    # 64 rays from angle 0: the axes and the diagonals, through corners, are among them.
    window = cast_rays(truth, known, scanner, circle(64))
    assert as_window(window) == naive_cast(truth, expected, scanner, circle(64))
    assert np.array_equal(known, expected)


@examples(60)
@given(
    seed=st.integers(0, 1000),
    x=st.floats(0, 20),
    y=st.floats(0, 15),
    # Whole degrees: steps of 15 from there meet the axes and the diagonals.
    degrees=st.integers(-400, 400),
    reach=st.floats(0, 30),
)
def test_rays_from_anywhere_see_what_the_twin_sees(seed, x, y, degrees, reach):
    truth = random_truth(seed, (15, 20), 0.1)
    # Some of it is known before: the window speaks of what is new.
    known = np.where(np.random.default_rng(seed).random(truth.shape) < 0.3, truth, np.int8(-1))
    expected = known.copy()
    directions = circle(24, math.radians(degrees))
    scanner = Scanner(x, y, reach, FREE_AT_MOST)
    window = cast_rays(truth, known, scanner, directions)
    assert as_window(window) == naive_cast(truth, expected, scanner, directions)
    assert np.array_equal(known, expected)


def test_a_second_look_changes_nothing():
    truth = random_truth(3, (30, 30), 0.05)
    known = np.full_like(truth, -1)
    scanner = Scanner(14.2, 15.9, 12.0, FREE_AT_MOST)
    assert as_window(cast_rays(truth, known, scanner, circle(90))) is not None
    assert as_window(cast_rays(truth, known, scanner, circle(90))) is None


def test_no_ray_slips_between_pixels_that_touch_by_a_corner():
    truth = np.zeros((9, 9), np.int8)
    truth[np.arange(9), 8 - np.arange(9)] = 100
    known = np.full_like(truth, -1)
    cast_rays(truth, known, Scanner(1.0, 1.0, 50.0, FREE_AT_MOST), circle(360))
    behind = np.add.outer(np.arange(9), np.arange(9)) > 8
    assert (known[behind] == -1).all()
    assert (known[~behind & (truth == 0)] == 0).all()


def off_the_grid(thousandths):
    """Return a number that lies on no pixel's edge: there the last bit decides."""
    return thousandths / 1000 + 1e-5


@examples(100)
@given(
    seed=st.integers(0, 1000),
    x=st.integers(-2000, 14000).map(off_the_grid),
    y=st.integers(-2000, 10000).map(off_the_grid),
    radius=st.integers(10, 5000).map(lambda thousandths: thousandths / 1000),
)
def test_the_disc_against_its_twin(seed, x, y, radius):
    truth = random_truth(seed, (8, 12), 0.05)
    known = np.full_like(truth, -1)
    expected = known.copy()
    free = True
    for row, col in naive_touched(range(-8, 17), range(-8, 21), x, y, radius):
        inside = 0 <= row < 8 and 0 <= col < 12
        free = free and inside and 0 <= truth[row, col] <= FREE_AT_MOST
        if inside:
            expected[row, col] = truth[row, col]
    window = reveal_disc(truth, known, x, y, radius)
    assert np.array_equal(known, expected)
    assert as_window(window) == bounding_window(expected != -1)
    assert disc_is_free(truth, x, y, radius, FREE_AT_MOST) == free


def test_a_disc_flush_with_a_wall_is_free():
    truth = np.zeros((10, 10), np.int8)
    truth[:, 7:] = 100
    assert disc_is_free(truth, 4.0, 5.0, 3.0, FREE_AT_MOST)
    assert not disc_is_free(truth, 4.0, 5.0, 3.001, FREE_AT_MOST)
