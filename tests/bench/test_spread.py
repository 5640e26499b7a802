"""Medians, ranges and percentiles of measurements."""

import pytest

from fasaco_edge.bench.benchmark import MeasuredGoal
from fasaco_edge.bench.spread import Spread, document, median, percentile, text


def test_percentile_of_two_hundred_leaves_two_above():
    assert percentile(list(range(200, 0, -1)), 99) == 198
    assert percentile([7.0], 0) == 7.0
    assert percentile([], 50) is None


def test_a_spread_is_median_and_range_or_none():
    assert Spread.of([]) is None
    assert Spread.of([3.0, 1.0, 7.0, 2.0]) == Spread(2.5, 1.0, 7.0)
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
