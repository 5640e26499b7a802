"""Walks of a fleet that are annealed together: how many first tours a ground gets."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.fleet.planning.annealing import AT_FIRST, MOST_COST, FleetWalks
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.walks import STEP
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost


def walks(rows, cost=STEPS_ALONE):
    free = np.ones((rows, 100), np.bool_)
    return FleetWalks(CoverageLattice.from_free(free), free, [0, 1], cost)


@pytest.mark.parametrize(("rows", "first"), [(10, 4), (40, 3), (AT_FIRST // 100 + 1, 2)])
def test_a_large_ground_has_fewer_attempts_at_first(rows, first):
    """A second of four short attempts on 12,000 cells left no time to anneal one for long."""
    fleet = walks(rows)
    assert fleet.attempts(0) == range(first)
    assert [fleet.attempts(generation) for generation in (1, 2)] == [range(4, 8), range(8, 12)]


def test_one_attempt_where_turns_have_a_price():
    fleet = walks(10, CoverageCost(1.0, 1.5))
    assert [fleet.attempts(generation) for generation in (0, 1)] == [range(1), range(1, 2)]


def test_squares_of_costs_stay_in_64_bits_however_dear_a_turn_is():
    """An hour for a quarter-turn, a millisecond for a step."""
    fleet = walks(10, CoverageCost(0.001, 3600.0))
    fleet.load([np.array([0, 1, 101, 100], np.int32), np.array([1], np.int32)])
    least = STEP * 4
    assert least < fleet.score[0] <= least + 4 * MOST_COST // 1000
