"""Medians, ranges and percentiles of measurements."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.bench.benchmark import MeasuredGoal
from fasaco_edge.bench.spread import Spread, document, median, percentile, text

numbers = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300)


@given(values=numbers, percent=st.floats(0.5, 100))
def test_percentile_is_the_least_value_that_enough_do_not_exceed(values, percent):
    found = percentile(values, percent)
    assert found in values
    assert sum(value <= found for value in values) >= percent / 100 * len(values) - 1e-9
    assert sum(value < found for value in values) < percent / 100 * len(values)


def test_percentile_of_two_hundred_leaves_two_above():
    assert percentile(list(range(200, 0, -1)), 99) == 198
    assert percentile([7.0], 0) == 7.0
    assert percentile([], 50) is None


@given(values=numbers)
def test_spread_holds_every_value(values):
    spread = Spread.of(values)
    assert spread.low <= spread.median <= spread.high
    assert {spread.low, spread.high} <= set(values)


def test_a_spread_without_values_is_none():
    assert Spread.of([]) is None
    assert (median(None), document(None), text(None, 1)) == (None, None, ("-", "-"))
    assert text(Spread(2.04, 1.0, 3.0), 1) == ("2.0", "1.0 .. 3.0")
    assert document(Spread(2.0, 1.0, 3.0)) == {"median": 2.0, "low": 1.0, "high": 3.0}


@pytest.mark.parametrize(
    ("measured", "at_least", "met"),
    [(4.0, False, True), (5.0, False, True), (6.0, False, False), (None, False, None),
     (4.0, True, False), (5.0, True, True), (6.0, True, True)],
)  # fmt: skip
def test_goal_is_met_up_to_and_at_its_limit(measured, at_least, met):
    goal = MeasuredGoal("speed", measured, 5.0, "s", at_least=at_least)
    assert goal.met is met
    assert goal.document()["met"] is met
