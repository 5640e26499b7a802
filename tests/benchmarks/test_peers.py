"""Comparison with foreign planners in a small room; peers that cannot be installed."""

import json

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map
from tests.benchmarks.__main__ import main
from tests.benchmarks.peer_planners import (
    OTHERS,
    NoLineError,
    Peer,
    default_folder,
    install,
    line_of,
    problem_of,
)
from tests.benchmarks.peers import OURS
from tests.support.rooms import RESOLUTION_M, WALL, fill, room

STRAIGHT = "coverage-path-planner"


@pytest.fixture
def pillared(tmp_path):
    pixels = fill(room(2.4, 2.1), 1.1, 0.8, 1.5, 1.1, WALL)
    file = tmp_path / "pillared.yaml"
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(0.5, -1.0, 0.3))
    write_map(OccupancyGrid(geometry, pixels), file)
    return file


@pytest.mark.parametrize("peer", OTHERS)
def test_a_peer_and_ours_are_judged_alike(capsys, pillared, peer):
    if not OTHERS[peer].folder(default_folder()).is_dir():
        pytest.skip(f"{peer} is not installed: python -m tests.benchmarks peers")
    main(["peers", "--maps", str(pillared), "--peers", peer, "--json"])
    document = json.loads(capsys.readouterr().out)
    ours, theirs = document["lines"]
    assert (ours["planner"], theirs["planner"]) == (OURS, peer)
    assert {ours["fault"], theirs["fault"]} == {""}
    assert ours["illegal_share"] == 0.0
    assert theirs["illegal_share"] < 0.02
    assert ours["swept_share"] > 0.95
    assert 1.0 >= theirs["swept_share"] > 0.8
    assert min(run["turning_deg"] for run in (ours, theirs)) > 0.0
    assert [goal["what"] for goal in document["goals"]] == [f"s/m2 to {peer}, median"]


def test_a_peer_that_cannot_be_installed_says_why(tmp_path):
    peer = Peer(str(tmp_path / "nowhere.whl"), lambda ground: [], "a compiler")
    why = install(peer, tmp_path / "peers")
    assert "nowhere.whl" in why
    assert "a compiler" in why
    assert not peer.folder(tmp_path / "peers").exists()


def test_a_peer_that_is_not_there_returns_no_line(tmp_path):
    truth = OccupancyGrid(
        GridGeometry(24, 24, RESOLUTION_M, Pose2D(0.0, 0.0)), np.zeros((24, 24), np.int8)
    )
    problem = problem_of(truth, (0.6, 0.6), 0.0)
    with pytest.raises(NoLineError, match=r"exit code 1: .*(shapely|coverage_path_planner)"):
        line_of(STRAIGHT, tmp_path, problem, 60.0)


def test_the_robots_places_are_runs_of_pixels():
    cells = np.zeros((24, 24), np.int8)
    cells[12] = WALL
    truth = OccupancyGrid(GridGeometry(24, 24, RESOLUTION_M, Pose2D(0.0, 0.0)), cells)
    problem = problem_of(truth, (0.6, 0.3), 0.0)
    runs = np.array(problem["runs"])
    unit, _, _, _, x, y = problem["to_map"]
    low, high = y + unit * runs[:, 0].min(), y + unit * (runs[:, 0].max() + 1)
    assert low == pytest.approx(0.18, abs=unit)
    assert high == pytest.approx(0.60 - 0.18, abs=unit)
    assert x + unit * runs[:, 1] == pytest.approx(0.18, abs=unit)
    assert x + unit * runs[:, 2] == pytest.approx(1.20 - 0.18, abs=unit)


def test_a_folder_without_maps_is_named(capsys, tmp_path):
    assert main(["peers", "--folder", str(tmp_path)]) != 0
    assert str(tmp_path) in capsys.readouterr().err
