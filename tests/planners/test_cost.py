"""What a walk costs, against counting; what no robot costs is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.ants.colony import walk_cost
from fasaco_edge.planners.cost import COLUMNS, PRICE_ACROSS, ROWS, CoverageCost
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from tests import naive
from tests.support.examples import examples

WALKS = st.lists(st.sampled_from(naive.DIRECTIONS), max_size=60)
COSTS = st.builds(CoverageCost, st.floats(0.001, 3600.0), st.floats(0.0, 3600.0))


def walk_along(headings, start=(70, 70)):
    walk = [start]
    for row, col in headings:
        walk.append((walk[-1][0] + row, walk[-1][1] + col))
    return walk


@examples(300)
@given(headings=WALKS, cost=COSTS)
def test_twin_counts_the_same_cost(headings, cost):
    walk = walk_along(headings)
    counted = naive.walk_us(walk, cost)
    assert cost.of_walk(np.array(walk, np.int32)) == counted / 1e6
    flat = np.array([row * 150 + col for row, col in walk], np.int32)
    assert walk_cost(flat, cost.step_us, cost.quarter_turn_us) == counted


@examples(100)
@given(headings=WALKS, cost=COSTS, lanes=st.sampled_from((ROWS, COLUMNS)))
def test_twin_counts_the_same_price_of_steps_across_lanes(headings, cost, lanes):
    walk, laned = walk_along(headings), cost.along(lanes)
    assert laned.of_walk_us(np.array(walk, np.int32)) == naive.walk_us(walk, laned)
    across = sum(bool(col) == (lanes == COLUMNS) for _, col in headings)
    added = laned.row_us or laned.col_us
    assert naive.walk_us(walk, laned) == naive.walk_us(walk, cost) + across * added
    assert laned.without_prices == cost


def test_in_a_single_column_each_step_is_along_it():
    ground = CoverageLattice.from_free(np.ones((4, 1), bool))
    for lanes, added_s in ((ROWS, PRICE_ACROSS), (COLUMNS, 0.0)):
        problem = CoverageProblem.of(ground, (0, 0), cost=CoverageCost().along(lanes))
        flat = np.arange(4, dtype=np.int32)
        framed = FramedGround.of(problem).framed(flat)
        assert problem.cost_us(flat) == problem.cost_us(framed) == 3_000_000 * (1.0 + added_s)


@examples(100)
@given(forwards=st.lists(st.booleans(), min_size=2, max_size=30), cost=COSTS)
def test_twin_counts_the_same_cost_in_a_single_column(forwards, cost):
    """Where a step north and a step east would be the same difference of index."""
    walk = walk_along([naive.NORTH if forward else naive.SOUTH for forward in forwards])
    flat = np.array([row for row, _ in walk], np.int32)
    counted = naive.walk_us(walk, cost)
    assert walk_cost(flat, cost.step_us, cost.quarter_turn_us) == counted


@pytest.mark.parametrize(
    ("step_s", "quarter_turn_s", "said"),
    [
        (1e-4, 0.0, "step_s: must be in [0.001, 3600] s, got 0.0001"),
        (3601.0, 0.0, "step_s: must be in [0.001, 3600] s, got 3601.0"),
        (math.inf, 0.0, "step_s: must be in [0.001, 3600] s, got inf"),
        (math.nan, 0.0, "step_s: must be in [0.001, 3600] s, got nan"),
        (1.0, -0.1, "quarter_turn_s: must be in [0, 3600] s, got -0.1"),
        (1.0, math.inf, "quarter_turn_s: must be in [0, 3600] s, got inf"),
        (1.0, math.nan, "quarter_turn_s: must be in [0, 3600] s, got nan"),
    ],
)
def test_an_impossible_cost_is_refused(step_s, quarter_turn_s, said):
    with pytest.raises(BadConfiguration) as caught:
        CoverageCost(step_s, quarter_turn_s)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("cell_m", "speed_m_s", "said"),
    [
        (0.3, 0.0, "speed_m_s: must be in"),
        (0.3, math.nan, "speed_m_s: must be in"),
        (0.3, math.inf, "speed_m_s: must be in"),
        (0.0, 0.3, "cell_m: must be in"),
        (math.nan, 0.3, "cell_m: must be in"),
        (10.0, 0.001, r"cell_m / speed_m_s: must be in \[0.001, 3600\] s, got 10000.0"),
    ],
)
def test_a_robot_that_cannot_be_is_refused(cell_m, speed_m_s, said):
    with pytest.raises(BadConfiguration, match=said):
        CoverageCost.for_robot(cell_m, speed_m_s, 0.0)
