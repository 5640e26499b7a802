"""The lab in short: a small room, twice, and the judge against what is known."""

import json
import subprocess
import sys

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid
from maps.map_writer import write_map
from tests.support.forked import ENVIRONMENT

pytest.importorskip("karto_scanmatcher", reason="needs the extra 'lab'")
pytestmark = pytest.mark.filterwarnings("default")
SECONDS = 30.0
# On a machine that is busy with much else [s].
PATIENCE_S = 600.0


@pytest.fixture(scope="module", autouse=True)
def _simulator():
    pytest.importorskip("irsim", reason="needs the extra 'lab'")


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A room of 2.4 x 2 m with a box in it, as a map file."""
    cells = np.full((44, 52), FREE, np.int8)
    cells[[0, 1, -2, -1], :] = cells[:, [0, 1, -2, -1]] = OCCUPIED
    cells[26:34, 20:28] = OCCUPIED
    path = tmp_path_factory.mktemp("lab") / "room.yaml"
    write_map(OccupancyGrid(GridGeometry(*cells.shape, 0.05, Pose2D(-0.5, -0.5)), cells), path)
    return path


def test_a_mission_is_driven_judged_and_repeated_bit_for_bit(room, tmp_path):
    from tests.campaigns.lab.building import Building
    from tests.campaigns.lab.mission import run_mission
    from tests.campaigns.lab.report import judged
    from tests.campaigns.lab.settings import LabSettings

    command = [sys.executable, "-m", "tests.campaigns.lab", "--building", str(room), "--json"]
    command += ["--seconds", str(SECONDS), "--start", "0,0,0", "--out", str(tmp_path / "other")]
    other = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
    try:
        building = Building.read(str(room), start=(0.0, 0.0, 0.0))
        run = run_mission(building, LabSettings(seconds=SECONDS))
        found = judged(run, 0.0, tmp_path / "own").document()
        said, _ = other.communicate(timeout=PATIENCE_S)
    finally:
        other.kill()
        other.wait()
    again = json.loads(said)
    assert again["figures"] == found["figures"]

    figures = found["figures"]
    assert figures["driven_m"] > 2.0
    assert 0.15 < figures["true_share"] <= 1.0
    assert abs(figures["excess_points"]) < 20.0
    assert figures["pose_error_p95_m"] < 0.1
    assert 0.0 < figures["speed_share"] < 1.0
    assert 0.0 < figures["turning_share"] < 1.0
    assert figures["paths_per_min"] >= figures["changes_per_min"] > 0.0
    assert figures["ending"] != "deadlock"
    of = run.trace.columns()
    assert np.hypot(of["x"] - of["px"], of["y"] - of["py"]).max() > 0.0
    assert (tmp_path / "own" / "picture.png").stat().st_size > 1000
