"""The campaign of the bound with turns, in short."""

import sys

import numpy as np

from tests.campaigns import turn_bound


def test_no_walk_costs_less_than_the_bound(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["turn_bound", "--grounds", "400", "--seed", "7"])
    assert turn_bound.main() == 0
    assert "0 bounds above" in capsys.readouterr().out


def test_the_bound_comes_close_to_the_least_cost():
    random = np.random.default_rng(3)
    found = [turn_bound.examine(random) for _ in range(200)]
    shares = [each.bounds_us[-1] / each.least_us for each in found if each.least_us]
    assert np.mean(shares) > 0.93
    assert any(each.bounds_us[0] < each.bounds_us[-1] == each.least_us for each in found)
