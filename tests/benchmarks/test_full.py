"""Benchmark of full plans by their first walk: equal work, and the kept part of the path."""

import json

import numpy as np
import pytest

from tests.benchmarks.__main__ import main
from tests.benchmarks.full import SITUATIONS, kept


def test_a_plan_from_the_walk_before_keeps_more_of_it(capsys):
    words = ["--maps", "office", "--seeds", "2", "--proposals", "200000"]
    assert main(["full", *words, "--json"]) == 0
    pairs = json.loads(capsys.readouterr().out)["pairs"]
    assert {pair["situation"] for pair in pairs} == set(SITUATIONS)
    asked = [pair for pair in pairs if pair["situation"] == "asked for"]
    assert all(pair["kept"] >= pair["kept_anew"] for pair in asked)
    assert all(pair["kept"] > 0.9 and pair["ratio"] < 1.02 for pair in asked)
    assert all(pair["kept"] == 0 for pair in pairs if pair["situation"] == "carried")


def test_kept_is_counted_to_the_first_change():
    before = np.column_stack((np.zeros(20), np.arange(20))).astype(np.int32)
    assert kept(before, before) == 1.0
    after = before.copy()
    after[6:, 0] = 1
    assert kept(before, after) == pytest.approx(5 / 17)
    assert kept(before, before[3:]) == 0.0
