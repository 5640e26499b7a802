"""``fasaco-edge plan``: its figures are counted again here, from the walk it wrote."""

from __future__ import annotations

import json
import math
import re
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.cli import main
from fasaco_edge.cli.console.arguments import Exit
from fasaco_edge.drawing import palette
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.driven_line import DriveLimits, drive_seconds
from fasaco_edge.planners.registry import PLANNER_NAMES
from fasaco_edge.simulation.robot import SimulationConfig
from maps.map_writer import write_map
from tests import naive
from tests.benchmarks.judge import check_walk
from tests.support.processes import fasaco_edge
from tests.support.rooms import coverable_cells, pillared_room

NAMES = """
planner seed ants velocities map line tool_m cell_m lattice_deg start end cells
steps revisits recovered_cells n_r_paper turns_90 turns_180 length_m kicks proposals cost_s
lower_bound_steps lower_bound_cost_s gap first_walk_ms unreachable_cells wall_s cpu_s
ended_by speed_m_s turn_s turn_deg_s turn_deg_s2 acceleration_m_s2 steered_deg budget_s
threads floor
"""
KEYS = set(NAMES.split())


@pytest.fixture
def plan(tmp_path, capsys):
    def run(*words):
        csv = tmp_path / "walk.csv"
        words = [str(word) for word in words]
        if "--budget" not in words and "fasaco" not in words:
            words += ["--budget", "0.05"]
        assert main(["plan", *words, "--json", "--path-out", str(csv)]) == 0
        figures = json.loads(capsys.readouterr().out)
        header, *rows = csv.read_text().splitlines()
        assert header == "row,col"
        return figures, [tuple(int(part) for part in row.split(",")) for row in rows]

    return run


def test_a_room_that_the_robot_cannot_reach_is_not_listed(plan, tmp_path):
    cells = np.full((60, 150), 100, np.int8)
    cells[2:58, 2:70] = cells[2:58, 75:148] = 0
    write_map(
        OccupancyGrid(GridGeometry(60, 150, 0.05, Pose2D(0.0, 0.0)), cells), tmp_path / "two.yaml"
    )
    figures, _ = plan(tmp_path / "two.yaml", "--rooms", "--start-xy", "1.0,1.0")
    assert [room["room"] for room in figures["rooms"]] == [1]
    assert figures["rooms"][0]["area_m2"] == pytest.approx(2.8 * 3.4, abs=0.2)


def test_rooms_are_those_of_the_map(plan, capsys, tmp_path):
    """The hall of the flat, and five rooms around it."""
    picture = tmp_path / "rooms.png"
    figures, _ = plan("flat", "--rooms", "--png", picture)
    assert [room["room"] for room in figures["rooms"]] == [1, 2, 3, 4, 5, 6]
    areas = [room["area_m2"] for room in figures["rooms"]]
    assert areas == pytest.approx([9.3, 5.1, 18.3, 7.0, 9.0, 6.0], abs=0.15)
    floor = figures["floor"]
    swept_m2 = sum(room["swept_share"] * room["reachable_m2"] for room in figures["rooms"])
    assert swept_m2 == pytest.approx(floor["swept_share"] * floor["reachable_m2"], rel=0.01)
    assert all(room["entered"] >= 1 for room in figures["rooms"])
    with Image.open(picture) as image:
        assert image.width > 500
        key = image.crop((0, image.height - 60, image.width, image.height))
        colours = {colour for _, colour in key.getcolors(1 << 16)}
        assert {palette.START, palette.END} <= colours
    assert main(["plan", "flat", "--budget", "0.05", "--rooms"]) == 0
    assert "9.3 m2" in capsys.readouterr().out


ORIGIN = Pose2D(0.0, 0.0)


def room_file(folder, origin=ORIGIN):
    pixels, file = pillared_room(), folder / "room.yaml"
    write_map(OccupancyGrid(GridGeometry(*pixels.shape, 0.05, origin), pixels), file)
    return file


@pytest.fixture
def grid_file(tmp_path):
    free = np.ones((9, 12), bool)
    free[:, 8] = False
    free[3:5, 2:4] = False
    file = tmp_path / "grid.npy"
    np.save(file, free)
    return file


def check(figures, walk, free, start, speed_m_s=0.25, turn_s=0.0):
    """Count the figures of a walk again; all are cells (row, col) from (0, 0) on, also ``free``."""
    grid = np.zeros(np.max(list(free), axis=0) + 1, bool)
    grid[tuple(np.transpose(list(free)))] = True
    steps, cells = CoverageLattice.from_free(grid, 1.0).steps, np.array(walk)
    verdict = check_walk(steps, grid, cells, start, tuple(figures["end"]))
    assert not verdict.problems
    counted = naive.figures(steps, walk)
    assert {name: figures[name] for name in counted} == counted
    area = len(set(walk))
    assert (figures["start"], figures["cells"]) == (list(start), area)
    assert figures["unreachable_cells"] == len(free) - area
    length_m = verdict.steps * figures["cell_m"]
    assert figures["length_m"] == pytest.approx(length_m, abs=1e-3)
    cost_s = length_m / speed_m_s + (verdict.turns_90 + 2 * verdict.turns_180) * turn_s
    assert figures["cost_s"] == pytest.approx(cost_s)
    assert 0 < figures["first_walk_ms"] <= 1e3 * figures["wall_s"]
    assert area - 1 <= figures["lower_bound_steps"] <= verdict.steps
    gap = cost_s / figures["lower_bound_cost_s"] - 1
    assert figures["gap"] == pytest.approx(gap, abs=1e-6)
    assert figures["cpu_s"] > 0


def cells_in(file):
    return {(int(row), int(col)) for row, col in np.argwhere(np.load(file))}


def test_the_figures_of_a_coverage_grid_are_right(plan, grid_file):
    options = ("--start", "2,5", "--ants", 40, "--seed", 3)
    figures, walk = plan(grid_file, *options, "--planner", "fasaco")
    assert set(figures) == KEYS
    assert (figures["planner"], figures["seed"], figures["ants"]) == ("fasaco", 3, 40)
    assert (figures["kicks"], figures["proposals"]) == (0, 0)
    # Its cells are all there is of it.
    assert figures["floor"] is None
    check(figures, walk, cells_in(grid_file), (2, 5))


def test_the_figures_of_a_map_are_right(plan, tmp_path):
    options = ("--line", "cells", "--cell", 0.3, "--robot-radius", 0.18, "--ants", 40)
    figures, walk = plan(room_file(tmp_path), *options, "--start-xy", "0.75,0.45")
    check(figures, walk, coverable_cells(pillared_room()), (1, 2))
    # A room of 3.9 x 2.9 m with a pillar, but for corners. Cells lie off its walls.
    floor = figures["floor"]
    assert floor["reachable_m2"] == pytest.approx(3.9 * 2.9 - 0.16, rel=0.04)
    swept_m2 = floor["swept_share"] * floor["reachable_m2"]
    assert 0.7 * figures["cells"] * 0.09 < swept_m2 < 1.05 * figures["cells"] * 0.09
    assert floor["seconds_per_m2"] == pytest.approx(figures["cost_s"] / swept_m2, rel=0.01)
    assert floor["patches_over_4_dm2"] >= 1
    assert 0.04 < floor["largest_patch_m2"] < floor["reachable_m2"] - swept_m2
    assert floor["illegal_share"] == 0.0


@pytest.mark.parametrize("origin", [Pose2D(0.0, 0.0), Pose2D(-40.0, 7.5, 0.4)])
def test_the_line_to_be_driven_is_written_in_the_map_frame(plan, tmp_path, origin):
    file, csv = room_file(tmp_path, origin), tmp_path / "line.csv"
    _, walk = plan(file, "--line", "cells", "--cell", 0.3, "--xy-out", csv)
    header, *rows = csv.read_text().splitlines()
    line = [tuple(float(part) for part in row.split(",")) for row in rows]
    assert header == "x_m,y_m"
    # Driven cell by cell, it is the walk; and no point of it lies in the middle of a lane.
    centres = [((col + 0.5) * 0.3, (row + 0.5) * 0.3) for row, col in walk]
    driven = [line[0]]
    for (ax, ay), (bx, by) in pairwise(line):
        steps = round(max(abs(bx - ax), abs(by - ay)) / 0.3)
        driven += [
            (ax + (bx - ax) * step / steps, ay + (by - ay) * step / steps)
            for step in range(1, steps + 1)
        ]
    assert np.allclose(driven, centres, atol=1e-5)
    ways = np.sign(np.round(np.diff(line, axis=0), 3)).tolist()
    assert all(before != after for before, after in pairwise(ways))


@pytest.mark.parametrize("origin", [Pose2D(0.0, 0.0), Pose2D(-40.0, 7.5, 0.4)])
def test_a_line_over_the_floor_sweeps_more_of_it(plan, tmp_path, origin):
    file, csv, png = room_file(tmp_path, origin), tmp_path / "line.csv", tmp_path / "line.png"
    (cells, _), (quick, _), (thorough, walk) = (
        plan(file, "--line", line, "--xy-out", csv, "--png", png, "--end", "home")
        for line in ("cells", "quick", "thorough")
    )
    shares = [figures["floor"]["swept_share"] for figures in (cells, quick, thorough)]
    assert shares[0] < shares[1] < shares[2] > 0.96
    assert [figures["floor"]["illegal_share"] for figures in (quick, thorough)] == [0.0, 0.0]
    assert (thorough["line"], thorough["tool_m"], thorough["turn_s"]) == ("thorough", 0.3, 1.5)
    assert thorough["cell_m"] == pytest.approx(0.92 * 0.3)
    line = np.loadtxt(csv, delimiter=",", skiprows=1)
    # Home is where it stands first; that is not the middle of a cell.
    assert line[0] == pytest.approx(line[-1])
    assert walk[0] == walk[-1]
    assert png.read_bytes().startswith(b"\x89PNG")


def test_a_share_of_the_floor_can_be_asked_for(plan, tmp_path, caplog):
    file = room_file(tmp_path)
    usual, _ = plan(file, "--budget", 1)
    asked, _ = plan(file, "--budget", 1, "--swept", 0.999)
    # On a busy machine the budget ends both after the first line.
    assert usual["floor"]["swept_share"] <= asked["floor"]["swept_share"] < 1.0
    floor = asked["floor"]
    warning = f"--swept 0.999: the line sweeps {floor['swept_share']:.4f}, and leaves "
    assert (warning in caplog.text) == (floor["swept_share"] < 0.999)


def test_cells_lie_along_the_walls(plan, tmp_path):
    pixels = pillared_room()
    csv, png = tmp_path / "line.csv", tmp_path / "line.png"
    level, askew = tmp_path / "level.yaml", tmp_path / "askew.yaml"
    for file, yaw in ((level, 0.0), (askew, 0.4)):
        geometry = GridGeometry(*pixels.shape, 0.05, Pose2D(0.0, 0.0, yaw))
        write_map(OccupancyGrid(geometry, pixels), file)
    start = (2.0 * math.cos(0.4) - 0.6 * math.sin(0.4), 2.0 * math.sin(0.4) + 0.6 * math.cos(0.4))
    search = ("--line", "thorough", "--planner", "spiral-stc")
    options = (*search, "--start-xy", f"{start[0]},{start[1]}", "--xy-out", csv)
    expected, _ = plan(level, *search, "--start-xy", "2,0.6")
    walls, _ = plan(askew, *options, "--png", png)
    line = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert expected["lattice_deg"] == 0.0
    assert walls["lattice_deg"] == pytest.approx(math.degrees(0.4), abs=1e-3)
    # Seen from its walls it is the same room.
    assert (walls["cells"], walls["steps"]) == (expected["cells"], expected["steps"])
    for figure in ("reachable_m2", "swept_share", "seconds_per_m2"):
        assert walls["floor"][figure] == pytest.approx(expected["floor"][figure], rel=0.03)
    assert line[0] == pytest.approx(start, abs=0.2)
    axes, _ = plan(askew, *options, "--align", "axes")
    assert axes["lattice_deg"] == 0.0
    assert walls["cost_s"] < 0.8 * axes["cost_s"]
    assert walls["floor"]["seconds_per_m2"] < axes["floor"]["seconds_per_m2"]
    asked, _ = plan(askew, *options, "--align", "-67.0817")
    assert asked["lattice_deg"] == -67.082
    assert asked["floor"]["seconds_per_m2"] == pytest.approx(
        expected["floor"]["seconds_per_m2"], rel=0.05
    )


def test_cells_follow_the_axes_if_they_cannot_follow_the_walls(plan, tmp_path, capsys):
    # Nearly as far from 0 as can be; turned back by as much, its x would be larger by 0.4.
    file = room_file(tmp_path, Pose2D(1.9e7, 1.9e7, 0.7))
    figures, _ = plan(file, "--line", "quick")
    assert figures["lattice_deg"] == 0.0
    assert figures["floor"]["swept_share"] > 0.9
    assert main(["plan", str(file), "--line", "quick", "--align", "40"]) == Exit.ERROR
    assert "reaches beyond 20000000 m" in capsys.readouterr().err


def test_an_end_is_named_as_a_start_is(plan, tmp_path, capsys):
    file, csv = room_file(tmp_path, Pose2D(0.0, 0.0, 0.4)), tmp_path / "line.csv"
    # The cell of the plain lattice at (2.9, 3.1) m, wherever the cells of the line lie.
    plan(file, "--line", "quick", "--end", "10,9", "--xy-out", csv)
    line = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert line[-1] == pytest.approx((2.85, 3.15), abs=0.25)
    assert main(["plan", str(file), "--line", "quick", "--end", "0,30"]) == Exit.ERROR
    assert "end cell (0, 30)" in capsys.readouterr().err


def test_a_map_gets_a_floor_line_unless_a_paper_planner_runs(plan, grid_file):
    lines = {
        words: plan(*words)[0]["line"]
        for words in (
            ("office",),
            ("office", "--planner", "fasaco", "--ants", "8"),
            ("office", "--planner", "zigzag"),
            (str(grid_file),),
        )
    }
    assert list(lines.values()) == ["thorough", "cells", "cells", "cells"]
    figures, _ = plan("office")
    assert figures["floor"]["swept_share"] > 0.96
    assert figures["turn_s"] == 1.5


def test_a_plan_is_for_the_robot_of_a_configuration(plan, tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(
        "robot: {tool_width_m: 0.36, radius_m: 0.2, speed_m_s: 0.4, turn_deg_s: 60, overlap: 0.1}\n"
        "planner: {line: quick, name: colony-search, ants: 50, seed: 9, tau0: 0.2, swept: 0.9}\n"
    )
    figures, _ = plan("office", "--config", file)
    assert (figures["line"], figures["seed"], figures["budget_s"]) == ("quick", 9, 0.05)
    assert (figures["tool_m"], figures["cell_m"]) == (0.36, pytest.approx(0.324))
    assert (figures["speed_m_s"], figures["turn_deg_s"]) == (0.4, 60.0)
    changed, _ = plan("office", "--config", file, "--turn-s", 2, "--cell", 0.3, "--seed", 0)
    assert (changed["turn_s"], changed["turn_deg_s"], changed["tool_m"]) == (2.0, None, 0.3)
    assert changed["seed"] == 0
    # The paper's lattice, as the daemon with `planner.line: cells` counts; its line has no share.
    cells, _ = plan("office", "--config", file, "--line", "cells")
    assert (cells["cell_m"], cells["turn_deg_s"]) == (0.36, 60.0)


def test_a_clearance_leaves_a_strip_along_walls(plan):
    floors = [plan("office", "--clearance", metres)[0]["floor"] for metres in (0, 0.03)]
    assert floors[1]["swept_share"] < floors[0]["swept_share"]


@pytest.mark.parametrize("words", [(), ("--forward-only",)])
def test_a_robot_with_a_turning_radius_drives_a_curve(plan, tmp_path, words):
    xy, png = tmp_path / "curve.csv", tmp_path / "curve.png"
    files = "--xy-out", xy, "--png", png
    figures, _ = plan("office", "--line", "quick", "--turn-radius", 0.3, *words, *files)
    assert figures.keys() == KEYS | {"curve"}
    curve = figures["curve"]
    assert (curve["turn_radius_m"], curve["reverses"]) == (0.3, not words)
    assert figures["floor"]["illegal_share"] == 0.0
    assert (curve["reversals"] > 0, curve["backward_m"] > 1.0) == (not words, not words)
    assert curve["spot_turns"] == 0
    header, *_ = xy.read_text().splitlines()
    assert header == "x_m,y_m,yaw_rad"
    x, y, yaw = np.loadtxt(xy, delimiter=",", skiprows=1).T
    ways = np.hypot(np.diff(x), np.diff(y))
    assert ways.sum() == pytest.approx(curve["length_m"], abs=0.01)
    turns = np.abs((np.diff(yaw) + np.pi) % (2 * np.pi) - np.pi)
    # A chord is a little shorter than its arc; two straights may bend by a degree.
    assert (turns <= 1.01 * ways / 0.3 + 0.021).all()
    with Image.open(png) as picture:
        assert picture.format == "PNG"


def test_a_turn_that_fits_on_no_arc_is_a_warning(tmp_path, capsys, caplog):
    """A corridor 0.5 m wide: forward only, the robot cannot come back to its start."""
    cells = np.zeros((12, 82), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    file = tmp_path / "corridor.yaml"
    write_map(OccupancyGrid(GridGeometry(12, 82, 0.05, Pose2D(-0.05, -0.05)), cells), file)
    words = "--turn-radius", "0.5", "--forward-only", "--end", "home", "--budget", "0.05"
    assert main(["plan", str(file), *words, "--start-xy", "2,0.25", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["curve"]["spot_turns"] >= 0
    assert "not fit on arcs of 0.5 m" in caplog.text
    assert "without --forward-only" in caplog.text


def test_a_plain_image_is_planned_and_unknown_may_count_as_free(plan, tmp_path, capsys):
    pixels = np.full((60, 80), 254, np.uint8)
    pixels[:, 40:] = 205
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    file = tmp_path / "scan.png"
    Image.fromarray(pixels).save(file)
    words = [file, "--resolution", "0.05", "--line", "cells"]
    seen, _ = plan(*words)
    all_of_it, _ = plan(*words, "--unknown-free")
    assert 1.5 < all_of_it["cells"] / seen["cells"] < 2.5
    assert all_of_it["floor"]["illegal_share"] == 0
    assert main(["plan", str(file)]) == 1
    assert "--resolution" in capsys.readouterr().err
    assert main(["plan", "office", "--resolution", "0.05"]) == 1
    assert "a resolution of its own" in capsys.readouterr().err


def test_a_start_may_be_negative(plan, tmp_path):
    file = room_file(tmp_path, Pose2D(-3.0, -3.0))
    for option, value in (("--start", "-9,-8"), ("--start-xy", "-2.25,-2.55")):
        figures, walk = plan(file, option, value, "--ants", 8, "--line", "cells")
        assert tuple(figures["start"]) == walk[0] == (-9, -8)


@pytest.mark.parametrize("planner", PLANNER_NAMES)
def test_a_walk_ends_in_the_cell_asked_for(plan, grid_file, planner):
    options = ("--start", "8,0", "--end", "2,6", "--planner", planner, "--ants", 16)
    figures, walk = plan(grid_file, *options)
    check(figures, walk, cells_in(grid_file), (8, 0))
    assert walk[-1] == (2, 6)


def test_turns_cost_their_time(plan, grid_file):
    cells = cells_in(grid_file)
    # Of ants alone: what a local search comes to in its time depends on the machine.
    options = ("--ants", 400, "--velocities", 1, "--seed", 2, "--planner", "fasaco")
    robot = ("--speed-m-s", 0.5, "--turn-s", 4)
    plain, walk = plan(grid_file, *options)
    check(plain, walk, cells, (0, 0))
    turning, walk = plan(grid_file, *options, *robot)
    check(turning, walk, cells, (0, 0), speed_m_s=0.5, turn_s=4.0)
    # As the simulated robot drives where nobody says.
    assert SimulationConfig().speed_m_s == 0.25
    assert turning["turns_90"] < plain["turns_90"]


def test_a_line_is_quicker_for_who_says_how_the_robot_turns(tmp_path, capsys):
    limits = DriveLimits(0.5, 100.0, 180.0)
    took_s, stops = [], []
    config = tmp_path / "robot.yaml"
    config.write_text("robot: {turn_deg_s: 100}\n")
    # A quarter-turn takes both the same.
    for turn in (("--turn-s", "1.956"), ("--config", str(config))):
        csv = tmp_path / "line.csv"
        # A planner without a budget: the same walk, however busy the machine.
        words = ["flat", "--planner", "stc", "--line", "quick", *turn, "--xy-out", str(csv)]
        assert main(["plan", *words, "--json"]) == 0
        figures = json.loads(capsys.readouterr().out)
        assert figures["turn_s"] == pytest.approx(1.956, abs=5e-4)
        ways = np.diff(np.loadtxt(csv, delimiter=",", skiprows=1), axis=0)
        headings = np.degrees(np.arctan2(ways[:, 1], ways[:, 0]))
        bends = np.abs((np.diff(headings) + 180.0) % 360.0 - 180.0)
        took_s.append(drive_seconds(np.hypot(*ways.T), bends, 0.25, limits))
        stops.append(np.count_nonzero(bends > limits.steered_deg))
        assert figures["floor"]["swept_share"] > 0.87
    swept_s = figures["floor"]["seconds_per_m2"] * figures["floor"]["swept_share"]
    assert swept_s * figures["floor"]["reachable_m2"] == pytest.approx(took_s[1], rel=0.01)
    assert took_s[1] < 0.9 * took_s[0]
    assert stops[1] < 0.6 * stops[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--turn-s -1", "--turn-s: expected a number of at least 0, got -1.0"),
        *((f"--clearance={m}", "--clearance: expected a number") for m in ("1.1", "-0.1", "nan")),
        *((f"--overlap={m}", "--overlap: expected a number") for m in ("0.9", "-0.1", "nan")),
        *((f"--turn-radius={m}", "--turn-radius: expected a number") for m in ("21", "-1", "nan")),
        ("--line cells --turn-radius 0.3", "only has turns on the spot"),
        ("--swept 1.5", "swept must be a share in (0, 1], such as 0.99, got 1.5"),
        *((f"--line cells --align {to}", "line over the floor") for to in ("walls", "30")),
        ("--line cells --swept 0.9", "has no share to choose"),
        ("--rooms --passes 2", "for one pass"),
        ("--planner zigzag --line cells --pheromone-png t.png", "leaves no pheromone"),
    ],
)
def test_impossible_options_are_refused_by_name(capsys, words, said):
    line = () if "--line" in words else ("--line", "quick")
    assert main(["plan", "office", *line, *words.split()]) == Exit.CONFIG
    assert said in capsys.readouterr().err


def test_a_coverage_grid_has_no_floor(grid_file, capsys):
    assert main(["plan", str(grid_file), "--line", "thorough"]) == Exit.CONFIG
    assert "line thorough: grid.npy is a coverage grid" in capsys.readouterr().err
    assert main(["plan", str(grid_file), "--rooms"]) == Exit.CONFIG
    assert "shows no walls" in capsys.readouterr().err


def test_a_budget_ends_the_search_with_a_whole_walk(plan, grid_file):
    options = ("--ants", 1_000_000, "--budget", 0.05)
    figures, walk = plan(grid_file, *options, "--planner", "fasaco")
    # Without a start the larger area is covered.
    check(figures, walk, cells_in(grid_file), (0, 0))
    assert figures["ants"] < 1_000_000
    assert figures["ended_by"] == "budget"
    # Pillars, and turns at a price: no walk is proven to be the best, so only the clock ends it.
    pillars = np.ones((11, 13), bool)
    pillars[2::3, 1::4] = False
    np.save(grid_file, pillars)
    # On a busy machine a short one may end before the first kick.
    for budget_s in (0.3, 3, 30):
        options = ("--ants", 1_000_000, "--budget", budget_s)
        figures, walk = plan(grid_file, *options, "--turn-s", 1)
        check(figures, walk, cells_in(grid_file), (0, 0), turn_s=1.0)
        assert figures["ended_by"] == "budget"
        if figures["kicks"] > 0:
            return
    raise AssertionError("no kick in half a minute")


@pytest.mark.parametrize("name", ["walk.png", "walk", "walk.jpeg"])
def test_a_picture_is_a_png_whatever_its_name(grid_file, tmp_path, capsys, name):
    picture = tmp_path / name
    assert main(["plan", str(grid_file), "--ants", "8", "--png", str(picture)]) == 0
    assert f"wrote {picture}" in capsys.readouterr().out.replace("\n", "")
    with Image.open(picture) as image:
        assert image.format == "PNG"
        assert min(image.size) > 100


@pytest.mark.parametrize("words", [("--budget", "0.05"), ("--planner", "fasaco", "--ants", "16")])
def test_the_trail_of_the_colony_is_drawn(plan, tmp_path, words):
    file = tmp_path / "trail.png"
    plan("office", *words, "--pheromone-png", file)
    with Image.open(file) as picture:
        colours = picture.convert("P", palette=Image.Palette.ADAPTIVE, colors=64).getcolors()
    assert len(colours) > 20


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ((), "map line swept gap walk search"),
        (("--turn-radius", "0.4"), "map line swept gap curve walk search"),
        (("--passes", "edge,auto"), "map line swept pass pass"),
    ],
)
def test_the_summary_fits_on_one_screen(words, names, tmp_path):
    png = tmp_path / "plan.png"
    ended = fasaco_edge("plan", "flat", "--budget", "0.1", "--png", png, *words)
    lines = ended.out.splitlines()
    assert ended.code == 0
    assert len(lines) <= 14
    rows = [line for line in lines if not line.startswith(" ")]
    assert [row.split()[0] for row in rows] == [*names.split(), "wrote", "more:"]
    assert f"wrote {png}" in lines
    assert "None" not in ended.out
    assert re.search(r"^swept +9\d\.\d % of 49.4 m2, ", ended.out, re.MULTILINE)
    assert re.search(r"^line +.*, \d+ min \d\d s", ended.out, re.MULTILINE)
