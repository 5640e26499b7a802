"""Benchmark of walks with costly turns: a small run, its report and its errors."""

import json

import numpy as np
import pytest

from tests.benchmarks.__main__ import main

FLOOR = np.ones((6, 8), bool)
BOUNDS = {"ring": 210.0, "row": 206.0}


@pytest.fixture
def instances(tmp_path):
    """Two instances: the best tour over the first one goes around, over the second back."""
    np.savez(tmp_path / "grids.npz", ring=np.ones((2, 5), bool), row=np.ones((1, 4), bool))
    known = {
        "ring": {"tour_best": 210.0, "tour_approximation": 210.0},
        "row": {"tour_best": 206.0, "tour_approximation": 309.0},
    }
    (tmp_path / "results.json").write_text(json.dumps(known))
    return tmp_path


def run(capsys, *words):
    code = main(["turns", "--json", *map(str, words)])
    return code, capsys.readouterr().out


def test_tours_are_compared_with_the_best_known(instances, capsys):
    code, out = run(capsys, "--instances", instances, "--no-maps", "--budgets", 0.02)
    assert code == 0
    runs = {each["ground"]: each for each in json.loads(out)["runs"]}
    assert {name: each["cost_s"] for name, each in runs.items()} == {"ring": 210.0, "row": 206.0}
    assert all(0 < each["bound_s"] <= each["best_s"] for each in runs.values())
    # At the end of a row every tour turns back, in the corner of the ring to one side.
    assert {name: each["bound_s"] for name, each in runs.items()} == BOUNDS


def test_walks_over_maps_have_a_certified_gap_at_each_price(capsys, tmp_path):
    np.save(tmp_path / "hall.npy", FLOOR)
    hall = tmp_path / "hall.npy"
    code, out = run(capsys, "--grids", hall, "--prices", 0, 5, "--budgets", 0.01, 0.02)
    assert code == 0
    runs = json.loads(out)["runs"]
    assert [(each["price"], each["budget_s"]) for each in runs] == [
        (0.0, 0.01),
        (0.0, 0.02),
        (5.0, 0.01),
        (5.0, 0.02),
    ]
    for each in runs:
        assert each["cost_s"] == pytest.approx(each["bound_s"] * (1 + each["gap"]), rel=1e-4)
        # Lanes back and forth along the longer side: no walk over a hall is better.
        assert each["cost_s"] == each["simple_s"] == 47 + 10 * each["price"]


def test_a_folder_without_instances_is_an_error(tmp_path, capsys):
    assert main(["turns", "--instances", str(tmp_path), "--no-maps"]) == 78
    assert "results.json" in capsys.readouterr().err
