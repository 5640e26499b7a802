"""Growth fitted, gaps noted, goals drawn from runs; and the whole benchmark, small."""

import json
from dataclasses import asdict

import pytest

from fasaco_edge.bench.benchmark import Goal
from fasaco_edge.errors import BadConfiguration, ProcessEnded
from fasaco_edge.planners.cost import NO_WORK
from fasaco_edge.planners.planner import SearchProgress
from tests.benchmarks.__main__ import main
from tests.benchmarks.scale.benchmark import budgets, planned
from tests.benchmarks.scale.process import GapWatch, ScaleRun, ScaleTask, SizedRun
from tests.benchmarks.scale.report import exponent, growth, report


def run_of(cells, seed=0, **given):
    """A run whose first walk takes 1 us a cell, and whose memory is 100 bytes a cell."""
    figures = {
        "cells": cells,
        "seed": seed,
        "budget_s": 6.0,
        "first_walk_s": 1e-6 * cells,
        "target_s": ((0.05, 0.5), (0.03, 2.0)),
        "noted": ((0.5, 0.05), (2.0, 0.03), (5.5, 0.01)),
        "gap": 0.01,
        "steps": cells + cells // 100,
        "lower_bound_steps": cells,
        "wall_s": 6.0,
        "idle_mb": 100.0,
        "peak_mb": 100.0 + 1e-4 * cells,
        "work": asdict(NO_WORK),
        **given,
    }
    return ScaleRun(**figures)


def goals_of(*runs):
    return {goal.what: goal for goal in report(1, runs).goals}


def test_exponent():
    assert exponent([(x, 3.0 * x**1.7) for x in (1.0, 20.0, 500.0)]) == pytest.approx(1.7)
    assert exponent([(5.0, 1.0), (5.0, 2.0)]) is None
    # What took no memory at all has no logarithm.
    assert exponent([(1.0, 0.0), (5.0, 2.0)]) is None


def test_growth_is_of_sizes():
    two = [SizedRun(1000, run_of(990)), SizedRun(100_000, run_of(101_000))]
    assert growth(two) == {
        "first_walk_s": pytest.approx(1.0),
        "own_mb": pytest.approx(1.0, abs=1e-6),
    }
    same = [SizedRun(1000, run_of(990)), SizedRun(1000, run_of(1010))]
    assert growth(same) == {"first_walk_s": None, "own_mb": None}


def test_goals_are_those_of_the_sizes_measured():
    goals = goals_of(SizedRun(5000, run_of(5000)), SizedRun(100_000, run_of(100_000)))
    assert goals.pop("growth of time to first walk: exponent").met
    assert goals.pop("growth of own memory: exponent").met
    assert list(goals.values()) == [
        Goal("5,000 cells: first walk", 0.005, 0.005, "s"),
        # What it came to after five seconds; what came later does not count.
        Goal("100,000 cells: gap within 5 s", 3.0, 3.0, "%"),
        Goal("100,000 cells: memory", 110.0, 300.0, "MB"),
    ]
    late = run_of(100_000, noted=((5.1, 0.01),))
    assert goals_of(SizedRun(100_000, late))["100,000 cells: gap within 5 s"].met is False
    hasty = run_of(100_000, budget_s=4.0)
    assert "100,000 cells: gap within 5 s" not in goals_of(SizedRun(100_000, hasty))


def test_million_cells_have_goals():
    runs = [SizedRun(1_000_000, run_of(1_000_000, budget_s=60.0, first_walk_s=2.1))]
    goals = goals_of(*runs)
    assert [(goal.limit, goal.met) for goal in goals.values()] == [
        (2.0, False),
        (4.0, True),
        (1500.0, True),
    ]


def test_gaps_are_noted_as_they_fall():
    watch = GapWatch(seconds=1e9)
    for steps in (120, 120, 104, 103, 102):
        assert not watch(SearchProgress(NO_WORK, float(steps), steps, 100))
    assert [gap for _, gap in watch.noted] == [0.2, 0.04, 0.03, 0.02]
    assert watch.target_s[0.05] == watch.noted[1][0]
    assert watch.target_s[0.03] == watch.noted[2][0]
    # Too little of a fall to be told.
    watch.note(1.0, 0.0199)
    assert len(watch.noted) == 4
    assert GapWatch(seconds=0.0)(SearchProgress(NO_WORK, 1.0, 1, 0))


def test_budgets():
    assert budgets([1000, 1_000_000], []) == (1.0, 60.0)
    assert budgets([1000, 2000], [0.5]) == (0.5, 0.5)
    assert budgets([1000, 2000], [0.5, 2.0]) == (0.5, 2.0)
    with pytest.raises(BadConfiguration, match="3 sizes, got 2"):
        budgets([1, 2, 3], [1.0, 2.0])


def test_where_a_gap_was_never_reached_the_table_says_so():
    far = run_of(1000, target_s=((0.05, 0.1), (0.03, None)))
    runs = [SizedRun(1000, run_of(1000)), SizedRun(1000, far)]
    (row,) = report(2, runs).rows
    assert row[3:5] == ("0.3\n0.5", "-")


def test_scale(capsys):
    words = ["--sizes", "1000", "2000", "--seeds", "1", "--budget-s", "0.3"]
    assert main(["scale", *words, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [size["size"] for size in document["sizes"]] == [1000, 2000]
    for size in document["sizes"]:
        assert size["cells"]["median"] == pytest.approx(size["size"], rel=0.02)
        assert 0 < size["first_walk_s"]["median"] < size["wall_s"]["median"]
        assert size["idle_mb"]["median"] <= size["peak_mb"]["median"]
        assert 0 <= size["gap"]["median"] < 0.1
        (run,) = size["runs"]
        assert run["steps"] / run["lower_bound_steps"] - 1 == pytest.approx(run["gap"])
        # The gap in the end is noted, if not its last little fall.
        assert run["noted"][-1][1] == pytest.approx(run["gap"], rel=0.02)
    assert document["exponents"]["first_walk_s"] is not None


def test_process_that_fails_says_why(tmp_path):
    with pytest.raises(ProcessEnded, match=r"none\.npy"):
        planned(ScaleTask(str(tmp_path / "none.npy"), 0, 0.1))


@pytest.mark.parametrize("words", [["--sizes", "999"], ["--seeds", "0"], ["--budget-s", "-1"]])
def test_impossible_options_are_refused(words, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["scale", *words])
    assert words[0] in capsys.readouterr().err
