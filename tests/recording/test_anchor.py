"""Far from 0 a drawing has an origin of its own: float32 tells a UTM northing to half a metre."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.scene.layers import NEAR_M, Anchor
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from tests.support import scripted_mission as made_up
from tests.support.recordings import bus_on_free_port, read_column, read_static, recorder_process

UTM = (500_012.0, 5_500_034.0)
DRAWN_FROM = (500_000.0, 5_500_000.0)
FRAMES = 20


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A mission in UTM: the file, and the walk as it was published."""
    out = tmp_path_factory.mktemp("runs")
    with (
        pytest.MonkeyPatch.context() as patch,
        bus_on_free_port() as (bus, endpoint),
        recorder_process(bus, endpoint, out) as recorder,
    ):
        patch.setattr(made_up, "ORIGIN", UTM)
        mission = made_up.Mission(bus)
        for _ in mission.frames(FRAMES):
            time.sleep(0.04)
        report = recorder.wait_until(lambda report: report["messages"] > FRAMES)
        recorder.process.send_signal(signal.SIGTERM)
        assert recorder.process.wait(60) == 0
    return Path(report["file"]), mission


GRIDS = [entities.MAP, entities.FLOOR, entities.PHEROMONE]


def test_near_zero_nothing_is_moved():
    assert not Anchor.near(-3.0, 9_999.0)
    assert Anchor.near(NEAR_M, -0.5) == Anchor(NEAR_M, 0.0)
    assert Anchor.near(*UTM) == Anchor(*DRAWN_FROM)
    assert Anchor(1000.0, 0.0).pose(Pose2D(1000.5, 2.0, 0.1)) == Pose2D(0.5, 2.0, 0.1)


@pytest.mark.parametrize("entity", GRIDS)
def test_grids_lie_where_they_are_drawn(recorded, entity):
    corner = read_column(recorded[0], entity, "GridMap:translation").values[-1][0]
    assert np.array_equal(corner, [12.0, 34.0, 0.0])


def test_the_path_lies_on_its_cells_to_a_tenth_of_a_millimetre(recorded):
    path, mission = recorded
    strips = read_column(path, entities.PATH, "LineStrips3D:strips").values
    drawn = np.concatenate([np.asarray(one, np.float64)[:, :2] for some in strips for one in some])
    where = drawn + DRAWN_FROM
    off = np.abs(where[:, None] - mission.walk[None]).max(axis=2).min(axis=1)
    assert len(drawn) > 2
    assert off.max() < 1e-4
    robot = read_column(path, entities.ROBOT, "Transform3D:translation").values[-1][0]
    assert np.abs(np.asarray(robot[:2], np.float64)).max() < 100.0


def test_the_path_before_the_present_one_is_drawn_beside_it(recorded):
    new, old = (
        [
            np.asarray(line)[:, :2]
            for lines in read_column(recorded[0], each, STRIPS).values
            for line in lines
        ]
        for each in (entities.PATH, entities.OLD_PATH)
    )
    # The last path is empty: nothing is left to drive, and the one before it stays drawn.
    assert len(old) > 2
    assert all(map(np.array_equal, old, new))


STRIPS = "LineStrips3D:strips"


def test_the_rectangle_of_a_reason_is_moved_with_all_else(recorded):
    strips = read_column(recorded[0], entities.REPLAN_WINDOW, "LineStrips3D:strips").values
    boxes = [np.asarray(strip[0]) for strip in strips if len(strip)]
    assert boxes
    assert all(np.abs(box).max() < 100.0 for box in boxes)


def test_the_origin_of_the_drawing_is_recorded(recorded):
    path, _ = recorded
    (where,) = read_static(path, entities.WORLD, "Transform3D:translation")[-1]
    assert np.allclose(where, [*DRAWN_FROM, 0.0])
    card = str(read_column(path, entities.RUN_CARD, "TextDocument:text").values[-1])
    assert "| drawn from | x 500000 m, y 5500000 m of the map's frame |" in card


def test_received_samples_are_kept_unchanged(recorded):
    samples = RecordedSamples([recorded[0]])
    maps = [sample.sample.payload for sample in samples if sample.topic == "map"]
    origin = decode_occupancy_grid(maps[-1]).geometry.origin
    assert (origin.x, origin.y) == UTM
