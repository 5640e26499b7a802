"""The colony's kernels one by one; whole walks are compared in tests/planners/test_twin.py."""

import numpy as np
import pytest

from fasaco_edge.kernels.ants.colony import (
    NEIGHBOUR,
    ColonyState,
    Rules,
    deposit,
    settle,
    walk_ants,
)
from fasaco_edge.planners.problem import CoverageProblem, graph_of, scratch_for
from tests.support.grids import lattice

ALPHA, TAU0 = 0.25, 0.5
STEP_US = 1_000_000


class Ground:
    """A drawn lattice with a trail on it, and ants to walk there."""

    def __init__(self, *rows):
        drawn = lattice(*rows)
        row, col = np.argwhere(drawn.coverable)[0].tolist()
        self.graph = graph_of(CoverageProblem.of(drawn, (row, col)))
        self.trail = np.full((drawn.steps.size, 4), TAU0)

    def state(self, q0=1.0, start=0, end=-1, turn_us=0):
        rules = Rules(q0, ALPHA, TAU0, start, end, STEP_US, turn_us, NEIGHBOUR, np.ones(4))
        return ColonyState(self.graph, self.trail, rules)

    def walks(self, start, velocity=1, q0=1.0, end=-1, ants=1, seed=None, turn_us=0):
        """Return the ants' walks; then their trail is settled."""
        streams = np.arange(1, 4 * ants + 1, dtype=np.int64).reshape(ants, 4)
        if seed is not None:
            words = np.random.SeedSequence(seed).generate_state(4 * ants)
            streams = words.astype(np.int64).reshape(ants, 4)
        walks, lengths = np.empty((ants, 64), np.int32), np.empty(ants, np.int64)
        state = self.state(q0, start, end, turn_us)
        walk_ants(state, scratch_for(self.graph), velocity, streams, walks, lengths)
        self.best, self.least_us = settle(state, walks, lengths)
        return [walk[:length].tolist() for walk, length in zip(walks, lengths, strict=True)]

    def walk(self, start, **options):
        return self.walks(start, **options)[0]


def test_equation_4_takes_the_strongest_trail():
    ground = Ground("..", "..")
    assert ground.walk(0) == [0, 1, 3, 2]  # a tie: straight on, to the east
    ground.trail[0, 1] = 0.6
    assert ground.walk(0) == [0, 2, 3, 1]


def test_equation_6_draws_in_proportion_to_the_trail():
    ground = Ground("#.#", "...", "#.#")
    ground.trail[4] = (1.0, 2.0, 3.0, 4.0)  # out of the middle: east, north, west, south
    # None of these ants sees what another left.
    first = [walk[1] for walk in ground.walks(4, q0=0.0, ants=4000, seed=0)]
    shares = [first.count(cell) / len(first) for cell in (5, 7, 3, 1)]
    assert shares == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=0.03)


def test_equation_7_pulls_the_trail_of_every_move_towards_tau0():
    ground = Ground("...")
    ground.trail[:] = 4.0
    assert ground.walk(1, end=1) == [1, 2, 1, 0, 1]
    once = (1 - ALPHA) * 4.0 + ALPHA * TAU0
    # East out of 0 and 1, west out of 2 and 1: one move each; no other trail moves.
    moved = {(0, 0), (1, 0), (1, 2), (2, 2)}
    for cell in range(3):
        for direction in range(4):
            assert ground.trail[cell, direction] == (once if (cell, direction) in moved else 4.0)


def test_equation_8_strengthens_a_move_each_time_it_occurs():
    ground = Ground("...")
    deposit(ground.state(), 2.0, np.array([1, 2, 1, 0, 1, 2], np.int32))
    once = (1 - ALPHA) * TAU0 + ALPHA * 2.0
    twice = (1 - ALPHA) * once + ALPHA * 2.0
    expected = np.full((3, 4), TAU0)
    expected[1, 0], expected[2, 2], expected[1, 2], expected[0, 0] = twice, once, once, once
    assert np.array_equal(ground.trail, expected)


def test_a_walk_longer_than_its_array_is_cut_but_counted():
    ground = Ground("....")
    streams = np.ones((1, 4), np.int64)
    walks, lengths = np.full((1, 3), -7, np.int32), np.empty(1, np.int64)
    walk_ants(ground.state(end=0), scratch_for(ground.graph), 4, streams, walks, lengths)
    assert lengths.tolist() == [7]
    assert walks.tolist() == [[0, 1, 2]]
