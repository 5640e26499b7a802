"""The living trail against its rules written out cell by cell."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.planners.living_trail import (
    LivingTrail,
    TrailRules,
    branching,
    directions,
    mean_into,
    strongest_into,
)
from tests.support.examples import examples

ALPHA, TAU0 = np.float32(0.25), np.float32(0.125)
RULES = TrailRules(alpha=0.25, tau0=0.125)
HALF, ONE = np.float32(0.5), np.float32(1)


def steps_of(free):
    """Step masks where cells are free, bool (rows, cols)."""
    return CoverageLattice.from_free(free).steps


def lattice(seed, rows=7, cols=6):
    """Step masks of a random lattice, (rows, cols)."""
    free = np.random.default_rng(seed).random((rows, cols)) < 0.7
    return steps_of(free)


def walk(seed, steps, window, length=40):
    """A walk by legal steps, int32 (n, 2); its first cell may have none."""
    rng = np.random.default_rng(seed)
    row, col = (int(rng.integers(size)) for size in steps.shape)
    cells = [(row, col)]
    for _ in range(length):
        ways = [way for way in range(4) if steps[row, col] >> way & 1]
        if not ways:
            break
        way = ways[rng.integers(len(ways))]
        row, col = row + ROW_STEP[way], col + COL_STEP[way]
        cells.append((row, col))
    return np.array(cells, np.int32) + np.array((window.row0, window.col0), np.int32)


class Naive:
    """A trail as a table: pheromone by (row, col, direction)."""

    def __init__(self):
        self.tau = {}

    def follow(self, window, steps, changed):
        legal = {
            (row + window.row0, col + window.col0, way)
            for row, col in np.ndindex(steps.shape)
            for way in range(4)
            if steps[row, col] >> way & 1
        }
        kept = {key: tau for key, tau in self.tau.items() if key in legal}
        faded = {key: pull(tau, ALPHA, TAU0) for key, tau in kept.items() if key[:2] in changed}
        self.tau = dict.fromkeys(legal, TAU0) | kept | faded

    def moves(self, cells):
        for (row, col), (to_row, to_col) in pairwise(cells):
            for way in range(4):
                if (row + ROW_STEP[way], col + COL_STEP[way]) == (to_row, to_col):
                    yield row, col, way

    def strengthen(self, cells, amount):
        moves = set(self.moves(cells))
        on_path = {move[:2] for move in moves}
        for key in list(self.tau):
            if key in moves:
                self.tau[key] = pull(self.tau[key], ALPHA, np.float32(amount))
            elif key[:2] in on_path:
                self.tau[key] = pull(self.tau[key], ALPHA, TAU0)

    def fade(self, cells):
        for move in set(self.moves(cells)):
            self.tau[move] = pull(self.tau[move], HALF, TAU0)


def pull(tau, weight, towards):
    return (ONE - weight) * tau + weight * towards


def table(trail):
    held = trail.snapshot()
    return {
        (row + held.window.row0, col + held.window.col0, way): held.tau[row, col, way]
        for row, col, way in np.argwhere(held.tau > 0).tolist()
    }


@examples(60)
@given(st.integers(0, 10**6), st.lists(st.sampled_from(["map", "path", "drive"]), max_size=12))
def test_it_is_what_the_rules_say(seed, events):
    trail, twin, window = LivingTrail(RULES), Naive(), Window(-3, 4, 4, 10)
    steps = lattice(seed)
    trail.follow(window, steps, None)
    twin.follow(window, steps, ())
    for number, event in enumerate(events, seed):
        if event == "map":
            before, grown = (window, steps), number % 2
            steps = lattice(number, rows=7 + grown)
            window = Window(window.row0 - grown, window.col0, window.row1, window.col1)
            if steps.shape[0] != window.rows:
                steps = lattice(number, rows=window.rows)
            changed = [
                (row + window.row0, col + window.col0)
                for row, col in np.ndindex(steps.shape)
                if at(before, row + window.row0, col + window.col0) != steps[row, col]
            ]
            trail.follow(window, steps, np.array(changed, np.int32).reshape(-1, 2))
            twin.follow(window, steps, set(changed))
        else:
            cells = walk(number, steps, window)
            told = [tuple(cell) for cell in cells.tolist()]
            if event == "path":
                trail.strengthen(cells, 0.75)
                twin.strengthen(told, 0.75)
            else:
                trail.fade(cells)
                twin.fade(told)
    assert table(trail) == twin.tau


def at(before, row, col):
    window, steps = before
    inside = window.row0 <= row < window.row1 and window.col0 <= col < window.col1
    return steps[row - window.row0, col - window.col0] if inside else 0


def row_of(length):
    """Step masks of a row of cells."""
    return steps_of(np.ones((1, length), bool))


def ready(length=4):
    trail = LivingTrail(RULES)
    trail.follow(Window(0, 0, 1, length), row_of(length), None)
    return trail


EASTWARD = np.array([(0, 0), (0, 1), (0, 2), (0, 3)], np.int32)


def test_a_path_that_comes_again_and_again_stands_out():
    trail = ready()
    assert branching(trail.snapshot().tau) == 1.5  # one way at the ends, two between
    for _ in range(30):
        trail.strengthen(EASTWARD, 0.75)
    tau = trail.snapshot().tau
    assert branching(tau) == 1.0
    assert tau[0, :3, 0] == pytest.approx(0.75, rel=0.01)
    assert tau[0, 1:3, 2] == pytest.approx(0.125, rel=0.01)


def test_an_earlier_snapshot_does_not_change():
    trail = ready()
    before = trail.snapshot()
    copy = before.tau.copy()
    trail.strengthen(EASTWARD, 0.75)
    trail.fade(EASTWARD)
    np.testing.assert_array_equal(before.tau, copy)
    with pytest.raises(ValueError, match="read-only"):
        before.tau[0, 0, 0] = 1.0


@pytest.mark.parametrize("quarter", [0, 1, 2, 3])
def test_a_map_that_moves_takes_the_trail_along(quarter):
    """The building turns by quarters about the corner of cell (0, 0), and moves by two columns."""
    size = 5
    free = np.ones((size, size), bool)
    free[1, 3] = free[4, 0] = False
    trail = LivingTrail(RULES)
    trail.follow(Window(0, 0, size, size), steps_of(free), None)
    cells = np.array([(0, 0), (0, 1), (1, 1), (2, 1), (2, 2), (3, 2)], np.int32)
    for _ in range(5):
        trail.strengthen(cells, 0.75)
    before = trail.snapshot()

    turned = np.rot90(free, -quarter)
    corner = {0: (0, 0), 1: (0, -size), 2: (-size, -size), 3: (-size, 0)}[quarter]
    window = Window(corner[0], corner[1] + 2, corner[0] + size, corner[1] + 2 + size)
    cos, sin = round(math.cos(quarter * math.pi / 2)), round(math.sin(quarter * math.pi / 2))

    def back(x, y):
        x = x - 2 * 0.25
        return cos * x + sin * y, cos * y - sin * x

    trail.follow(window, steps_of(turned), None)
    trail.move(before, back, quarter, 0.25)
    there = cells + 0.5
    rows = sin * there[:, 1] + cos * there[:, 0]
    cols = cos * there[:, 1] - sin * there[:, 0] + 2
    moved = np.column_stack((np.floor(rows), np.floor(cols))).astype(np.int32)
    again = LivingTrail(RULES)
    again.follow(window, steps_of(turned), None)
    for _ in range(5):
        again.strengthen(moved, 0.75)
    assert table(trail) == table(again)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (4, 3)])
def test_the_mean_and_the_strongest_into_each_cell(shape):
    rng = np.random.default_rng(3)
    steps = steps_of(rng.random(shape) < 0.8)
    tau = rng.random((*shape, 4)).astype(np.float32) * ((steps[..., None] >> np.arange(4)) & 1)
    into = [[[] for _ in range(shape[1])] for _ in range(shape[0])]
    for row, col in np.ndindex(*shape):
        for way in range(4):
            if steps[row, col] >> way & 1:
                into[row + ROW_STEP[way]][col + COL_STEP[way]].append(tau[row, col, way])
    expected = [[np.mean(cell) if cell else 0.0 for cell in row] for row in into]
    np.testing.assert_allclose(mean_into(tau), np.reshape(expected, shape), rtol=1e-6)
    most = [[max(cell, default=0.0) for cell in row] for row in into]
    np.testing.assert_array_equal(strongest_into(tau), np.reshape(most, shape))


def test_directions_are_the_strongest_steps_with_their_shares():
    tau = np.zeros((1, 4, 4), np.float32)
    tau[0, 0] = (0.75, 0.25, 0, 0)
    tau[0, 1] = (0.1, 0.1, 0.1, 0.1)
    tau[0, 2, 3] = 0.5
    pointed, share = directions(tau)
    assert pointed.tolist() == [[0, 0, 3, -1]]
    assert share.tolist() == [[0.75, 0.25, 1.0, 0.0]]
    assert (pointed.dtype, share.dtype) == (np.int8, np.float32)
