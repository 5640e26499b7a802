"""Benchmark of ants and their trail: moments of a small mission, and errors by building."""

import json
import math

import numpy as np
import pytest

from tests.benchmarks.__main__ import main
from tests.benchmarks.ants.benchmark import ratio
from tests.benchmarks.ants.moments import FIRST, FIRST_ANTS, KINDS, NONE, VARIANTS


def test_moments_are_answered_with_and_without_ants(tmp_path, capsys):
    free = np.ones((16, 20), bool)
    free[8, 2:] = free[3:6, 10] = False
    np.save(tmp_path / "rooms.npy", free)
    words = ["--grids", str(tmp_path / "rooms.npy"), "--moments", "3", "--rests", "1"]
    assert main(["ants", *words, "--seeds", "1", "--json"]) == 0
    replays = json.loads(capsys.readouterr().out)["replays"]
    assert {one["kind"] for one in replays} == set(KINDS[:3])
    for one in replays:
        assert tuple(one["answers"]) == VARIANTS
        # A search counts its five simple walks as ants.
        assert one["answers"][NONE]["ants"] in {0, 5}
        assert one["answers"][NONE]["by_ants_s"] == 0.0
    repairs = [one["answers"] for one in replays if one["kind"] == KINDS[0]]
    assert any(one["living"]["ants"] for one in repairs)
    assert any(one["living"] != one["flat"] for one in repairs)


def test_first_walks_by_ants_are_compared_with_simple_ones(capsys):
    words = ["--first", "--maps", "flat", "--seeds", "1", "--json"]
    assert main(["ants", *words]) == 0
    first, *after = json.loads(capsys.readouterr().out)["replays"]
    assert first["kind"] == FIRST
    assert first["answers"]["new"]["ants"] == FIRST_ANTS
    for one in after:
        costs = [answer["cost_s"] for answer in one["answers"].values()]
        assert max(costs) < first["answers"][NONE]["cost_s"]


def test_errors_are_those_of_buildings():
    alike = [("a", 1.0, 1.0)] * 8 + [("b", 1.2, 1.0)] * 8
    assert ratio(alike).value == pytest.approx(1.1)
    assert ratio(alike).error == pytest.approx(0.1)
    assert math.isnan(ratio(alike[:8]).error)
    assert ratio([]) is None
