"""The colony's kernels one by one; whole walks are compared in tests/planners/test_twin.py."""

import numpy as np
import pytest

from fasaco_edge.kernels.colony import Field, Rules, Scratch, deposit, walk_ants
from tests.planners.grids import lattice

ALPHA, TAU0 = 0.25, 0.5


def field_of(ground):
    size, cols = ground.steps.size, ground.steps.shape[1]
    return Field(
        steps=ground.steps.ravel(),
        to_cover=ground.coverable.astype(np.uint8).ravel(),
        offsets=np.array([1, cols, -1, -cols]),
        trail=np.full((size, 4), TAU0),
    )


def scratch(size):
    return Scratch(
        np.empty(size, np.uint8),
        np.zeros(size, np.int64),
        np.zeros(size, np.int8),
        np.empty(size, np.int64),
        np.zeros(1, np.int64),
    )


def walk(field, start, velocity=1, q0=1.0, return_home=False, ants=1, best=()):
    streams = np.arange(1, 4 * ants + 1, dtype=np.int64).reshape(ants, 4)
    rules = Rules(q0, ALPHA, TAU0, return_home)
    best = np.array(best, np.int64)
    return walk_ants(field, rules, scratch(field.steps.size), start, velocity, streams, best)


def test_equation_4_takes_the_strongest_trail():
    field = field_of(lattice("..", ".."))
    assert walk(field, 0).tolist() == [0, 1, 3, 2]  # a tie: straight on, to the east
    field.trail[0, 1] = 0.6
    assert walk(field, 0).tolist() == [0, 2, 3, 1]


def test_equation_6_draws_in_proportion_to_the_trail():
    field = field_of(lattice("#.#", "...", "#.#"))
    field.trail[4] = (1.0, 2.0, 3.0, 4.0)  # out of the middle: east, north, west, south
    first = []
    for seed in range(4000):
        kept = field.trail.copy()
        streams = np.random.SeedSequence(seed).generate_state(4).astype(np.int64).reshape(1, 4)
        rules = Rules(0.0, ALPHA, TAU0, False)
        path = walk_ants(field, rules, scratch(9), 4, 1, streams, np.empty(0, np.int64))
        first.append(int(path[1]))
        field.trail[:] = kept
    shares = [first.count(cell) / len(first) for cell in (5, 7, 3, 1)]
    assert shares == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=0.03)


def test_equation_7_pulls_the_trail_of_every_move_towards_tau0():
    field = field_of(lattice("..."))
    field.trail[:] = 4.0
    assert walk(field, 1, return_home=True).tolist() == [1, 2, 1, 0, 1]
    once = (1 - ALPHA) * 4.0 + ALPHA * TAU0
    # East out of 0 and 1, west out of 2 and 1: one move each; no other trail moves.
    moved = {(0, 0), (1, 0), (1, 2), (2, 2)}
    for cell in range(3):
        for direction in range(4):
            assert field.trail[cell, direction] == (once if (cell, direction) in moved else 4.0)


def test_equation_8_strengthens_the_moves_of_the_best_walk_each_time_they_occur():
    field = field_of(lattice("..."))
    deposit(field, ALPHA, 2.0, np.array([1, 2, 1, 0, 1, 2]))
    once = (1 - ALPHA) * TAU0 + ALPHA * 2.0
    twice = (1 - ALPHA) * once + ALPHA * 2.0
    expected = np.full((3, 4), TAU0)
    expected[1, 0], expected[2, 2], expected[1, 2], expected[0, 0] = twice, once, once, once
    assert np.array_equal(field.trail, expected)


def test_a_column_deposits_north_and_south():
    """With one column, a step north and a step east are the same difference of index."""
    field = field_of(lattice(".", "."))
    deposit(field, ALPHA, 2.0, np.array([0, 1, 0]))
    changed = np.argwhere(field.trail != TAU0).tolist()
    assert changed == [[0, 1], [1, 3]]


def test_velocity_keeps_straight_on_past_a_stronger_trail():
    field = field_of(lattice("....", "...."))
    field.trail[1, 1] = 9.0  # north out of cell 1 tempts whoever stops there
    assert walk(field, 0, velocity=1).tolist()[:3] == [0, 1, 5]
    field = field_of(lattice("....", "...."))
    field.trail[1, 1] = 9.0
    assert walk(field, 0, velocity=3).tolist()[:4] == [0, 1, 2, 3]


def test_a_dead_end_is_left_by_the_shortest_walk():
    field = field_of(lattice(".#.", "..."))
    # East first: 1, 2, north to 5; back to the nearest open cell, 3, by 2, 1, 0.
    assert walk(field, 0).tolist() == [0, 1, 2, 5, 2, 1, 0, 3]


def test_only_a_shorter_walk_replaces_the_best():
    field = field_of(lattice("..."))
    assert walk(field, 0, best=(0, 1, 2)).tolist() == [0, 1, 2]
    assert walk(field, 0, best=(0, 1, 0, 1, 2)).tolist() == [0, 1, 2]
    equal = walk(field, 1, ants=40, q0=0.0, best=(1, 0, 1, 2))
    assert equal.tolist() == [1, 0, 1, 2]
