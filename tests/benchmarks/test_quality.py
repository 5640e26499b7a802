"""Benchmark of quality: judged walks, other planners' results, goals, and a small run."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import NO_WORK, CoverageCost
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.__main__ import main
from tests.benchmarks.harness import WrongWalkError, judged, planner_for
from tests.benchmarks.quality.benchmark import report
from tests.benchmarks.quality.figures import by_grid
from tests.benchmarks.quality.runs import (
    Known,
    OtherWalk,
    QualityPlan,
    QualityRun,
    Setting,
    measure,
    read_references,
)

OPEN = Setting("anywhere", "steps", "ants")
CLOSED = Setting("home", "steps", "ants")
TURNS = Setting("anywhere", "turns", "ants")


def walk(steps, quarter=0, half=0, full=True, home=False):
    return {
        "full": full,
        "steps": steps,
        "turns_90": quarter,
        "turns_180": half,
        "returns_home": home,
    }


@pytest.fixture
def room(tmp_path):
    """A room of 6 x 7 cells with a pillar: 41 cells; in what others reached, too."""
    free = np.ones((6, 7), bool)
    free[2, 3] = False
    np.save(tmp_path / "room.npy", free)
    results = {"lkh_open": walk(40, 20), "lkh_closed": walk(42, 12, home=True)}
    known = {"cells": 41, "results": results, "bounds": {"block_open": 40}}
    (tmp_path / "results.json").write_text(json.dumps({"room": known}))
    return tmp_path


def known_of(tmp_path, **grid):
    file = tmp_path / "results.json"
    file.write_text(json.dumps({"grid": {"results": {}, **grid}}))
    return read_references(file)["grid"]


def test_best_known_is_the_optimum_or_the_tour_solvers_walk(tmp_path):
    results = {
        "lkh_open": walk(105),
        "lkh_closed": walk(112, home=True),
        "spiral": walk(101, home=True),
        "lost": walk(90, full=False),
    }
    known = known_of(tmp_path, results=results, proven_optimum={"open_steps": 104})
    assert (known.open.best_steps, known.open.optimum) == (104, 104)
    assert (known.closed.best_steps, known.closed.optimum) == (112, None)
    assert {one.planner for one in known.open.walks} == {"lkh_open", "lkh_closed", "spiral"}
    assert {one.planner for one in known.closed.walks} == {"lkh_closed", "spiral"}
    # Of a spiral alone nobody would say that it is the best known.
    assert known_of(tmp_path, results={"spiral": walk(101)}).open.best_steps is None


def test_bounds_are_whole_steps(tmp_path):
    bounds = {"block_open": 171, "hk_open": 173.5, "hk_closed": 176.0000001}
    known = known_of(tmp_path, bounds=bounds)
    assert (known.open.bound, known.closed.bound) == (174, 176)


def test_quickest_by_mission_time():
    slow, quick = OtherWalk("short", 100, 40, 2, False), OtherWalk("straight", 120, 8, 1, True)
    known = Known((slow, quick))
    assert slow.mission_s(1.5) == 166.0
    assert known.quickest(1.5) is quick
    assert known.quickest(0.0) is slow
    assert Known().quickest(1.5) is None


@pytest.mark.parametrize("text", ["[1]", "{", '{"grid": {}}', '{"grid": {"results": {"a": {}}}}'])
def test_other_files_are_not_results(text, tmp_path):
    file = tmp_path / "results.json"
    file.write_text(text)
    with pytest.raises(BadConfiguration, match=r"results\.json"):
        read_references(file)


def test_missing_results_are_an_error(tmp_path):
    with pytest.raises(BadConfiguration, match="cannot read"):
        read_references(tmp_path / "none.json")


def path_of(problem, cells, **given):
    cells = np.array(cells, np.int32)
    figures = {"cost_s": problem.cost.of_walk(cells), **given}
    return CoveragePath(cells, planner="test", seed=0, **figures)


SQUARE = [(0, 0), (0, 1), (1, 1), (1, 0)]


@pytest.mark.parametrize(
    ("cells", "given", "wrong"),
    [
        (SQUARE[:3], {}, "never visited"),
        ([(0, 0), (1, 1), (0, 1), (1, 0)], {}, "jumps"),
        (SQUARE[::-1], {}, "starts at"),
        (SQUARE, {"cost_s": 6.5}, "said to cost 6.5 s"),
        (SQUARE, {"lower_bound_steps": 4}, "below the bound of 4"),
    ],
)
def test_wrong_walks_are_refused(cells, given, wrong):
    lattice = CoverageLattice.from_free(np.ones((2, 2), bool))
    problem = CoverageProblem.of(lattice, (0, 0), cost=CoverageCost(1.0, 1.5))
    assert judged(problem, path_of(problem, SQUARE)).turns_90 == 2
    with pytest.raises(WrongWalkError, match=wrong):
        judged(problem, path_of(problem, cells, **given))


def test_a_walk_that_does_not_return_home_is_refused():
    lattice = CoverageLattice.from_free(np.ones((2, 2), bool))
    problem = CoverageProblem.of(lattice, (0, 0), end=(0, 0))
    with pytest.raises(WrongWalkError, match="ends at"):
        judged(problem, path_of(problem, SQUARE))


def run_of(grid="grid", setting=OPEN, budget_s=1.0, seed=0, steps=100, **given):
    run = QualityRun(
        grid=grid,
        cells=100,
        known=Known(),
        setting=setting,
        budget_s=budget_s,
        seed=seed,
        steps=steps,
        revisits=steps - 99,
        turns_90=10,
        turns_180=1,
        mission_s=steps + 18.0,
        bound=99,
        first_walk_s=1e-3,
        wall_s=budget_s + 2e-3,
        work=NO_WORK,
    )
    return replace(run, **given)


def goals_of(runs, turn_s=1.5):
    return {(goal.what, goal.limit): goal.measured for goal in report(turn_s, 1, runs).goals}


def test_goals_of_open_walks_are_of_the_worst_grid():
    solved, proven = Known(best_steps=200), Known(best_steps=100, optimum=100)
    runs = [run_of("big", known=solved, seed=s, steps=200 + s) for s in range(3)]
    runs += [run_of("small", known=proven, seed=s, steps=100 + 2 * s) for s in range(3)]
    # Nobody knows how good it could be here, so there is nothing to reach.
    runs.append(run_of("unknown", steps=900))
    to_best = "open walk, 1 s: steps to the best known"
    assert goals_of(runs) == {
        (f"{to_best}, median, worst of 2 grids (small)", 1.005): 1.02,
        (f"{to_best}, worst seed, worst of 2 grids (small)", 1.01): 1.04,
        (
            "open walk, 1 s: steps above the proven optimum, median, worst of 1 grid (small)",
            0.0,
        ): 2.0,
    }


@pytest.mark.parametrize(("budget_s", "most"), [(0.02, 1.02), (0.1, 1.01), (10.0, 1.002)])
def test_goals_of_other_budgets(budget_s, most):
    goals = goals_of([run_of(known=Known(best_steps=100), budget_s=budget_s)])
    assert [(limit, measured) for (_, limit), measured in goals.items()] == [(most, 1.0)]


def test_goals_count_only_ants():
    never = replace(OPEN, variant="none")
    assert goals_of([run_of(setting=never, known=Known(best_steps=100))]) == {}


def test_goals_of_closed_walks_are_of_the_papers_grids():
    simulated = run_of("paper_simulated", CLOSED, cells=169, revisits=47)
    basement = run_of("paper_basement", CLOSED, cells=520, revisits=55)
    # The name alone does not make it the paper's grid.
    other = run_of("paper_basement", CLOSED, cells=521, revisits=99)
    name = "closed walk, 1 s: n_r_paper, "
    assert goals_of([simulated, basement]) == {
        (f"{name}paper_simulated", 46): 47.0,
        (f"{name}paper_basement", 55): 55.0,
    }
    assert goals_of([other]) == {}


def test_goals_of_mission_time():
    known = Known((OtherWalk("other", 180, 0, 10, False),))
    runs = [
        run_of(name, TURNS, budget_s, known=known, mission_s=mission_s)
        for budget_s in (0.1, 1.0)
        for name, mission_s in (("a", 105.0), ("b", 168.0), ("c", 231.0))
    ]
    what = "mission time, {} s: to the best planner's, {}".format
    assert goals_of(runs) == {
        (what("0.1", "worst of 3 grids (c)"), 1.0): 1.1,
        (what("0.1", "median of 3 grids"), 0.87): 0.8,
        (what("1", "median of 3 grids"), 0.84): 0.8,
    }
    assert goals_of(runs, turn_s=2.0) == {}


def test_ratios_without_results_are_to_the_bound():
    (figures,) = by_grid([run_of(setting=TURNS)])
    assert figures.ratio.median == pytest.approx(100 / 99)
    assert figures.mission_ratio(1.5).median == pytest.approx(118 / 99)


def test_summary_leaves_bounds_out_where_there_are_rivals():
    alone = run_of("alone", steps=108, bound=90)
    rival = run_of("rival", steps=101, known=Known(best_steps=100))
    assert report(1.5, 1, [alone]).rows[0][2:4] == ("1.2000", "1.2000")
    assert report(1.5, 1, [alone, rival]).rows[0][2:4] == ("1.0100", "1.0100")


def test_overshoot_is_that_of_the_slowest_run():
    runs = [run_of(seed=seed, wall_s=wall_s) for seed, wall_s in enumerate((0.4, 1.25, 1.01))]
    (figures,) = by_grid(runs)
    assert figures.overshoot_s == pytest.approx(0.25)


def test_variants_stand_side_by_side():
    settings = [replace(OPEN, variant=variant) for variant in ("ants", "flat", "none")]
    known = Known(best_steps=100)
    runs = [
        run_of(setting=setting, known=known, steps=101 + index)
        for index, setting in enumerate(settings)
    ]
    table = report(1.5, 1, runs).tables[-1]
    assert table.title.startswith("what the ants are worth")
    ratios = ("1.0100\n1.0100", "1.0200\n1.0200", "1.0300\n1.0300")
    assert table.rows == (("grid", "1", *ratios),)


@pytest.mark.parametrize("end", ["anywhere", "home"])
def test_the_benchmark_quality_reports_its_figures(end, room, capsys):
    words = ["--grids", str(room / "room.npy"), "--results", str(room / "results.json")]
    words += ["--budgets", "0.02", "--seeds", "1", "--end", end]
    assert main(["quality", *words, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    by_cost = {grid["cost"]: grid for grid in document["grids"]}
    assert by_cost.keys() == {"steps", "turns"}
    shortest = {"anywhere": 40, "home": 42}[end]
    assert by_cost["steps"]["best_known_steps"] == shortest
    assert by_cost["steps"]["steps"]["median"] == shortest
    assert by_cost["turns"]["mission_s"]["median"] <= by_cost["steps"]["mission_s"]["median"]
    for grid in by_cost.values():
        turns = grid["turns_90"]["median"] + 2 * grid["turns_180"]["median"]
        assert grid["mission_s"]["median"] == grid["steps"]["median"] + 1.5 * turns
        assert grid["first_walk_s"]["median"] < grid["wall_s"]["median"]
        assert (grid["seeds"], grid["cells"], grid["end"]) == (1, 41, end)


def plan_of(folder, **given):
    plan = QualityPlan(
        grids=(str(folder / "room.npy"),),
        settings=(OPEN,),
        budgets=(0.01,),
        seeds=1,
        turn_s=1.5,
        results=folder / "results.json",
    )
    return replace(plan, **given)


def known_room(folder, **grid):
    (folder / "results.json").write_text(json.dumps({"room": {"results": {}, **grid}}))


def test_results_of_another_grid_are_refused(room):
    known_room(room, cells=40)
    with pytest.raises(BadConfiguration, match="41 cells, in the results 40"):
        next(measure(plan_of(room), lambda _: None))


def test_a_walk_shorter_than_the_optimum_is_refused(room):
    known_room(room, proven_optimum={"open_steps": 300})
    with pytest.raises(WrongWalkError, match="fewer than are proven"):
        next(measure(plan_of(room), lambda _: None))


def test_a_bound_above_a_known_walk_is_refused(room):
    known_room(room, results={"lkh_open": walk(39)})
    with pytest.raises(WrongWalkError, match="above a walk of 39"):
        next(measure(plan_of(room), lambda _: None))


def test_each_seed_goes_over_all_grids_first(room):
    np.save(room / "strip.npy", np.ones((1, 9), bool))
    grids = (str(room / "room.npy"), str(room / "strip.npy"))
    runs = list(measure(plan_of(room, grids=grids, seeds=2), lambda _: None))
    assert [(run.seed, run.grid) for run in runs] == [
        (0, "room"),
        (0, "strip"),
        (1, "room"),
        (1, "strip"),
    ]
    assert runs[1].steps >= 8


def test_grid_of_one_cell_is_refused(room):
    np.save(room / "room.npy", np.ones((1, 1), bool))
    with pytest.raises(BadConfiguration, match="one cell only"):
        next(measure(plan_of(room, results=None), lambda _: None))


def test_planner_walks_on_one_thread():
    planner = planner_for(7, "flat")
    assert (planner.config.seed, planner.has_ants) == (7, True)
    assert not planner_for(7, "none").has_ants


@pytest.mark.parametrize("words", [["--budgets", "-1"], ["--end", "there"], ["--cost", "money"]])
def test_impossible_options_are_refused(words, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["quality", *words])
    assert words[0] in capsys.readouterr().err
