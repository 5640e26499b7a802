"""A recorder process on a bus, a mission published to it, and what its file then holds.

The mission is in UTM. Far from 0 a drawing has an origin of its own: float32 resolves half a metre
of a northing.
"""

from __future__ import annotations

import errno
import runpy
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.errors import MissingExtra
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.write.part import RecordingPart
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from fasaco_edge.wire.schemas import OCCUPANCY_GRID
from tests.support import scripted_mission
from tests.support.disks import disk_fixture
from tests.support.recordings import (
    SCALAR,
    RecordingSummary,
    bus_on_free_port,
    read_column,
    read_static,
    read_summary,
    recorder_process,
)
from tests.support.scripted_mission import CELL_M, COLS, RADIUS_M, ROWS, Mission, building
from tests.support.senders import Sender
from tests.wire.schemas import check

ERRORS = {"total": 2, "last": "", "by_code": {"malformed_message": 2, "no code": 3}}
FRAMES = 40
FRAME_S = 0.04
UTM = (500_012.0, 5_500_034.0)
DRAWN_FROM = np.array((500_000.0, 5_500_000.0))
HALL = tuple((UTM[0] + x, UTM[1] + y) for x, y in ((0, 0), (4, 0), (4, 6), (0, 6)))
STRIPS = "LineStrips3D:strips"


@dataclass(frozen=True)
class Recorded:
    path: Path
    mission: Mission
    summary: RecordingSummary
    report: dict
    exit_code: int


def play(mission: Mission, frames: int = FRAMES) -> None:
    for _ in mission.frames(frames):
        time.sleep(FRAME_S)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    with (
        pytest.MonkeyPatch.context() as patch,
        bus_on_free_port() as (bus, endpoint),
        recorder_process(bus, endpoint, out) as recorder,
    ):
        patch.setattr(scripted_mission, "ORIGIN", UTM)
        patch.setattr(scripted_mission, "HALL", HALL)
        mission = Mission(bus)
        play(mission)
        others = Sender(bus, topics.FLOOR), Sender(bus, topics.STATUS)
        others[0].put(b"\x00\x01\x00\x00not a map")
        # A second daemon of the name, which waits: it is not this robot's state.
        waits = {"state": "blocked", "claim": {"id": "1f", "stand": "waits"}}
        others[1].put(encode_json(waits))
        mission.publish_status("done", 1.0, planning=False, latency_ms="none", errors=ERRORS)
        report = recorder.wait_until(lambda report: report["malformed"] > 0)
        assert bus.alive(Keys().of(topics.RECORDER_ALIVE))
        # At the end there is not much time for what still waits.
        recorder.written(mission.sent + len(others))
        recorder.process.send_signal(signal.SIGTERM)
        exit_code = recorder.process.wait(60)
    path = Path(report["file"])
    return Recorded(path, mission, read_summary(path), report, exit_code)


def test_everything_on_the_bus_becomes_an_entity(recorded):
    rows = recorded.summary.rows
    assert rows[entities.PATH] == recorded.mission.revision
    # A field that has not changed is not drawn again.
    assert 2 < rows[entities.PHEROMONE] <= recorded.mission.revision
    assert rows[entities.ROBOT] == FRAMES
    assert rows[entities.FLOOR] == FRAMES // 4
    assert {entities.MAP, entities.DRIVEN_PATH, "metrics/latency/plan"} <= set(rows)
    assert recorded.summary.timelines == (entities.REPLAN, entities.WALL_CLOCK)
    assert 0.9 * FRAMES * FRAME_S < recorded.summary.duration_s < 300


def test_the_missions_inputs_are_recorded_byte_for_byte(recorded):
    samples = list(RecordedSamples([recorded.path]))
    counts = Counter(sample.topic for sample in samples)
    assert counts["pose"] == FRAMES
    assert counts[PATH_DIGEST] == recorded.mission.revision
    assert counts["status"] >= 2
    maps = [sample for sample in samples if sample.topic == "map"]
    assert maps[-1].sample.schema == OCCUPANCY_GRID
    assert maps[-1].sample.key == Keys().of(topics.MAP)
    grid = decode_occupancy_grid(maps[-1].sample.payload)
    assert (grid.geometry.origin.x, grid.geometry.origin.y) == UTM
    assert np.array_equal(grid.cells, building(1.0))
    assert [sample.at_ns for sample in samples] == sorted(sample.at_ns for sample in samples)
    assert len({sample.wall_ns - sample.at_ns for sample in samples}) == 1


def test_rooms_are_outlined_where_they_are_with_their_names(recorded):
    outlines = read_column(recorded.path, entities.ROOMS, STRIPS).values
    names = read_column(recorded.path, entities.ROOMS, "LineStrips3D:labels").values
    # A drive alone draws none anew.
    assert names == [["room 1", "room 2"], ["hall", "room 2"]]
    assert np.allclose(np.array(outlines[-1][0])[:, :2] + DRAWN_FROM, [*HALL, HALL[0]], atol=1e-4)


def test_the_end_is_orderly(recorded):
    assert recorded.exit_code == 0
    assert recorded.summary.complete
    # On a busy computer the recorder may find the daemon silent before it is told to stop.
    said = [state for state in recorded.summary.states if state != "silent"]
    assert said[-1] == "done"
    assert "blocked" not in recorded.summary.states
    assert read_column(recorded.path, entities.RECORDER_STATE, "StateChange:state").values == [
        ["recording"],
        ["stopping"],
    ]
    assert (recorded.summary.covered, recorded.summary.recovered) == (1.0, 3 / 500)


def test_the_path_and_the_one_before_lie_where_they_were_published(recorded):
    new, old = (
        [np.array(line)[:, :2] for lines in read_column(recorded.path, each, STRIPS).values
         for line in lines]
        for each in (entities.PATH, entities.OLD_PATH)
    )  # fmt: skip
    rest = recorded.mission.rest
    # Without the points it runs straight through.
    turns = (np.diff(rest, n=2, axis=0) ** 2).sum(axis=1) > 1e-6
    assert np.allclose(new[-1] + DRAWN_FROM, rest[[True, *turns, True]], atol=1e-4)
    assert len(old) > 2
    assert all(map(np.array_equal, old, new))


def test_paths_are_logged_and_their_numbers_are_curves(recorded):
    revision = recorded.mission.revision
    assert len(recorded.summary.paths) == revision
    assert recorded.summary.paths[0].startswith("path 1: first map (")
    # All came within a minute, for one reason: of them the layout shows the first.
    levels = read_column(recorded.path, entities.PATH_LOG, "TextLog:level").values
    assert levels == [["INFO"], ["INFO"], *[["DEBUG"]] * (revision - 2)]
    assert len(read_column(recorded.path, "metrics/plan/gap", SCALAR).values) == revision
    processor = read_column(recorded.path, "metrics/resources/processor", SCALAR).values
    assert {value for (value,) in processor} == {20}


def test_the_robot_and_the_ends_of_its_track_are_drawn(recorded):
    walk = recorded.mission.walk - DRAWN_FROM
    places = read_column(recorded.path, entities.ROBOT, "Transform3D:translation").values
    for entity, place, name, drawn in (
        (entities.START, walk[0], "start", places[0]),
        (entities.END, walk[-1], "end", places[-1]),
    ):
        assert read_column(recorded.path, entity, "Points3D:labels").values == [[name]]
        (point,) = read_column(recorded.path, entity, "Points3D:positions").values[-1]
        assert np.allclose([point[:2], drawn[0][:2]], [place, place], atol=1e-4)
    (half_size,) = read_static(recorded.path, entities.ROBOT_BODY, "Ellipsoids3D:half_sizes")[-1]
    assert half_size[:2] == pytest.approx([RADIUS_M, RADIUS_M])


def test_a_path_says_where_the_map_has_changed(recorded):
    labels = read_column(recorded.path, entities.REPLAN_REASON, "Points3D:labels").values
    assert labels == [["the map grew"]] * (recorded.mission.revision - 1)
    box = read_column(recorded.path, entities.REPLAN_WINDOW, STRIPS).values[-1][0]
    # The last columns of a building 8 m wide.
    corner = UTM - DRAWN_FROM
    assert np.allclose(np.min(box, axis=0)[:2], np.add(corner, (7.25, 0.5)), atol=1e-4)
    assert np.allclose(np.max(box, axis=0)[:2], np.add(corner, (7.75, 5.0)), atol=1e-4)


def test_the_map_is_not_mirrored(recorded):
    image = grid_image(recorded.path, entities.MAP)
    truth = building(1.0)[:, : image.shape[1]]
    assert image.shape == (ROWS, COLS)
    # An image's row 0 is its top, the map's has the smallest y.
    assert np.array_equal(image[::-1].view(np.int8), truth)
    assert not np.array_equal(image.view(np.int8), truth)
    for entity in (entities.MAP, entities.FLOOR, entities.PHEROMONE):
        corner = read_column(recorded.path, entity, "GridMap:translation").values[-1][0]
        assert np.array_equal(corner, [*(UTM - DRAWN_FROM), 0.0])


def test_the_pheromone_is_neither_flat_nor_misplaced(recorded):
    image = grid_image(recorded.path, entities.PHEROMONE)
    assert len(np.unique(image)) > 10
    assert image.max() == 255
    # The box at the lower right takes no pheromone: in the image, bottom right.
    assert not image[-5:, 24:28].any()
    assert image[1:5, 24:26].all()
    cell = read_column(recorded.path, entities.PHEROMONE, "GridMap:cell_size").values[-1][0]
    assert cell == pytest.approx(CELL_M)


def test_the_card_says_how_it_ended_from_then_on_only(recorded):
    states = read_column(recorded.path, entities.MISSION_STATE, "StateChange:state")
    done_ns = states.wall_ns[states.values.index(["done"])]
    cards = read_column(recorded.path, entities.RUN_CARD, "TextDocument:text")
    said = {
        at_ns: text for at_ns, (text,) in zip(cards.wall_ns.tolist(), cards.values, strict=True)
    }
    assert any("**under way**" in text for text in said.values())
    # The card of the end comes just before the state.
    assert ["**done**" in text for text in said.values()] == [at >= done_ns - 1 for at in said]
    assert "| drawn from | x 500000 m, y 5500000 m of the map's frame |" in list(said.values())[-1]
    (where,) = read_static(recorded.path, entities.WORLD, "Transform3D:translation")[-1]
    assert np.allclose(where, [*DRAWN_FROM, 0.0])


def test_a_malformed_sample_affects_no_other(recorded):
    report = recorded.report
    check("recorder.json", report)
    assert (report["malformed"], report["lost"], report["state"]) == (1, 0, "recording")
    assert 0 < report["rss_mb"] < 400
    lines = read_column(recorded.path, entities.BUS_LOG, "TextLog:text").values
    # The other daemon's status may overtake it: statuses go first on the bus.
    assert sum(Keys().of(topics.FLOOR) in line for (line,) in lines) == 1


def test_an_invalid_area_does_not_end_the_recorder(tmp_path):
    polygons = ([], [[]], [[0], [1, 1]], [[0, 0], [1, 0, 5], [1, 1]])
    with (
        bus_on_free_port() as (bus, endpoint),
        recorder_process(bus, endpoint, tmp_path) as recorder,
    ):
        status, command = Sender(bus, topics.STATUS), Sender(bus, topics.COMMAND)
        for polygon in polygons:
            area = {"name": "a", "polygon": polygon}
            order = {"zones": [area], "keep_out": [polygon]}
            command.put(encode_json({"command": "start", "order": order}))
            mission = {"zones": [area]}
            mission["keep_outs"] = [area, {"name": "b", "polygon": [[0, 0], [1, 1]]}]
            status.put(encode_json({"state": "covering", "mission": mission}))
        recorder.written(2 * len(polygons))
        assert recorder.process.poll() is None


@pytest.mark.parametrize(
    ("module", "absent"),
    [("recording.write.recorder", {"numba"}), ("review.review", {"rerun", "zenoh"})],
)
def test_a_module_brings_no_heavy_one_along(module, absent):
    check = f"import sys, fasaco_edge.{module}; sys.exit(bool({absent} & {{*sys.modules}}))"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0


def test_without_rerun_the_missing_extra_is_named(monkeypatch):
    from fasaco_edge.recording import sdk

    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtra, match="rerun"):
        runpy.run_path(sdk.__file__)


def test_a_torn_recording_is_repaired_at_the_next_start(recorded, tmp_path):
    content, torn = recorded.path.read_bytes(), tmp_path / "torn.rrd"
    # As a power cut would leave it: the last frame's end is missing.
    torn.write_bytes(content[: len(content) * 9 // 10])
    with bus_on_free_port() as (bus, endpoint):
        mission = Mission(bus)
        play(mission, 5)
        with recorder_process(bus, endpoint, tmp_path) as recorder:
            assert read_summary(torn).rows[entities.ROBOT] > FRAMES // 2
            # What is latched is there at once, though nobody publishes any more.
            second = Path(recorder.written(3)["file"])
            recorder.process.terminate()
            recorder.process.wait(60)
    lines = read_column(second, entities.RECORDER_LOG, "TextLog:text").values
    assert any(torn.name in line and "torn" in line for (line,) in lines)
    assert {entities.MAP, entities.PATH} <= set(read_summary(second).rows)


tiny_disk = disk_fixture("2m")


def test_a_disk_full_at_the_start_is_no_configuration_error(tiny_disk):
    with (tiny_disk / "ballast").open("wb", buffering=0) as ballast, suppress(OSError):
        while ballast.write(bytes(1024)):
            pass
    with pytest.raises(OSError, match="No space left on device") as caught:
        RecordingPart(tiny_disk / "a.rrd", "a")
    assert caught.value.errno == errno.ENOSPC


def grid_image(path: Path, entity: str) -> np.ndarray:
    """Return the last grid of ``entity`` as the image it was logged as, uint8."""
    size = read_column(path, entity, "GridMap:format").values[-1][0]
    pixels = read_column(path, entity, "GridMap:data").values[-1][0]
    return np.array(pixels, np.uint8).reshape(size["height"], size["width"])
