"""Benchmark of Table I: measurement, figures, and judgement."""

import argparse
import json
import re

import numpy as np
import pytest

from fasaco_edge.bench.spread import Spread
from fasaco_edge.planners.path import WalkFigures
from tests.benchmarks.__main__ import main
from tests.benchmarks.table1.benchmark import TABLE1
from tests.benchmarks.table1.paper import (
    CLAIMS,
    TABLE_I,
    Claim,
    Finding,
    check,
    contradiction,
    paired_change,
    paper_change,
    paper_map,
    verdict,
)
from tests.benchmarks.table1.runs import VARIANTS, Run
from tests.offline.test_plan import OWN_PLANNER

SMALL = ["--ants", "16", "--seeds", "2"]
COUNTS = ("n_r_paper", "revisits", "recovered_cells", "turns_90", "cpu_s")


def options(*words):
    parser = argparse.ArgumentParser()
    TABLE1.add_options(parser)
    return parser.parse_args(words)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the options and the runs of a small table."""
    folder = tmp_path_factory.mktemp("table1")
    np.save(folder / "room.npy", np.ones((5, 6), bool))
    args = options(*SMALL, "--maps", "office", "--grids", str(folder / "room.npy"))
    runs = list(TABLE1.measure(args, lambda what: None))
    return args, runs


def test_every_variant_runs_with_every_seed(made):
    args, runs = made
    assert len(runs) == TABLE1.count(args) == 2 * 2 * len(VARIANTS)
    assert {run.grid for run in runs} == {"room", "office"}
    assert {run.seed for run in runs} == {0, 1}
    for run in runs:
        assert run.walk.cells == run.cells
        assert run.walk.revisits == run.walk.steps + 1 - run.cells
        # Start to start, but for the one variant that may end anywhere.
        if run.variant == "falling-anywhere":
            assert run.walk.n_r_paper >= run.walk.revisits
        else:
            # The start at least is visited twice.
            assert run.walk.n_r_paper == run.walk.revisits >= 1
        assert run.walk.recovered_cells <= run.walk.revisits
        assert run.cpu_s > 0
    fixed = [run.walk for run in runs if (run.grid, run.variant) == ("office", "zigzag")]
    assert fixed[0] == fixed[1]


def test_a_planner_of_one_s_own_is_a_row(tmp_path, capsys):
    (tmp_path / "mine.py").write_text(OWN_PLANNER)
    own = ["--planner", f"{tmp_path / 'mine.py'}:depth_first"]
    assert main(["table1", "--maps", "office", *SMALL, *own, "--json"]) == 0
    *_, row = json.loads(capsys.readouterr().out)["grids"][0]["rows"]
    assert row["planner"] == "mine.py:depth_first"
    assert row["n_r_paper"]["median"] == 333
    assert main(["table1", "--maps", "office", *SMALL, *own]) == 0
    said = capsys.readouterr().out
    assert re.search(r"yours +\n +mine.py:depth_first +333 ", said)


def test_table_one_reports_its_figures(capsys):
    assert main(["table1", "--maps", "office", *SMALL, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["benchmark"] == "table1"
    assert document["return_home"] is True
    (grid,) = document["grids"]
    assert (grid["grid"], grid["paper_map"], grid["optimum_revisits"]) == ("office", None, None)
    assert [row["variant"] for row in grid["rows"]] == list(VARIANTS)
    for row in grid["rows"]:
        assert row["runs"] == 2
        assert row["paper"] is None
        for name in COUNTS:
            assert 0 < row[name]["low"] <= row[name]["median"] <= row[name]["high"]
    assert [claim["claim"] for claim in document["claims"]] == [claim.text for claim in CLAIMS]
    assert set(document["verdicts"]) == {claim.text for claim in CLAIMS}
    assert document["goals"] == []


@pytest.mark.parametrize("count", [0, 1, len(VARIANTS) - 1, len(VARIANTS) + 3])
def test_interrupted_table_reports_what_there_is(made, count):
    args, runs = made
    report = TABLE1.report(args, runs[:count])
    json.dumps(report.figures, allow_nan=False)
    for table in report.tables:
        assert {len(row) for row in table.rows} <= {len(table.header)}
    assert sum(row["runs"] for grid in report.figures["grids"] for row in grid["rows"]) == count


def test_two_grids_of_one_name_are_refused(tmp_path, capsys):
    np.save(tmp_path / "office.npy", np.ones((3, 3), bool))
    words = ["--grids", str(tmp_path / "office.npy"), "--maps", "office", *SMALL]
    assert main(["table1", *words]) != 0
    assert "'office' twice" in capsys.readouterr().err


def run(variant, seed, revisits, cpu_s=1.0, grid="paper_simulated", cells=169):
    walk = WalkFigures(cells, cells + revisits - 1, revisits, revisits, revisits, 50, 4)
    return Run(grid, cells, variant, seed, walk, cpu_s)


@pytest.mark.parametrize(("falling", "spiral", "met"), [(70, 80, True), (71, 81, False)])
def test_bars_on_the_papers_own_grid(falling, spiral, met):
    runs = [run("falling", 0, falling), run("spiral-stc", 0, spiral)]
    report = TABLE1.report(options(), runs)
    colony, sweep, zigzag = report.goals
    assert (colony.met, sweep.met, zigzag.met) == (met, met, None)
    assert (colony.limit, sweep.limit, zigzag.limit) == (70.0, 80.0, 84.0)
    (grid,) = report.figures["grids"]
    assert grid["paper_map"] == "Simulated map"
    paper = {row["variant"]: row["paper"] for row in grid["rows"]}
    assert paper["velocity-1"] == {"n_r": 80, "cpu_s": 96.0}
    assert paper["stc"] is None
    # Fewer ants than the paper's are not held to what its ants reach.
    assert len(TABLE1.report(options("--ants", "999"), runs).goals) == 2


def test_a_grid_of_another_size_is_not_the_papers():
    assert paper_map("paper_basement", 520).name == "Basement"
    assert paper_map("paper_basement", 519) is None
    assert paper_map("", 0).grid == ""


def test_change_is_taken_seed_by_seed():
    change = paired_change({0: 90.0, 1: 30.0, 2: 12.0, 9: 7.0}, {0: 100.0, 1: 20.0, 2: 10.0})
    assert (change.low, change.median, change.high) == pytest.approx((-10.0, 20.0, 50.0))
    assert paired_change({0: 1.0}, {1: 1.0}) is None
    # There is no share of nothing.
    assert paired_change({0: 0.0, 1: 1.0}, {0: 0.0, 1: 2.0}) is None


CLAIM = Claim("FaSACO needs less", "n_r_paper", "velocity-1", 6.9, 12.5)


@pytest.mark.parametrize(
    ("median", "holds", "words"),
    [
        (-6.853, True, "holds"),
        (-12.5, True, "holds"),
        (-30.0, True, "holds, and more"),
        (-6.8, False, "fails: not enough"),
        (0.0, False, "fails: no difference"),
        (2.0, False, "fails: more"),
        (None, None, "not measured"),
    ],
)
def test_a_claim_holds_or_fails(median, holds, words):
    change = None if median is None else Spread(median, median - 1.0, median + 1.0)
    finding = Finding(CLAIM, "here", change)
    assert (finding.holds, finding.words) == (holds, words)
    assert finding.document()["holds"] is holds


def findings(*medians):
    return [
        Finding(CLAIM, f"g{number}", Spread(median, median, median))
        for number, median in enumerate(medians)
    ]


@pytest.mark.parametrize(
    ("medians", "sentence"),
    [
        ((), "Not measured."),
        ((-7.0, -20.0), "Holds on all 2 grids: g0 -7.0 %, g1 -20.0 %."),
        ((3.0, -1.0), "Fails on all 2 grids: g0 +3.0 % (more), g1 -1.0 %."),
        ((-7.0, 3.0), "Holds on 1 of 2 grids: g0 -7.0 %. Fails on 1: g1 +3.0 % (more)."),
    ],
)
def test_the_verdict_says_where_a_claim_fails(medians, sentence):
    assert verdict(CLAIM, findings(*medians)) == sentence


def test_claims_are_checked_against_their_own_figures():
    runs = [
        *(run("falling", seed, 90, cpu_s=0.5) for seed in (0, 1)),
        *(run("velocity-1", seed, 100, cpu_s=0.6) for seed in (0, 1)),
        run("zigzag", 0, 80),
    ]
    found = {
        (claim["figure"], claim["against"]): (claim["change_percent"], claim["holds"])
        for claim in TABLE1.report(options(), runs).figures["claims"]
    }
    assert found["n_r_paper", "velocity-1"][0]["median"] == pytest.approx(-10.0)
    assert found["n_r_paper", "velocity-1"][1] is True
    assert found["cpu_s", "velocity-1"][0]["median"] == pytest.approx(-100 / 6)
    assert found["cpu_s", "velocity-1"][1] is False
    assert found["n_r_paper", "zigzag"][0]["median"] == pytest.approx(12.5)
    assert found["n_r_paper", "spiral-stc"] == (None, None)
    measured = {"n_r_paper": {}, "cpu_s": {}}
    assert all(finding.holds is None for finding in check("none", measured, None))


def test_the_claims_beside_table_one_itself():
    """The text's 13.5 % against Spiral-STC is not in its own table; all else is."""
    said = {(claim.figure, claim.against): contradiction(claim) for claim in CLAIMS}
    against_spiral = said.pop(("n_r_paper", "spiral-stc"))
    assert against_spiral == "By Table I itself it would be 35.8-38.6 % less."
    assert set(said.values()) == {""}
    office = TABLE_I[0]
    assert paper_change(CLAIMS[0], office) == pytest.approx(100 * (30 / 34 - 1))
    assert paper_change(CLAIMS[4], office) is None
