"""Compiled planners find the walks of their naive twins, and the comparison says so."""

import json

import numpy as np
import pytest

from tests.benchmarks.__main__ import main


def test_compiled_planners_walk_as_their_twins_do(capsys, tmp_path):
    file = tmp_path / "room.npy"
    np.save(file, np.ones((7, 9), bool))
    file.with_suffix(".json").write_text('{"start": [3, 4]}')
    words = ["--grids", str(file), "--maps", "office", "--ants", "40", "--naive-s", "0.2"]
    assert main(["twins", *words, "--return-home", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    found = {(one["grid"], one["planner"]): one for one in document["comparisons"]}
    planners = ("fasaco", "stc", "spiral-stc", "zigzag")
    assert list(found) == [(grid, name) for grid in (str(file), "office") for name in planners]
    for (_, planner), one in found.items():
        assert one["same_walk"] is True
        assert one["ants"] == 0 if planner != "fasaco" else 8 <= one["ants"] <= 40
        assert one["ratio"] == pytest.approx(one["naive_s"] / one["compiled_s"], rel=1e-2, abs=0.1)
    assert [goal["limit"] for goal in document["goals"]] == 2 * [300.0, 50.0, 50.0, 50.0]
    assert found[str(file), "fasaco"]["cells"] == 63
