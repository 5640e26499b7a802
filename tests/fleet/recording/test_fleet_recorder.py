"""All robots of a fleet are in one recording, whatever one of them sends, and a review reads it."""

from __future__ import annotations

import json
import re
import time

import pytest

pytest.importorskip("rerun")

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli import review
from fasaco_edge.cli.console.arguments import Exit
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.fleet.mission.frames import MOST_OTHERS
from fasaco_edge.fleet.observer import observed
from fasaco_edge.fleet.recording import recorder, scene
from fasaco_edge.fleet.recording.notes import read_notes
from fasaco_edge.fleet.recording.recorder import FleetRecorder
from fasaco_edge.fleet.review.report import FleetFigures, FleetRobotFigures, review_fleet
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import is_fleet_recording
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.wire.documents.fleet import FleetPart
from fasaco_edge.wire.limits import MAX_RESOLUTION_M, MIN_RESOLUTION_M
from tests.fleet.told import CELL_M, Teller
from tests.support import viewer
from tests.support.processes import fasaco_edge
from tests.support.recordings import bus_on_free_port, read_column, read_summary
from tests.support.rooms import room

TEXT = "TextLog:text"


class Studio:
    def __init__(self, bus, recorder, out):
        self.bus, self.recorder, self.out = bus, recorder, out

    def pass_time(self, seconds):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.recorder.step(0.02)

    def until(self, holds, most_s=30.0):
        until = time.monotonic() + most_s
        while not holds():
            assert time.monotonic() < until
            self.recorder.step(0.02)

    def joined(self, *names):
        return {member.name for member in self.recorder._members} >= set(names)

    def shows(self, name):
        return self.recorder._scene._drawn[name].known is not None

    def parts(self):
        assert self.recorder.end()
        return sorted(self.out.glob("*.rrd"))


@pytest.fixture
def studio(tmp_path):
    with (
        bus_on_free_port() as (_, endpoint),
        open_bus(BusSettings(connect=(endpoint,))) as heard,
        open_bus(BusSettings(connect=(endpoint,))) as told,
    ):
        recorder = FleetRecorder(
            DaemonConfig(), heard, "house", DiskBudget(tmp_path / "out", 10**9, 0)
        )
        recorder.listen()
        time.sleep(0.3)
        yield Studio(told, recorder, tmp_path / "out")


def log_of(part):
    return [str(line[0]) for line in read_column(part, entities.FLEET_LOG, TEXT).values]


def test_each_robot_even_a_late_one_has_a_tree_of_its_own(studio):
    first = Teller(studio.bus, "r1")
    Teller(studio.bus, "stranger").tell(fleet="yard", cells=[(0, 0)])
    first.tell(cells=[(2, 2), (2, 3)])
    studio.until(lambda: studio.joined("r1"))
    studio.pass_time(0.5)
    first.show(room(9.0, 6.0))
    first.stand(1.0, 1.0)
    first.stand(1.4, 1.0)
    studio.pass_time(1.0)
    late = Teller(studio.bus, "late")
    late.tell(cells=[(9, 9)], waits_for="r1")
    studio.until(lambda: studio.joined("late"))
    studio.pass_time(1.3)
    (part,) = studio.parts()
    assert is_fleet_recording(part)
    found = read_summary(part).rows
    for name in (
        "world/map",
        "world/swept",
        "world/robot",
        "world/trail",
        "state",
        "metrics/left_cells",
    ):
        assert found.get(f"robots/r1/{name}"), name
    assert found["robots/late/world/swept"]
    assert not [name for name in found if "stranger" in name]
    states = read_column(part, "robots/late/state", "StateChange:state").values
    assert states[0] == ["waiting"]
    assert any("late: waiting for r1" in line for line in log_of(part))


def test_robots_present_at_first_have_colours_by_name(studio):
    # By which was heard first, they differed from one recording to the next, and from pictures.
    for name in ("r2", "r3", "r1"):
        Teller(studio.bus, name).tell(cells=[(2, 2)])
        studio.pass_time(0.1)
    studio.until(lambda: studio.joined("r1", "r2", "r3"))
    late = Teller(studio.bus, "a-late-one")
    late.tell(cells=[(9, 9)])
    studio.until(lambda: studio.joined("a-late-one"))
    assert [member.name for member in studio.recorder._members] == ["r1", "r2", "r3", "a-late-one"]


def test_a_faulty_robot_does_not_harm_the_others(studio):
    bad, good = Teller(studio.bus, "bad"), Teller(studio.bus, "good")
    bad.tell()
    good.tell(cells=[(0, 0)])
    studio.until(lambda: studio.joined("bad", "good"))
    studio.pass_time(0.3)
    for number in range(400):
        bad.tell(cells=[(number, 64 * 900)], x=float(number))
        bad.send("pose", b"rubbish")
        bad.send("status", b"{")
    good.tell(cells=[(0, 0), (0, 1)])
    good.stand(0.2, 0.2)
    studio.pass_time(1.5)
    bad.send("fleet", b'{"version": 9, "fleet": "house"}')
    studio.pass_time(0.3)
    (part,) = studio.parts()
    log = log_of(part)
    for topic in ("pose", "status"):
        assert any(line.startswith(f"bad: {topic}: 1 refused") for line in log)
    assert any("messages are of version 9" in line for line in log)
    assert not any(line.startswith("good:") and "refused" in line for line in log)
    assert part.stat().st_size < 2_000_000
    figures = review_fleet([part]).figures
    by_name = {robot.name: robot for robot in figures.robots}
    assert by_name["good"].swept_m2 == pytest.approx(2 * CELL_M**2, abs=0.01)
    assert by_name["bad"].swept_m2 <= 0.1
    assert by_name["bad"].kb_s > 5 * by_name["good"].kb_s


@pytest.mark.parametrize("cell_m", [5e-324, MIN_RESOLUTION_M, MAX_RESOLUTION_M, 1e15])
def test_no_size_of_cells_ends_the_recording_of_the_others(studio, cell_m):
    odd, good = Teller(studio.bus, "odd"), Teller(studio.bus, "good")
    good.tell()
    # As far away as rows and columns go.
    odd.tell(cell_m=cell_m, cells=[(0, 0)], parts=(FleetPart("odd", 2**30, -(2**30), 0.0, 1.0),))
    studio.until(lambda: studio.joined("good"))
    studio.pass_time(0.3)
    odd.stand(1e7, -1e7)
    good.tell(cells=[(0, 0), (0, 1)])
    studio.pass_time(1.3)
    (part,) = studio.parts()
    is_size = MIN_RESOLUTION_M <= cell_m <= MAX_RESOLUTION_M
    assert studio.joined("odd") == is_size
    assert any("odd: fleet: 1 refused" in line for line in log_of(part)) != is_size
    assert "good" in {robot.name for robot in review_fleet([part]).figures.robots}


def test_names_without_end_leave_room_for_a_late_robot(studio, monkeypatch):
    monkeypatch.setattr(recorder, "MOST_FAULTS", 8)
    monkeypatch.setattr(observed, "MOST_MEMBERS", 1)
    late = Teller(studio.bus, "late")
    Teller(studio.bus, "good").tell()
    studio.until(lambda: studio.joined("good"))
    late.tell()
    studio.until(lambda: studio.recorder._faults)
    strangers = [Teller(studio.bus, f"bad{number}") for number in range(MOST_OTHERS)]
    for payload in (b"rubbish", b'{"version": 9, "fleet": "house"}'):
        for stranger in strangers:
            stranger.send("fleet", payload)
        studio.pass_time(0.5)
    monkeypatch.setattr(observed, "MOST_MEMBERS", 2)

    def has_joined():
        late.tell()
        return studio.joined("late")

    studio.until(has_joined, 5.0)
    assert len(studio.recorder._faults) <= 8 + 2
    (part,) = studio.parts()
    log = log_of(part)
    assert any("late: 1 robots of a fleet are observed at most" in line for line in log)
    assert any(line.startswith("other robots: fleet: 8 refused") for line in log)
    assert not any(line.startswith("bad63") for line in log)


def test_maps_of_many_robots_leave_room_in_a_part(studio, monkeypatch):
    monkeypatch.setattr(scene, "MOST_PIXELS", 4_000)
    robots = [Teller(studio.bus, f"r{number}") for number in range(5)]
    for robot in robots:
        robot.tell()
    studio.until(lambda: studio.joined(*(robot.name for robot in robots)))
    for robot in robots:
        robot.show(room(12.0, 12.0))
    for robot in robots:
        studio.until(lambda name=robot.name: studio.shows(name))
    (part,) = studio.parts()
    for robot in robots:
        (data,) = read_column(part, f"robots/{robot.name}/world/map", "GridMap:data").values[-1]
        assert len(data) <= 4 * 1_000


def test_samples_left_out_are_reported_once(studio, monkeypatch):
    wide, large = Teller(studio.bus, "wide"), Teller(studio.bus, "large")
    wide.tell(cells=[(0, 0)])
    large.tell(cells=[(1, 0)])
    studio.until(lambda: studio.joined("wide", "large"))
    studio.pass_time(0.3)
    monkeypatch.setattr(studio.recorder._inbox, "_capacity", 16_000)
    for col in (900, 901):
        wide.tell(cells=[(0, 64 * col)])
        large.send("status", bytes(20_000))
        studio.pass_time(1.3)
    (part,) = studio.parts()
    for line in (f"wide: {recorder.TOO_WIDE}", f"large: {recorder.TOO_LARGE}"):
        assert log_of(part).count(line) == 1


def test_a_change_of_frame_is_reported_and_starts_from_zero(studio):
    robot = Teller(studio.bus, "r1")
    robot.tell(cells=[(0, 0)])
    studio.until(lambda: studio.joined("r1"))
    studio.pass_time(0.3)
    robot.tell(cells=[(5, 5), (5, 6)], frame="other", origin=(3.0, 0.0, 90.0))
    studio.pass_time(1.3)
    (part,) = studio.parts()
    assert any("its frame has changed" in line for line in log_of(part))
    assert [batch.robots[0].x for batch in read_notes([part])][-1] == 3.0


def test_a_later_part_can_be_read_alone(studio):
    robot = Teller(studio.bus, "r1")
    robot.tell(cells=[(row, 4) for row in range(10)])
    studio.until(lambda: studio.joined("r1"))
    studio.pass_time(1.2)
    studio.recorder._write()
    studio.recorder.writer._begin_part()
    robot.tell(cells=[(row, 5) for row in range(10)])
    studio.pass_time(1.3)
    first, second = studio.parts()
    alone = review_fleet([second]).figures
    assert alone.robots[0].swept_m2 == pytest.approx(20 * CELL_M**2, abs=0.01)
    assert review_fleet([first, second]).figures.swept_m2 == alone.swept_m2


def test_the_review_of_a_fleet_is_printed_and_drawn(studio, tmp_path):
    robots = [Teller(studio.bus, name) for name in ("r1", "r2")]
    for robot in robots:
        robot.tell()
    studio.until(lambda: studio.joined("r1", "r2"))
    for step in range(4):
        for number, robot in enumerate(robots):
            robot.tell(cells=[(2 + number, col) for col in range(step)])
            robot.stand(0.3 * step + 0.1, 0.3 * (2 + number) + 0.1)
        studio.pass_time(0.5)
    (part,) = studio.parts()
    picture = tmp_path / "fleet.png"
    ended = fasaco_edge("review", part, "--png", picture)
    assert ended.code == 0, ended.err
    assert len(ended.out.splitlines()) <= 24
    assert picture.read_bytes()[:4] == b"\x89PNG"
    document = json.loads(fasaco_edge("review", part, "--json").out)
    assert [robot["name"] for robot in document["robots"]] == ["r1", "r2"]
    assert document["swept_m2"] == pytest.approx(6 * CELL_M**2, abs=0.01)
    for words in (["--at", "0:01"], ["--at", "0"], ["--long"]):
        refused = fasaco_edge("review", part, *words)
        assert refused.code == Exit.CONFIG
        assert f"{words[0]}: this is the recording of a fleet" in refused.err
    replayed = fasaco_edge("replay", part)
    assert "this is the recording of a fleet" in replayed.err
    assert "hint: name the recording of one of its robots" in replayed.err


def test_each_figure_of_a_fleet_is_in_the_help():
    told = review.COMMAND.epilog.partition("For a fleet it has:")[2]
    figures = (*FleetFigures.__struct_fields__, *FleetRobotFigures.__struct_fields__)
    others = {"by", "cells", "and", "each", "with"}
    assert [word for word in re.findall(r"\w+", told) if word not in others] == list(figures)


@pytest.mark.skipif(not viewer.drivers(), reason="no software renderer")
def test_the_layout_shows_all_robots_and_no_view_complains(studio):
    robots = [Teller(studio.bus, name) for name in ("r1", "r2")]
    for number, robot in enumerate(robots):
        robot.tell(cells=[(3 + number, col) for col in range(9)])
    studio.until(lambda: studio.joined("r1", "r2"))
    for robot in robots:
        robot.show(room(9.0, 6.0))
    studio.pass_time(2.5)
    with viewer.headless_viewer() as client:
        shot = viewer.shoot(client, studio.parts(), 1.0)
    assert shot.complaints == ()
    assert {"Robots, paths, swept floor, shares", "Who does what", "States", "Log"} < set(
        shot.views
    )


def test_a_recording_without_a_fleet_is_named(tmp_path):
    file = tmp_path / "none.rrd"
    file.write_bytes(b"RRF2" + bytes(8))
    with pytest.raises(UnreadableRecording, match="no notes of a fleet"):
        read_notes([file])
