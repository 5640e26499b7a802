"""Plans from Python: as the guide shows them, and what is wrong with others."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fasaco_edge as fe
from fasaco_edge.cli import main
from fasaco_edge.errors import BadConfiguration, MapFileError, StartBlocked, StartOutsideMap
from fasaco_edge.offline import result
from fasaco_edge.offline.summary import rows_of
from tests.benchmarks.judge import check_walk
from tests.support.processes import ENVIRONMENT

ROOT = Path(__file__).parents[2]
# The guide's planner, and its plan from Python; tests/test_readers.py runs the whole page.
OWN_PLANNER, OWN_PLAN = (
    block
    for block in re.findall(
        r"```python\n(.*?)```", (ROOT / "fasaco_edge/researcher.md").read_text(), re.S
    )
    if "depth_first" in block
)
QUICK = fe.Search(budget_s=0.05)
# Without local search no clock decides.
COLONY = fe.Search(planner="fasaco", ants=64, seed=3)


def test_a_plan_is_that_of_the_command(tmp_path, capsys):
    walk, line = tmp_path / "walk.csv", tmp_path / "line.csv"
    words = ["--planner", "fasaco", "--ants", "64", "--seed", "3", "--line", "quick", "--json"]
    files = ["--path-out", str(walk), "--xy-out", str(line)]
    assert main(["plan", "office", *words, *files]) == 0
    told = json.loads(capsys.readouterr().out)
    plan = fe.plan(fe.load_map("office"), line="quick", search=COLONY)
    assert (plan.cells == np.loadtxt(walk, int, delimiter=",", skiprows=1)).all()
    assert np.allclose(plan.xy, np.loadtxt(line, delimiter=",", skiprows=1), atol=1e-6)
    figures = json.loads(json.dumps(plan.figures))
    clocks = "wall_s", "cpu_s", "first_walk_ms", "map"
    assert {name: figures[name] for name in figures if name not in clocks} == {
        name: told[name] for name in told if name not in clocks
    }
    assert plan.swept_share == pytest.approx(told["floor"]["swept_share"], abs=1e-4)


def test_an_array_is_covered_from_where_it_is_asked():
    free = np.ones((6, 8), bool)
    free[2:4, 3:5] = False
    plan = fe.plan(fe.load_map(free), start=(5, 7), end="home", search=QUICK)
    lattice = plan.problem.lattice
    verdict = check_walk(lattice.steps, lattice.coverable, plan.cells, (5, 7))
    assert verdict.legal
    assert verdict.complete
    assert plan.cells[-1].tolist() == [5, 7]
    assert plan.line == "cells"
    assert plan.swept_share is None
    assert plan.plot().size[0] > 100


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"robot": fe.Robot(tool_width_m=-1.0)}, BadConfiguration, "tool_width_m"),
        ({"robot": fe.Robot(speed_m_s=float("nan"))}, BadConfiguration, "speed_m_s"),
        ({"line": "straight"}, BadConfiguration, "line must be one of cells, quick, thorough"),
        ({"align": "north"}, BadConfiguration, "align must be walls, axes or an angle"),
        ({"align": 30.0, "line": "cells"}, BadConfiguration, "along the axes of the map frame"),
        ({"start": (0, 0), "start_xy": (0.0, 0.0)}, BadConfiguration, "start and start_xy"),
        ({"start": (10**11, 0)}, BadConfiguration, "start must be a cell"),
        ({"end": (1.5, 2)}, BadConfiguration, "end must be anywhere, home or a cell"),
        ({"align": 1e400}, BadConfiguration, "align must be"),
        ({"map": "office"}, BadConfiguration, "map must be what load_map returns, got office"),
        ({"robot": {"radius_m": 0.2}}, BadConfiguration, "must be a Robot, got {'radius_m': 0.2}"),
        ({"search": {"seed": 1}}, BadConfiguration, "must be a Search, got {'seed': 1}"),
        ({"start": 5}, BadConfiguration, r"must be a cell \(row, col\), got 5"),
        ({"start": (0.0, 0.0)}, BadConfiguration, r"must be a cell \(row, col\), got \(0.0, 0.0\)"),
        ({"start_xy": 5}, BadConfiguration, r"must be a point \(x, y\) \[m\], got 5"),
        ({"start_xy": ("1", "2")}, BadConfiguration, "start_xy must be a point"),
        ({"start_xy": (10**400, 0)}, BadConfiguration, "start_xy must be a point"),
        ({"start_xy": (0.0, np.nan)}, BadConfiguration, "start_xy must be a point"),
        ({"end": None}, BadConfiguration, r"home or a cell \(row, col\), got None"),
        ({"end": "nowhere"}, BadConfiguration, r"home or a cell \(row, col\), got nowhere"),
        ({"start": (-90, 0)}, StartOutsideMap, "is outside the map"),
        ({"start_xy": (-3.5, -3.5)}, StartBlocked, "does not fit"),
        ({"search": fe.Search(ants=0)}, BadConfiguration, "ants: must be in"),
    ],
)
def test_a_plan_says_what_is_wrong_with_it(options, error, said):
    with pytest.raises(error, match=said):
        fe.plan(**({"map": fe.load_map("office"), "search": QUICK} | options))


def test_to_import_the_package_loads_no_planner():
    code = "import sys, fasaco_edge; sys.exit('numpy' in sys.modules)"
    assert (
        subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=False).returncode == 0
    )
    assert {"plan", "load_map", "Search"} <= set(dir(fe))
    with pytest.raises(AttributeError, match="no attribute 'plot'"):
        _ = fe.plot


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"ants": 8.5}, "ants must be a whole number, got 8.5"),
        ({"budget_s": "1"}, "budget_s must be a number, got 1"),
        ({"threads": None}, "threads must be a whole number, got None"),
        ({"velocities": 4}, "velocities must be a text, got 4"),
        *(({"budget_s": s}, "budget must be finite and above 0 s") for s in (0.0, -1.0, np.nan)),
        ({"budget_s": float("inf")}, "budget must be finite and above 0 s"),
    ],
)
def test_a_search_s_members_have_their_kinds(words, said):
    with pytest.raises(BadConfiguration, match=said):
        fe.Search(**words)


def test_numbers_of_numpy_s_are_numbers():
    search = fe.Search(seed=np.int64(3), budget_s=np.float32(0.05))
    cells = np.argwhere(np.ones((3, 3), bool))
    grid = fe.load_map(np.ones((3, 3), bool))
    planned = fe.plan(grid, start=cells[0], end=cells[-1], search=search)
    assert planned.cells[[0, -1]].tolist() == [[0, 0], [2, 2]]
    there = fe.plan(grid, start_xy=np.array([0.4, 0.7]), search=search)
    assert there.cells[0].tolist() == [2, 1]


@pytest.mark.parametrize(
    ("source", "option", "said"),
    [
        *((it, {}, "a map is a file, the name of a") for it in (None, 5, [[True]], b"office")),
        *((it, {}, "bool") for it in (np.ones(4, bool), np.ones((3, 3)), np.empty((0, 3), bool))),
        (np.ones((3, 3), bool), {"resolution_m": 0.1}, "is for maps of pixels"),
        (np.ones((3, 3), bool), {"unknown_free": True}, "is for maps of pixels"),
    ],
)
def test_a_file_that_is_no_map_is_named(source, option, said):
    with pytest.raises(MapFileError, match=said):
        fe.load_map(source, **option)


def test_a_picture_that_cannot_be_written_is_named_in_the_error(tmp_path):
    planned = fe.plan(fe.load_map(np.ones((3, 3), bool)), search=fe.Search(budget_s=0.05))
    with pytest.raises(FileNotFoundError, match=r"nowhere/walk\.png"):
        planned.plot(tmp_path / "nowhere" / "walk.png")


def test_a_time_says_whether_turns_count(capsys):
    map, paper = fe.load_map("office"), fe.Robot(quarter_turn_s=0.0)
    for robot, said in ((fe.Robot(), " s,"), (paper, " s without turns,")):
        planned = fe.plan(map, robot, line="cells", search=COLONY)
        assert planned.drive.time + "," in repr(planned)
        assert said in repr(planned)
    assert main(["plan", "office", "--planner", "fasaco", "--ants", "64"]) == 0
    assert " s without turns (" in " ".join(capsys.readouterr().out.split())
    assert main(["plan", "office", "--planner", "fasaco", "--ants", "64", "--turn-s", "1.5"]) == 0
    assert "without turns" not in capsys.readouterr().out


def test_the_picture_has_the_figures_of_the_summary(monkeypatch):
    told = []
    draw = result.draw_walk
    monkeypatch.setattr(
        result,
        "draw_walk",
        lambda *given, lines, **more: told.extend(lines) or draw(*given, lines=lines, **more),
    )
    planned = fe.plan(fe.load_map("office"), search=QUICK)
    planned.plot()
    (turns,) = re.findall(r"[\d,]+ quarter-turns", "\n".join(told))
    assert turns in repr(planned)
    assert turns in dict(rows_of(planned))["line"]


def test_a_search_beyond_its_budget_says_why():
    plan = fe.plan(fe.load_map("office"), search=fe.Search(budget_s=0.01))
    why = "the first line took longer than the budget of 0.01 s"
    assert dict(rows_of(plan))["search"] == f"{plan.wall_s:.1f} s: {why}"


def test_the_row_of_a_curve_repeats_no_figure_of_the_line():
    office, quick = fe.load_map("office"), fe.Search(budget_s=0.01)
    for reverses, end in ((True, " between forward and backward"), (False, ", forward only")):
        robot = fe.Robot(turn_radius_m=0.3, reverses=reverses)
        rows = dict(rows_of(fe.plan(office, robot, line="quick", search=quick)))
        assert rows["curve"].startswith("arcs of 0.3 m or more, ")
        assert rows["curve"].endswith(end)
        assert rows["line"].split()[1] not in rows["curve"]


def test_a_summary_names_the_size_of_the_map():
    """A resolution of 5 in place of 0.05 shows there, and nowhere else."""
    office = fe.plan(fe.load_map("office"), line="cells", search=QUICK)
    assert dict(rows_of(office))["map"] == "office.yaml, 7.7 x 9.0 m, 334 cells of 0.3 m"
    cell = fe.plan(fe.load_map(np.ones((1, 1), bool)), search=QUICK)
    assert ", 1 cell of " in dict(rows_of(cell))["map"]


def test_the_bound_of_a_coverage_grid_is_that_of_its_walk():
    """A row gap called it a time without turns, although the bound counts turns."""
    planned = fe.plan(fe.load_map(np.ones((4, 5), bool)), search=QUICK)
    assert planned.drive.turns > 0
    assert "gap" not in (rows := dict(rows_of(planned)))
    assert rows["walk"].endswith(", at most 0.0 % above its bound")


def test_a_plan_is_one_line_of_text_and_a_picture():
    office = fe.load_map("office")
    planned = fe.plan(office, search=QUICK)
    free = fe.load_map(np.ones((4, 5), bool))
    passes = fe.plan_passes(office, passes=["edge", "auto"], search=QUICK)
    for shown in (office, free, planned, fe.plan(free, search=QUICK), passes):
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 200
    assert re.fullmatch(
        r"<Plan office.yaml, colony-search: 9\d\.\d % of 40.9 m2 swept, \d+ min \d\d s, "
        r"[\d.]+ m, \d+ quarter-turns, \d+ % above \d+ min \d\d s, the time to sweep as much .*>",
        repr(planned),
    )
    assert dict(rows_of(planned))["gap"].removeprefix("line: ") in repr(planned)
    assert "40.9 m2 (" in repr(passes)
    for drawn in (planned, passes):
        with Image.open(io.BytesIO(drawn._repr_png_())) as picture:
            assert picture.size == drawn.plot().size
