"""Benchmark of quality: judged walks, and a small run."""

import argparse
import json

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.__main__ import main
from tests.benchmarks.harness import WrongWalkError, judged
from tests.benchmarks.quality import QualityRun, Setting, report

SQUARE = [(0, 0), (0, 1), (1, 1), (1, 0)]


@pytest.mark.parametrize(
    ("cells", "given", "end", "wrong"),
    [
        (SQUARE[:3], {}, None, "never visited"),
        ([(0, 0), (1, 1), (0, 1), (1, 0)], {}, None, "jumps"),
        (SQUARE[::-1], {}, None, "starts at"),
        (SQUARE, {}, (0, 0), "ends at"),
        (SQUARE, {"cost_s": 6.5}, None, "said to cost 6.5 s"),
        (SQUARE, {"lower_bound_steps": 4}, None, "below the bound of 4"),
    ],
)
def test_wrong_walks_are_refused(cells, given, end, wrong):
    def path_of(cells, **given):
        cells = np.array(cells, np.int32)
        figures = {"cost_s": problem.cost.of_walk(cells), **given}
        return CoveragePath(cells, planner="test", seed=0, **figures)

    lattice = CoverageLattice.from_free(np.ones((2, 2), bool))
    problem = CoverageProblem.of(lattice, (0, 0), end=end, cost=CoverageCost(1.0, 1.5))
    if end is None:
        assert judged(problem, path_of(SQUARE)).turns_90 == 2
    with pytest.raises(WrongWalkError, match=wrong):
        judged(problem, path_of(cells, **given))


@pytest.mark.parametrize(("end", "shortest"), [("anywhere", 40), ("home", 42)])
def test_the_benchmark_quality_reports_its_figures(end, shortest, tmp_path, capsys):
    free = np.ones((6, 7), bool)
    free[2, 3] = False
    np.save(tmp_path / "room.npy", free)
    words = ["--grids", str(tmp_path / "room.npy"), "--seeds", "1", "--end", end]
    assert main(["quality", *words, "--budgets", "0.02", "--json"]) == 0
    runs = json.loads(capsys.readouterr().out)["runs"]
    by_cost = {run["setting"]["cost"]: run for run in runs}
    assert by_cost.keys() == {"steps", "turns"}
    assert by_cost["steps"]["steps"] == by_cost["steps"]["cost_s"] == shortest
    assert by_cost["turns"]["cost_s"] <= by_cost["steps"]["mission_s"]
    for run in runs:
        quarters = run["turns_90"] + 2 * run["turns_180"]
        assert run["mission_s"] == run["steps"] + 1.5 * quarters
        assert run["first_walk_s"] < run["wall_s"]
        assert run["bound_s"] <= run["cost_s"]
        assert run["cells"] == 41


def test_variants_stand_side_by_side():
    runs = [
        QualityRun(
            "grid", 100, Setting("anywhere", "steps", variant), 1.0, seed=0, steps=cost,
            turns_90=10, turns_180=1, mission_s=cost + 18.0, cost_s=cost, bound_s=100.0,
            first_walk_s=1e-3, wall_s=1.0,
        )
        for cost, variant in ((101, "ants"), (102, "flat"), (103, "none"))
    ]  # fmt: skip
    made = report(argparse.Namespace(seeds=1, turn_s=1.5), runs)
    assert made.tables[-1].rows == (("grid", "1", "1.0100", "1.0200", "1.0300"),)
    assert [row[2] for row in made.rows] == ["1.0100", "1.0200", "1.0300"]


def test_impossible_grids_and_options_are_refused(tmp_path, capsys):
    np.save(tmp_path / "room.npy", np.ones((1, 1), bool))
    assert main(["quality", "--grids", str(tmp_path / "room.npy")]) == 78
    assert "one cell only" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["quality", "--budgets", "-1"])
    assert "--budgets" in capsys.readouterr().err
