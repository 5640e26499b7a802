"""A planner of the user's own: the guide's example, and what is said of one that is wrong."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

import fasaco_edge as fe
from fasaco_edge.cli import main
from fasaco_edge.errors import BadConfiguration, IllegalWalk, PlannerFailed
from fasaco_edge.planners.own.loading import CALLED_WITH
from fasaco_edge.planners.registry import PLANNER_NAMES
from tests.offline.test_plan import OWN_PLAN, OWN_PLANNER
from tests.support.processes import ENVIRONMENT

#   . # .
#   . . .   row 0 is below
FREE = np.array([[True, True, True], [True, False, True]])
WALK = [(1, 0), (0, 0), (0, 1), (0, 2), (1, 2)]


class Rude(list):
    """What a planner may return by mistake: code of his runs wherever it is looked at."""

    def __iter__(self):
        raise RuntimeError("not to be looked at")

    @property
    def show(self):
        """Return what cannot even be shown."""
        return type("Shy", (), {"__repr__": Rude.__iter__})()


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "mine.py").write_text(OWN_PLANNER)
    return tmp_path / "mine.py"


def plan(function, **options):
    return fe.plan(fe.load_map(FREE), start=(1, 0), planner=function, **options)


def test_the_guide_s_planner_runs_and_is_drawn(mine, capsys):
    picture, walk = mine.with_suffix(".png"), mine.with_suffix(".csv")
    words = ["--end", "home", "--png", str(picture), "--path-out", str(walk)]
    assert main(["plan", "office", "--planner", f"{mine}:depth_first", *words]) == 0
    assert "mine.py:depth_first" in capsys.readouterr().out
    # There and back along a tree.
    cells = np.loadtxt(walk, int, delimiter=",", skiprows=1)
    assert len(cells) == 2 * len(np.unique(cells, axis=0)) - 1
    assert picture.exists()
    said = subprocess.run(
        [sys.executable, "-c", OWN_PLAN],
        cwd=mine.parent,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    ).stdout.split()
    assert said[:2] == ["mine.py:depth_first", str(len(cells) - 1)]
    assert picture.exists()


def test_a_module_of_one_s_own_is_found_by_its_name(mine, monkeypatch, capsys):
    package = mine.parent / "lab_of_mine"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "walks.py").write_text(
        f"{OWN_PLANNER}\n\nclass Deep:\n    def plan(self, problem):\n"
        "        return depth_first(problem)\n\n\nclass NoPlan: ...\n\n\n"
        "class Needy:\n    def __init__(self, depth): ...\n\n    plan = Deep.plan\n"
    )
    monkeypatch.syspath_prepend(str(mine.parent))
    for name in ("Deep", "depth_first"):
        words = ["plan", "office", "--planner", f"lab_of_mine.walks:{name}", "--json"]
        assert main(words) == 0
        assert json.loads(capsys.readouterr().out)["planner"] == f"lab_of_mine.walks:{name}"
    for place, code, said in (
        ("lab_of_mine.walks:Wide", 78, "has no 'Wide'\n  hint: it has depth_first, Deep, NoPlan"),
        ("lab_of_mine.walks:NoPlan", 78, "must be a function, or a class with plan(self, problem)"),
        ("lab_of_mine.walks:Needy", 1, "Needy: TypeError:"),
        ("lab_of_mine.no:Deep", 78, "finds no module 'lab_of_mine.no'"),
        ("lab_of_yours:Deep", 78, "finds no module 'lab_of_yours'"),
        ("json:loads", 1, "planner json:loads: TypeError"),
    ):
        assert main(["plan", "office", "--planner", place]) == code
        assert said in capsys.readouterr().err


def test_from_python_a_class_and_its_object_are_planners_too():
    class Walk:
        def plan(self, problem):
            return WALK

    for planner in (Walk, Walk()):
        assert plan(planner).figures["planner"] == "test_own_planner.py:Walk"
    with pytest.raises(BadConfiguration, match="must be a function, or a class with plan"):
        plan(WALK)


def test_bench_shows_the_planner_as_a_row(mine, capsys):
    np.save(mine.parent / "room.npy", np.ones((4, 5), bool))
    # Another planner of that name, which does not end at home.
    other = mine.parent / "other" / "mine.py"
    other.parent.mkdir()
    other.write_text(
        OWN_PLANNER + "\n\ndef rows(problem):\n"
        "    return [(r, c if r % 2 == 0 else 4 - c) for r in range(4) for c in range(5)]\n\n\n"
        "depth_first = rows\n"
    )
    places = [f"{mine}:depth_first", f"{other}:depth_first"]
    words = ["--grids", str(mine.parent / "room.npy"), "--seeds", "2", "--budget", "0.1", "--json"]
    own = [word for place in places for word in ("--planner", place)]
    assert main(["bench", "planners", *own, *words]) == 0
    (grid,) = json.loads(capsys.readouterr().out)["grids"]
    rows = {row["planner"]: row for row in grid["rows"]}
    assert list(rows) == [*PLANNER_NAMES, *places]
    # There and back along a tree over 20 cells; row by row, and one walk over them.
    assert [rows[place]["steps"]["median"] for place in places] == [38, 19]
    assert rows["colony-search"]["steps"]["median"] == grid["bound_steps"] == 19
    assert all(row["runs"] == 2 for row in rows.values())


def test_bench_continues_after_a_failed_planner(mine, capsys):
    np.save(mine.parent / "room.npy", np.ones((4, 5), bool))
    mine.write_text("def short(problem):\n    return [problem.start]\n")
    words = ["--grids", str(mine.parent / "room.npy"), "--seeds", "2", "--budget", "0.1"]
    bench = ["bench", "planners", "--planner", f"{mine}:short", *words]
    assert main([*bench, "--json"]) == 1
    told = capsys.readouterr()
    assert told.err.count("its walk leaves 19 of 20 cells") == 1
    (grid,) = json.loads(told.out)["grids"]
    *others, failed = grid["rows"]
    assert (failed["runs"], failed["failed"], failed["code"]) == (0, 2, "illegal_walk")
    assert [row["planner"] for row in others] == list(PLANNER_NAMES)
    assert all(row["runs"] == 2 and "failed" not in row for row in others)
    assert main(bench) == 1
    assert re.search(r"mine\.py:short +failed +- ", capsys.readouterr().out)


def test_an_own_planner_gets_a_read_only_and_correct_problem():
    got = []

    def watching(problem):
        got.append(problem)
        yield from np.array(WALK)

    result = plan(watching, search=fe.Search(seed=7))
    (problem,) = got
    assert (result.cells == WALK).all()
    assert result.figures["planner"] == "test_own_planner.py:watching"
    assert (problem.to_cover == FREE).all()
    assert problem.neighbours((0, 0)) == [(0, 1), (1, 0)]
    assert (problem.start, problem.end, problem.seed) == ((1, 0), None, 7)
    for array in (problem.to_cover, problem.steps):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = False


@pytest.mark.parametrize(
    ("walk", "said"),
    [
        ([], "its walk is empty"),
        (WALK[1:], r"must begin in the start cell \(1, 0\), begins in \(0, 0\)"),
        (WALK[:-1], r"leaves 1 of 5 cells, the first is \(1, 2\)"),
        ([*WALK[:2], (0, 2)], r"step 2 of its walk, \(0, 0\) to \(0, 2\), is not to a neighbour"),
        ([(1, 0), (1, 1)], r"step 1 .* is to a cell that is not free"),
        ([(1, 0), (1, -1)], "step 1 .* leaves the grid of 2 x 3 cells"),
        ([(1, 0), (0, 0.5)], r"cell 1 of its walk must be \(row, col\), got \(0, 0.5\)"),
        ([(1, 0), 3], r"cell 1 of its walk must be \(row, col\), got 3"),
        ([(1, 0), (0, 0)] * 10_000, "its walk does not end"),
        (None, "it must return cells, got None"),
        (np.array(3), "it must return cells, got array"),
        ([Rude((1, 0))], "RuntimeError: not to be looked at"),
        ([Rude((1, 0)).show], r"cell 0 of its walk must be \(row, col\), got <"),
        (["x" * 10_000_000], r"must be \(row, col\), got 'x{90,100}\.\.\."),
    ],
)
def test_an_illegal_walk_is_an_error_with_the_step(walk, said):
    with pytest.raises((IllegalWalk, PlannerFailed), match=said) as caught:
        plan(lambda problem: walk)
    assert ("return cells" in caught.value.hint) == (caught.type is IllegalWalk)


@pytest.mark.parametrize("planner", [lambda: WALK, type("Needy", (), {"plan": lambda self: WALK})])
def test_a_planner_that_cannot_be_called_gets_a_hint(planner):
    with pytest.raises(PlannerFailed, match="TypeError") as caught:
        plan(planner)
    assert caught.value.hint == CALLED_WITH


def test_a_walk_ends_where_it_was_asked_to():
    with pytest.raises(IllegalWalk, match=r"must end in cell \(1, 0\), ends in \(1, 2\)"):
        plan(lambda problem: WALK, end="home")


def test_an_exception_shows_only_lines_of_the_user(mine, capsys):
    mine.write_text("def deep(x):\n    return 1 / x\n\n\ndef walk(problem):\n    return deep(0)\n")
    assert main(["plan", "office", "--planner", f"{mine}:walk"]) == 1
    said = capsys.readouterr().err
    assert "ZeroDivisionError: division by zero" in said
    assert said.index(f"{mine}:2, in deep: return 1 / x") < said.index(f"{mine}:6, in walk:")
    assert "fasaco_edge/" not in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import sys\nsys.exit()\n", "SystemExit"),
        ("import sys\ndef walk(problem):\n    sys.exit(0)\n", "SystemExit: 0"),
        ("def walk(problem):\n    raise GeneratorExit\n", "GeneratorExit"),
        ("def walk(problem):\n    raise OSError(28, 'full')\n", "OSError: [Errno 28] full"),
    ],
)
def test_a_planner_that_exits_is_an_error(mine, text, said, capsys):
    mine.write_text(text)
    assert main(["plan", "office", "--planner", f"{mine}:walk"]) == 1
    told = capsys.readouterr().err
    assert said in told
    assert "hint: the lines are those of your own file" in told


ENDLESS = """
import signal
import time

def loops(problem):
    while True:
        pass

def sleeps(problem):
    time.sleep(600)

def yields(problem):
    yield problem.start
    while True:
        pass

def catches(problem):
    try:
        while True:
            pass
    except Exception:
        return [problem.start]
"""


@pytest.mark.parametrize(
    ("name", "line"), [("loops", 7), ("sleeps", 10), ("yields", 15), ("catches", 20)]
)
def test_a_budget_ends_a_planner_that_does_not_end(mine, name, line, capsys):
    mine.write_text(ENDLESS)
    assert main(["plan", "office", "--planner", f"{mine}:{name}", "--budget", "0.2"]) == 1
    told = capsys.readouterr().err
    assert f"planner mine.py:{name}: no walk after 0.2 s, its budget\n" in told
    assert any(f"{mine}:{near}, in {name}: " in told for near in (line - 1, line))
    # Nothing is left of the limit.
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL


def test_an_interrupted_bench_says_where_and_keeps_the_others(mine, capsys):
    mine.write_text("def interrupted(problem):\n    raise KeyboardInterrupt\n")
    np.save(mine.parent / "room.npy", np.ones((4, 5), bool))
    words = ["--grids", str(mine.parent / "room.npy"), "--seeds", "1", "--budget", "0.1"]
    assert main(["bench", "planners", "--planner", f"{mine}:interrupted", *words]) == 130
    told = capsys.readouterr().out
    assert "interrupted in room: mine.py:interrupted, seed 0; these are" in told
    assert all(name in told for name in PLANNER_NAMES)


def test_a_program_s_own_timer_is_left_alone():
    signal.setitimer(signal.ITIMER_REAL, 500.0)
    try:
        assert plan(lambda problem: WALK, search=fe.Search(budget_s=5.0)).steps == 4
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 500.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@pytest.mark.parametrize(
    ("text", "name", "error", "said"),
    [
        ("def walk(problem:\n", "walk", PlannerFailed, "mine.py:1: def walk"),
        ("import nowhere_to_be_found\n", "walk", PlannerFailed, "mine.py:1, in <module>: import"),
        ("def one(problem): ...\n", "two", BadConfiguration, "has no 'two'"),
        (None, "walk", BadConfiguration, "cannot read"),
    ],
)
def test_a_file_that_cannot_be_loaded_is_an_error(mine, text, name, error, said, capsys):
    if text is None:
        mine.unlink()
    else:
        mine.write_text(text)
    assert main(["plan", "office", "--planner", f"{mine}:{name}"]) == (
        78 if error is BadConfiguration else 1
    )
    assert said in capsys.readouterr().err


def test_no_configuration_names_a_file(mine, tmp_path, capsys):
    config = tmp_path / "robot.yaml"
    config.write_text(f"planner:\n  name: {mine}:depth_first\n")
    assert main(["check-config", str(config)]) == 78
    with pytest.raises(BadConfiguration, match="planner must be one of"):
        fe.Search(planner=f"{mine}:depth_first")
