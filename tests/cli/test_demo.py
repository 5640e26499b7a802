"""The demo to its end, and what it left behind checked against the building."""

from __future__ import annotations

import argparse
import json
import math
import re
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.cli.demo import COMMAND, EPILOG
from fasaco_edge.cli.demo.mission import DemoMission
from fasaco_edge.cli.demo.robots import demo_robots
from fasaco_edge.cli.demo.summary import DemoSummary, RobotFigures
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.map_files import read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.review.review import read_review
from fasaco_edge.simulation.robot import SimulationConfig
from maps.map_writer import write_map
from tests.support.processes import fasaco_edge, is_running, slowness
from tests.support.rooms import (
    FREE,
    RADIUS_M,
    RESOLUTION_M,
    WALL,
    cells_of,
    coverable_cells,
    fill,
    room,
)
from tests.support.terminal import Terminal

# From the end of set-up to the first picture on a quiet machine [s].
FIRST_PICTURE_S = 10.0
# Corner of the map, and of a cell.
CORNER = Pose2D(-0.9, -0.3)


@pytest.fixture
def building(tmp_path):
    closed = fill(room(3.9, 2.7), 1.8, 0.0, 1.9, 2.7, WALL)
    pixels = fill(fill(closed, 1.8, 0.9, 1.9, 1.8, FREE), 2.8, 1.1, 3.1, 1.4, WALL)
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, CORNER)
    write_map(OccupancyGrid(geometry, pixels), tmp_path / "rooms.yaml")
    return tmp_path / "rooms.yaml"


class SlowRecorder:
    """A bus on which the recorder is heard at the third question."""

    def __init__(self, order):
        self.order = order

    def listen(self, *_):
        pass

    def alive(self, key):
        assert key == "fasaco/@v1/robot/recorder/alive"
        self.order.append("asked")
        return {key} if self.order.count("asked") > 2 else set()


def test_the_robot_starts_once_its_recorder_listens(tmp_path, monkeypatch):
    """Floor that it swept before would be told as not swept by a review."""
    parser, order = argparse.ArgumentParser(), []
    COMMAND.add_options(parser)
    args = parser.parse_args(["--driver", "follow"])
    monkeypatch.setattr(DemoMission, "_spawn", lambda self, log, words: order.append(log.stem))
    mission, bus = DemoMission(args, demo_robots(args, tmp_path)), SlowRecorder(order)
    mission._start(bus)
    for _ in range(5):
        if mission._waiting:
            mission._let_start(bus, now=0.0)
    assert order == ["daemon", "follower", *["asked"] * 3, "robot"]


def test_a_demo_is_a_live_map_and_then_a_summary(tmp_path, monkeypatch, building):
    pytest.importorskip("rerun")
    monkeypatch.chdir(tmp_path)
    words = ("demo", "--map", building, "--speed", 30, "--timeout", 1200, "--out", "demo")
    with Terminal(*words, DISPLAY=":0") as shell:
        shell.wait_text("kernels ready")
        began = time.monotonic()
        page = shell.wait_text("q quits")
        assert time.monotonic() - began < FIRST_PICTURE_S * slowness()
        assert page.count("\n") == 23
        shell.wait(
            lambda seen: (
                re.search(r" COVERING .* path \d+, (at least )?\S+ \w+ to go  30 x real", seen)
                and re.search(r"to go +(at least )?\S+ \w+, \d+ steps", seen)
                and all(sign in seen for sign in ("swept", "█", "▀"))
            )
        )
        for columns, lines in ((30, 6), (100, 30)):
            shell.resize(columns, lines)
            shell.wait(lambda seen, lines=lines: seen.count("\n") == lines - 1)
        assert shell.end() == 0, shell.written[-2000:]
        assert shell.is_clean()
        screen = "\n".join(shell.screen())
    assert screen.startswith("kernels ready")
    assert "q quits" not in screen
    assert "\nthe mission is over: " in screen
    assert "\nrooms: every reachable cell is covered\n" in screen
    assert re.search(r"floor swept +│ \d\.\d of \d\.\d m2", screen)
    for program in ("fasaco-edge review", "fasaco-edge serve", "rerun"):
        assert f"{program} demo/*.rrd\n" in screen
    # Its length is that of where this is installed.
    assert all(line.startswith("in another terminal: ") for line in shell.shown.wrapped)
    check_demo(tmp_path / "demo", building)


def check_demo(out, building):
    """Check what a demo has left behind against its building."""
    summary = json.loads((out / "summary.json").read_text())
    assert summary["complete"] is True
    assert summary["errors"] == 0
    assert summary["plans"] >= 1

    grid = read_map(building)
    trail = np.loadtxt(out / "trail.csv", delimiter=",", skiprows=1)
    reachable = coverable_cells(grid.cells)
    visited = set(cells_of(trail - (CORNER.x, CORNER.y)))
    # The line leaves out what is not worth the way, and takes in what lies beside the middles.
    assert len(reachable - visited) < 0.05 * len(reachable)
    assert summary["reachable_cells"] == summary["covered_cells"] > len(reachable)
    assert summary["reachable_m2"] == pytest.approx(9.1, abs=0.1)
    assert summary["swept_m2"] / summary["reachable_m2"] > 0.93
    driven = sum(math.dist(a, b) for a, b in pairwise(trail))
    assert summary["driven_m"] == pytest.approx(driven, abs=0.1)
    check_clearance(grid, trail)
    # The recorder listens before the robot moves: nothing that it swept is missing.
    (recording,) = out.glob("*.rrd")
    review = read_review([recording])
    assert math.dist(review.data.track[0, :2], trail[0]) < 0.01
    # Its times are those of the robot, whose straight lines take it at 0.25 m/s.
    assert review.data.time_scale == 30
    ways, steps_s = np.diff(review.data.track[:, :2], axis=0), np.diff(review.data.times)
    moves = steps_s > 0
    assert (np.hypot(*ways[moves].T) / steps_s[moves]).max() == pytest.approx(0.25, abs=0.01)

    assert summary["recording"]
    for file in summary["recording"]:
        with open(file, "rb") as recording:
            assert recording.read(4) == b"RRF2"
    with Image.open(summary["picture"]) as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 200
    for name in ("daemon.log", "robot.log"):
        assert "Traceback" not in (out / name).read_text()
    assert not [pid for pid in processes_of(out) if is_running(pid)]


def test_robots_of_a_fleet_cover_a_building_together(tmp_path):
    pytest.importorskip("rerun")
    out = tmp_path / "demo"
    # Robots too fast for a busy machine outrun the paths of their daemons.
    speed = round(max(6.0 / slowness(), 3.0), 1)
    hall = tmp_path / "hall.yaml"
    pixels = fill(room(3.3, 1.8), 1.6, 1.2, 1.7, 1.8, WALL)
    write_map(OccupancyGrid(GridGeometry(*pixels.shape, RESOLUTION_M, CORNER), pixels), hall)
    options = ("--map", hall, "--robots", 2, "--speed", speed, "--timeout", 1200)
    ended = fasaco_edge("demo", *options, "--out", out, "--json")
    assert ended.code == 0, ended.err
    assert "fasaco-edge watch --fleet demo --connect tcp/127.0.0.1:" in ended.err
    summary = json.loads(ended.out)
    assert summary["complete"] is True
    assert [robot["name"] for robot in summary["robots"]] == ["r1", "r2"]
    assert summary["swept_m2"] / summary["reachable_m2"] > 0.9
    each = [robot["swept_m2"] for robot in summary["robots"]]
    assert min(each) > 1.0
    assert sum(each) == pytest.approx(summary["swept_m2"] + summary["swept_twice_m2"], abs=0.05)
    starts = []
    for name in ("r1", "r2"):
        trail = np.loadtxt(out / name / "trail.csv", delimiter=",", skiprows=1)
        check_clearance(read_map(hall), trail)
        starts.append(trail[0])
        assert any(file.startswith(f"{out}/{name}/") for file in summary["recording"])
    assert math.dist(*starts) > 2.0
    (file,) = summary["fleet_recording"]
    reviewed = json.loads(fasaco_edge("review", file, "--json").out)
    assert [robot["name"] for robot in reviewed["robots"]] == ["r1", "r2"]
    assert [robot["state"] for robot in reviewed["robots"]] == ["done", "done"]
    # Cells, of which some reach into walls, against floor.
    assert reviewed["swept_m2"] == pytest.approx(summary["swept_m2"], rel=0.15)
    # By the robots' clocks, which are so much faster.
    assert reviewed["time_scale"] == speed
    assert summary["wall_s"] < reviewed["makespan_s"] < speed * summary["wall_s"]
    with Image.open(summary["picture"]) as picture:
        assert min(picture.size) > 200
    assert not [pid for pid in processes_of(out) if is_running(pid)]


def test_each_figure_is_in_the_help():
    told = set(re.findall(r"\w+", EPILOG))
    assert {*DemoSummary.__slots__, *RobotFigures.__slots__} <= told


def test_more_robots_than_places_to_start_from(tmp_path):
    geometry = GridGeometry(12, 12, RESOLUTION_M, Pose2D(-0.15, -0.15))
    write_map(OccupancyGrid(geometry, np.zeros((12, 12), np.int8)), tmp_path / "closet.yaml")
    ended = fasaco_edge("demo", "--map", tmp_path / "closet.yaml", "--robots", 3, "--out", tmp_path)
    assert ended.code == 1
    assert "no place for a robot beside the other" in ended.err


def processes_of(out):
    """Return the process ids of what still has the demo's folder on its command line."""
    pids = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if str(out).encode() in words:
                pids.append(int(entry.name))
    return pids


def bad_pixels(grid):
    """Return the lower left corners (x, y) [m] of all pixels that are not free, (n, 2)."""
    rows, cols = np.nonzero(grid.cells != 0)
    geometry = grid.geometry
    assert geometry.origin.yaw == 0.0
    return np.column_stack((cols, rows)) * geometry.resolution + (
        geometry.origin.x,
        geometry.origin.y,
    )


def clearance(grid, points):
    """Return how far each point (n, 2) [m] is from what is not free [m]."""
    corners, size = bad_pixels(grid), grid.geometry.resolution
    gaps = []
    for point in points:
        beside = np.maximum(np.maximum(corners - point, point - corners - size), 0.0)
        gaps.append(np.hypot(*beside.T).min())
    return np.array(gaps)


def check_clearance(grid, trail):
    """Check that the robot touched nothing.

    The line is as far from everything as the radius; the robot joins a new one by the straight way
    if its hull, which is narrower by the padding, can.
    """
    hull_m = RADIUS_M - SimulationConfig().padding_m
    assert clearance(grid, trail[:: max(1, len(trail) // 500)]).min() > hull_m - 1e-3


def test_only_a_demos_configuration_is_overwritten(tmp_path):
    (tmp_path / "config.yaml").write_text("robot: {name: maja}\n")
    ended = fasaco_edge("demo", "--out", tmp_path)
    assert ended.code == 78
    assert "config.yaml exists, and is not from a demo" in ended.err
    assert (tmp_path / "config.yaml").read_text() == "robot: {name: maja}\n"
