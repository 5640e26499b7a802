"""A recording opens into a layout that every view accepts, and shows what there is."""

from __future__ import annotations

import io
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("rerun")

from fasaco_edge.recording.scene import archetypes
from fasaco_edge.recording.scene.curves import DETAILS
from tests.support import viewer
from tests.support.recordings import bus_on_free_port, recorder_process
from tests.support.scripted_mission import Mission

pytestmark = pytest.mark.skipif(not viewer.drivers(), reason="no software renderer")

# The map view at 1280 x 720, without its title: left, top, right, bottom.
MAP_VIEW = (2, 95, 638, 573)


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    with bus_on_free_port() as (bus, endpoint), recorder_process(bus, endpoint, out) as recorder:
        for _ in Mission(bus).frames(60):
            time.sleep(0.02)
        path = Path(recorder.written(150)["file"])
        recorder.process.terminate()
        recorder.process.wait(60)
    with viewer.headless_viewer() as client:
        return viewer.shoot(client, [path], 1.0)


def test_no_view_complains(shot):
    assert shot.complaints == ()
    assert len(shot.views) == 6 + len(DETAILS)
    assert {
        "Map, swept floor, track and path",
        "Pheromone that ants follow (bright: much), and the path of that time (white)",
        "States",
        "Log",
        "Run",
    } < set(shot.views)


def test_the_map_is_framed_upright_and_large_with_the_robot(shot):
    view = Image.open(io.BytesIO(shot.picture)).crop(MAP_VIEW)
    pixels = np.asarray(view.convert("RGB"), np.int64)
    background = pixels[5, 5]
    shown = np.abs(pixels - background).sum(axis=2) > 40
    # The words above what has changed may stand out at the side.
    below = shown[len(shown) // 2 :]
    rows, cols = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(below.any(axis=0))
    # The building, 8 m x 6 m, fills the width and touches no side.
    width, height = cols[-1] - cols[0], rows[-1] - rows[0]
    assert width > 0.8 * view.width
    assert cols[0] > 0
    assert cols[-1] < view.width - 1
    assert width / height == pytest.approx(8 / 6, rel=0.05)
    # Unknown is at the upper right; in the other corners there is building.
    corner = pixels[rows[0] + 20, cols[-1] - 20]
    assert np.abs(corner - (112, 137, 134)).max() < 20
    red = np.abs(pixels - archetypes.ROBOT_COLOUR).sum(axis=2) < 60
    assert 30 < red.sum() < 3000
