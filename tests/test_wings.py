"""A wing is a folder that can be taken away: plans, missions and recordings need none."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map
from tests.support.rooms import RESOLUTION_M, room

ROOT = Path(__file__).parents[1]
WINGS = ("bench", "fleet", "follow", "replay", "review", "serve", "watch")


# Runs several commands, one after the other, in one process: each would import the same again.
COMMANDS = """
import contextlib, json, sys
from fasaco_edge.cli import main
for words in json.loads(sys.argv[1]):
    with contextlib.suppress(SystemExit):  # as after each --help
        assert main(words) == 0, words
"""


def without(folder, *wings):
    """Copy the package without some of its folders; return what runs commands of it."""
    for name in ("fasaco_edge", "maps", "protocol", "deploy"):
        shutil.copytree(ROOT / name, folder / name)
    shutil.copy(ROOT / "pyproject.toml", folder)
    for wing in wings:
        shutil.rmtree(folder / "fasaco_edge" / wing)

    def run(*commands):
        words = json.dumps([list(map(str, command)) for command in commands])
        command = [sys.executable, "-c", COMMANDS, words]
        environment = os.environ | {"PYTHONPATH": str(folder)}
        ended = subprocess.run(
            command, env=environment, cwd=folder, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    return run


@pytest.fixture
def small_room(tmp_path):
    pixels = room(2.4, 1.8)
    path = tmp_path / "room.yaml"
    write_map(
        OccupancyGrid(GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(-1.0, -0.4)), pixels), path
    )
    return path


@pytest.mark.parametrize("wing", WINGS)
def test_commands_need_no_wing(wing, tmp_path, small_room):
    run = without(tmp_path / "tree", wing)
    helps = [(command, "--help") for command in ("run", "record", "demo")]
    check = "check-config", ROOT / "deploy" / "fasaco-edge.yaml"
    said = run(*helps, check, ("plan", small_room, "--json"))
    assert said.count("usage:") == len(helps)
    assert "in order" in said
    assert json.loads(said[said.index("\n{") :])["cells"] > 0


def test_a_recorded_mission_needs_no_wing(tmp_path, small_room):
    pytest.importorskip("rerun")
    run = without(tmp_path / "tree", *WINGS)
    out = tmp_path / "demo"
    told = json.loads(run(("demo", "--map", small_room, "--speed", 60, "--out", out, "--json")))
    assert told["complete"]
    assert list(out.glob("*.rrd"))
