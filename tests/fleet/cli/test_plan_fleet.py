"""``fasaco-edge plan --robots``: its figures are counted again here, from the walks it wrote."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.cli import main
from fasaco_edge.cli.console.arguments import Exit
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map


@pytest.fixture
def plan(capsys):
    def run(*words):
        code = main(["plan", *map(str, words)])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def grid(tmp_path):
    free = np.ones((12, 18), np.bool_)
    free[4:7, 5:9] = False
    free[0, 17] = False
    file = tmp_path / "hall.npy"
    np.save(file, free)
    return file


def walks_of(file):
    rows = np.loadtxt(file, delimiter=",", skiprows=1, dtype=np.int64)
    return [rows[rows[:, 0] == robot][:, 1:] for robot in np.unique(rows[:, 0])]


@pytest.mark.parametrize("end", ["home", "anywhere"])
def test_the_figures_are_those_of_the_walks(plan, grid, tmp_path, end):
    file, picture = tmp_path / "walks.csv", tmp_path / "fleet.png"
    starts = ["0,0", "11,17", "3,9"]
    words = ["--end", end, "--budget", 0.3, "--path-out", file, "--png", picture, "--json"]
    code, out, _ = plan(grid, "--robots", *starts, *words)
    assert code == 0
    told, walks = json.loads(out), walks_of(file)
    assert file.read_text().startswith("robot,row,col\n")
    assert [",".join(map(str, walk[0])) for walk in walks] == starts
    passed = [{tuple(cell) for cell in walk.tolist()} for walk in walks]
    assert len(set.union(*passed)) == told["cells"] == 12 * 18 - 13
    steps = [len(walk) - 1 for walk in walks]
    assert [robot["steps"] for robot in told["robots"]] == steps
    assert told["makespan_steps"] == max(steps)
    assert told["makespan_s"] == max(robot["cost_s"] for robot in told["robots"])
    assert told["lower_bound_makespan_steps"] <= max(steps)
    assert told["gap"] == pytest.approx(
        max(steps) / told["lower_bound_makespan_steps"] - 1, abs=1e-6
    )
    alone = sum(
        len(cells - set.union(*(passed[:n] + passed[n + 1 :]))) for n, cells in enumerate(passed)
    )
    assert told["swept_twice"] == told["cells"] - alone
    for robot, walk in zip(told["robots"], walks, strict=True):
        assert robot["end"] == walk[-1].tolist()
        assert (robot["end"] == robot["start"]) or end == "anywhere"
    with Image.open(picture) as drawn:
        assert drawn.width > 300


@pytest.mark.parametrize(
    "places",
    [
        [(1, 1), (3, 2.5)],
        [(-3, -2), (1, 1)],
        [(1, 1), (-3, -2), (-2, 1), (0.5, -1), (-1, -1)],
    ],
    ids=str,
)
def test_points_of_a_map_are_cells_of_it(plan, tmp_path, places):
    # Around the frame's origin, as maps of slam_toolbox are.
    origin = Pose2D(-4.0, -3.0)
    room = OccupancyGrid(GridGeometry(140, 180, 0.05, origin), np.zeros((140, 180), np.int8))
    file, xy = tmp_path / "room.yaml", tmp_path / "xy.csv"
    write_map(room, file)
    starts = ["--robots-xy", *(f"{x:g},{y:g}" for x, y in places)]
    code, out, _ = plan(file, *starts, "--xy-out", xy, "--budget", 0.2, "--json")
    assert code == 0
    told = json.loads(out)
    rows = np.loadtxt(xy, delimiter=",", skiprows=1)
    assert xy.read_text().startswith("robot,x_m,y_m\n")
    for number, (x, y) in enumerate(places, 1):
        first = rows[rows[:, 0] == number][0, 1:]
        assert np.abs(first - (x, y)).max() <= told["cell_m"] / 2 + 1e-6
    assert len(told["robots"]) == len(places)


@pytest.mark.parametrize(
    "starts",
    [
        ["--robots", "-1,0", "0,0", "-2,-3"],
        ["--robots=-1,0", "--robots", "0,0", "-2,-3"],
    ],
    ids=" ".join,
)
def test_cells_left_of_and_below_the_first_can_be_named(plan, grid, starts):
    code, _, err = plan(grid, *starts, "--budget", 0.1)
    assert code == Exit.ERROR
    assert "robot 1: start cell (-1, 0) lies outside" in " ".join(err.split())


def test_points_of_a_grid_without_a_frame_are_refused(plan, grid, tmp_path):
    xy = tmp_path / "xy.csv"
    code, _, err = plan(grid, "--robots", "0,0", "0,5", "--budget", 0.1, "--xy-out", xy)
    assert code == Exit.CONFIG
    assert "which lies in no map frame" in " ".join(err.split())
    assert not xy.exists()


def test_the_gap_excludes_turns_and_each_figure_is_explained(plan, grid, capsys):
    words = ["--turn-s", 3, "--budget", 0.2, "--json"]
    _, out, _ = plan(grid, "--robots", "0,0", "11,17", *words)
    told = json.loads(out)
    least = told["lower_bound_makespan_steps"]
    assert told["gap"] == pytest.approx(told["makespan_steps"] / least - 1, abs=1e-6)
    with pytest.raises(SystemExit):
        main(["plan", "--help"])
    explained = capsys.readouterr().out.partition("figures of several robots:")[2]
    for figure in ("gap", "balance", "swept_twice", "unreachable_cells", "rounds"):
        assert f"\n  {figure}" in explained


def test_without_json_it_prints_a_line_for_each_robot(plan, grid):
    code, out, _ = plan(grid, "--robots", "0,0", "11,17", "--budget", 0.1, "--long")
    assert code == 0
    assert "makespan steps" in out
    assert "robot 2: from [11, 17]" in out
    code, out, _ = plan(grid, "--robots", "0,0", "11,17", "--budget", 0.1)
    assert re.search(r"^time +\d+ .*, of the robot that takes longest", out, re.MULTILINE)
    assert "robot 2: from [11, 17]" in out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--robots", "0,0", "0,0"], "robots 1 and 2 both start in cell (0, 0)"),
        (["--robots", "0,0", "4,5"], "robot 2: start cell (4, 5) is blocked"),
        (["--robots", "0,0", "99,5"], "robot 2: start cell (99, 5) lies outside"),
        (["--robots", "0,0", "--end", "1,1"], "cannot end in one cell"),
        (["--robots", "0,0", "--planner", "aco"], "planned for by colony-search"),
        (["--robots", "0,0", "--align", "walls"], "--align"),
        (["--robots", "0,0", "--overlap", "0.1"], "--overlap"),
        (["--robots", "0,0", "--clearance", "0.02"], "--clearance"),
        (
            ["--robots", *(f"0,{col}" for col in range(17)), *(f"1,{c}" for c in range(17))],
            "at most 33",
        ),
    ],
)
def test_what_cannot_be_is_told(plan, grid, words, complaint):
    code, _, err = plan(grid, *words)
    assert code != 0
    assert complaint in " ".join(err.split())
