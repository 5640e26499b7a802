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
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem, graph_of, scratch_for
from tests import naive
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


def test_a_column_deposits_north_and_south():
    """With one column, a step north and a step east are the same difference of index."""
    ground = Ground(".", ".")
    deposit(ground.state(), 2.0, np.array([0, 1, 0], np.int32))
    changed = np.argwhere(ground.trail != TAU0).tolist()
    assert changed == [[0, 1], [1, 3]]


def test_velocity_keeps_straight_on_past_a_stronger_trail():
    ground = Ground("....", "....")
    ground.trail[1, 1] = 9.0  # north out of cell 1 tempts whoever stops there
    assert ground.walk(0, velocity=1)[:3] == [0, 1, 5]
    ground = Ground("....", "....")
    ground.trail[1, 1] = 9.0
    assert ground.walk(0, velocity=3)[:4] == [0, 1, 2, 3]


def test_a_dead_end_is_left_by_the_shortest_walk():
    ground = Ground(".#.", "...")
    # East first: 1, 2, north to 5; back to the nearest open cell, 3, by 2, 1, 0.
    assert ground.walk(0) == [0, 1, 2, 5, 2, 1, 0, 3]


def test_the_first_of_the_shortest_walks_of_a_group_is_found():
    ground = Ground("...")
    walks = ground.walks(1, ants=40, q0=0.0, seed=1)
    assert {len(walk) for walk in walks} == {4}
    assert (ground.best, ground.least_us) == (0, 3 * STEP_US)
    ground = Ground("...", "...", "...")
    lengths = [len(walk) for walk in ground.walks(1, ants=40, q0=0.0, seed=1)]
    assert len(set(lengths)) > 1
    assert ground.best == lengths.index(min(lengths))
    assert ground.least_us == (min(lengths) - 1) * STEP_US


def test_the_cheapest_walk_of_a_group_need_not_be_the_shortest():
    cost = CoverageCost(1.0, 2.5)
    ground = Ground(".....", "..#..", ".....", ".....")
    walks = ground.walks(0, ants=60, q0=0.0, seed=0, turn_us=cost.quarter_turn_us)
    costs = [naive.walk_us([divmod(cell, 5) for cell in walk], cost) for walk in walks]
    assert (ground.best, ground.least_us) == (costs.index(min(costs)), min(costs))
    assert len(walks[ground.best]) > min(map(len, walks))


def test_a_walk_ends_where_it_is_asked_to():
    ground = Ground("....", "#.#.")
    # Row 0 is the last line, of which 1 and 3 can be entered; above them lie 4 to 7.
    there = [4, 5, 6, 7, 3, 7, 6, 5, 1]
    ends = {-1: [], 1: [], 5: [5], 6: [5, 6], 4: [5, 4], 3: [5, 6, 7, 3]}
    assert {end: ground.walk(4, end=end) for end in ends} == {
        end: there + way for end, way in ends.items()
    }


def test_a_walk_longer_than_its_array_is_cut_but_counted():
    ground = Ground("....")
    streams = np.ones((1, 4), np.int64)
    walks, lengths = np.full((1, 3), -7, np.int32), np.empty(1, np.int64)
    walk_ants(ground.state(end=0), scratch_for(ground.graph), 4, streams, walks, lengths)
    assert lengths.tolist() == [7]
    assert walks.tolist() == [[0, 1, 2]]
