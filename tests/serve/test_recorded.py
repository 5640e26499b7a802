"""A recording in the page: a real recorder, a real server, real viewers."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rerun")
pytest.importorskip("websockets")

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.timeline import Timeline, open_timeline
from fasaco_edge.serve.recorded import JUMP_M, Playback, RecordedView, stepped, track_message
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path
from tests.serve.serving import Looker, looking, serving
from tests.serve.test_browser import browsing, has, needs_browser
from tests.support import scripted_mission as made_up
from tests.support.processes import fasaco_edge
from tests.support.recordings import bus_on_free_port, recorder_process
from tests.support.rooms import UNKNOWN, fill, map_bytes, pose_bytes, room
from tests.support.senders import Sender
from tests.support.waiting import until

SIZE_M = 4.0, 3.0
KEEP_OUT = [[2.0, 2.0], [2.4, 2.0], [2.4, 2.4]]
ORDER = {"zones": [{"name": "hall", "polygon": [[0, 0], [3, 0], [3, 2]]}], "keep_out": [KEEP_OUT]}
CONFIG = {"robot": {"tool_width_m": 0.3, "radius_m": 0.18}, "planner": {"line": "cells"}}
KEPT = {"name": "rug", "polygon": KEEP_OUT, "by": "operator"}
WEST, EAST = [0.45, 1.05], [1.05, 3.45]
# The floor that was swept: a square of 25 cm in all, the next one in part.
SWEPT = np.array([[100, 40, 0]], np.int8)


def told(folder: Path, **options: Any) -> list[Path]:
    folder.mkdir()
    with bus_on_free_port() as (bus, endpoint):
        names = ("map", "pose", "path", "status", "command", "floor")
        put = {name: Sender(bus, getattr(topics, name.upper())) for name in names}
        with recorder_process(bus, endpoint, folder, **options) as recorder:
            sent = 0

            def tell(name: str, payload: bytes, note: Any = None) -> None:
                nonlocal sent
                sent += 1
                put[name].put(payload, encode_json(note) if note else b"")
                time.sleep(0.05)

            def path(revision: int, xs: list[float]) -> None:
                line = np.array([(x, 0.45) for x in np.arange(xs[0], xs[1] + 0.1, 0.3)])
                note = {"revision": revision, "reason": "made up", "steps": len(line) - 1}
                tell("path", encode_path(line, np.zeros(len(line)), "map", 1), note)

            def status(state: str, revision: int, left: int, **more: Any) -> None:
                way = {"revision": revision, "reason": "made up", "remaining_steps": left}
                said = {"robot": "one", "state": state, "reason": f"path {revision}"}
                battery = {"level": 0.5, "power": "discharging"}
                said |= {"config": CONFIG, "path": way | {"steps": left}, "battery": battery}
                tell("status", encode_json(said | more))

            tell("map", map_bytes(fill(room(*SIZE_M), 2.0, 0.0, 4.0, 3.0, UNKNOWN)))
            tell("command", encode_json({"command": "start", "order": ORDER}))
            path(1, WEST)
            status("covering", 1, 2, mission={"zones": ORDER["zones"]})
            for x in (0.45, 0.75, 1.05):
                tell("pose", pose_bytes(x, 0.45))
            time.sleep(0.5)
            tell("map", map_bytes(room(*SIZE_M)))
            path(2, EAST)
            geometry = GridGeometry(*SWEPT.shape, 0.25, Pose2D(0.25, 0.25))
            tell("floor", encode_occupancy_grid(OccupancyGrid(geometry, SWEPT, "map", 1)))
            for x in (1.35, 1.65):
                tell("pose", pose_bytes(x, 0.45))
            if options:
                recorder.wait_until(lambda report: "-part1." not in report["file"])
            status("paused", 2, 6, mission={"paused": True, "keep_outs": [KEPT]})
            recorder.written(sent)
            recorder.process.terminate()
            recorder.process.wait(120)
    return sorted(folder.glob("*.rrd"))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    (one,) = told(tmp_path_factory.mktemp("one") / "runs")
    return one


@pytest.fixture(scope="module")
def timeline(file: Path) -> Iterator[Timeline]:
    with open_timeline([file]) as opened:
        yield opened


def between_s(timeline: Timeline) -> float:
    return 1e-9 * int(timeline.pose_ns[2] - timeline.began_ns) + 0.2


def at(looker: Looker, at_s: float) -> dict[str, Any]:
    looker.seen.pop("time", None)
    looker.send(kind="seek", at=at_s)
    looker.wait("time")
    return looker.seen


def points(message: dict[str, Any]) -> np.ndarray:
    xy = np.frombuffer(message["body"], "<f4").reshape(-1, 2)
    return xy + np.array([message["x"], message["y"]])


def test_each_time_is_shown_as_it_was_then(file, timeline, tmp_path):
    with serving(tmp_path, str(file)) as page, looking(page) as looker:
        recording = looker.wait("recording")
        assert recording["files"] == [file.name]
        assert recording["began_s"] == pytest.approx(1e-9 * timeline.began_ns)
        end_s, then_s = recording["seconds"], between_s(timeline)
        for _ in range(2):  # on from the beginning, and back from the end
            seen = at(looker, then_s)
            assert (seen["state"]["state"], seen["state"]["reason"]) == ("covering", "made up")
            assert seen["state"]["robot"] == "one"
            assert seen["state"]["battery"] == {"level": 0.5, "power": "discharging"}
            assert points(seen["path"])[:, 0] == pytest.approx([0.45, 0.75, 1.05])
            assert (seen["pose"]["x"], seen["pose"]["at"], seen["pose"]["path"]) == (1.05, 2, 1)
            assert [zone["name"] for zone in seen["areas"]["zones"]] == ["hall"]
            assert seen["areas"]["keep_out"] == []
            assert sorted(seen["time"]["has"]) == ["map", "path", "pose"]
            half = seen["map"]["body"].count(1)

            seen = at(looker, end_s)
            assert seen["state"]["state"] == "paused"
            assert points(seen["path"])[:, 0] == pytest.approx(np.arange(1.05, 3.5, 0.3))
            assert (seen["pose"]["x"], seen["pose"]["at"], seen["pose"]["path"]) == (1.65, 2, 2)
            assert [area["name"] for area in seen["areas"]["keep_out"]] == ["rug"]
            assert (seen["floor"]["x"], seen["floor"]["pixel"]) == pytest.approx((0.25, 0.25))
            assert list(seen["floor"]["body"]) == [0b1111111, 0b111, 0]
            assert seen["map"]["body"].count(1) > 1.5 * half
            assert seen["time"]["status"] == pytest.approx(end_s, abs=2.0)

        track = np.frombuffer(looker.wait("track")["body"], "<f4").reshape(-1, 3)
        assert track[:, 0] + looker.seen["track"]["x"] == pytest.approx(
            [0.45, 0.75, 1.05, 1.35, 1.65], abs=1e-3
        )
        assert np.all(np.diff(track[:, 2]) > 0)


def test_two_viewers_are_at_times_of_their_own(file, timeline, tmp_path):
    with serving(tmp_path, str(file)) as page, looking(page) as one, looking(page) as other:
        assert at(one, between_s(timeline))["state"]["state"] == "covering"
        assert at(other, 1e300)["state"]["state"] == "paused"
        assert at(one, between_s(timeline))["state"]["state"] == "covering"
        assert at(one, -1.0)["time"]["at"] == 0.0


def test_a_recording_takes_no_commands(file, tmp_path):
    tokens = tmp_path / "tokens"
    with serving(tmp_path, str(file), "--tokens", str(tokens)) as page:
        token = tokens.read_text().split("operator: ")[1].strip()
        with looking(page, token) as looker:
            assert looker.wait("welcome")["role"] == "viewer"
            assert "may only view" in looker.command("cancel")["text"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--allow-commands",), "--allow-commands: a page of a recording has no commands"),
        (("--robot", "two"), "--robot: a page of a recording has no commands and no bus"),
        (("--listen", "0.0.0.0:8000"), "lets other computers in, without any access control"),
    ],
)
def test_options_of_a_live_page_are_refused_for_a_recording(file, words, said):
    ended = fasaco_edge("serve", file, *words)
    assert ended.code == 78
    assert said in ended.err


def test_files_are_refused_as_a_review_refuses_them(file, tmp_path):
    damaged, foreign, pipe = (tmp_path / name for name in ("damaged.rrd", "foreign.rrd", "pipe"))
    content = bytearray(file.read_bytes())
    quarter = len(content) // 4  # 400 bytes alone may be in a picture, where nothing shows it
    content[quarter : 3 * quarter] = bytes(2 * quarter)
    damaged.write_bytes(content)
    foreign.write_text("no recording")
    os.mkfifo(pipe)
    for wrong in (damaged, foreign, pipe, tmp_path / "none.rrd"):
        ended, reviewed = fasaco_edge("serve", wrong), fasaco_edge("review", wrong)
        assert (ended.code, ended.err) == (reviewed.code, reviewed.err)
        assert ended.code == 1
        assert str(wrong) in ended.err


def test_parts_in_any_order_and_torn_are_one_time_line(tmp_path):
    parts = told(tmp_path / "runs", part_bytes=1)
    assert len(parts) > 1
    parts[-1].write_bytes(parts[-1].read_bytes()[:-7])
    with open_timeline(parts[::-1]) as whole:
        assert np.unique(whole.poses[:, 0]) == pytest.approx([0.45, 0.75, 1.05, 1.35, 1.65])
        playback = Playback(whole, parts)
        messages = playback.at(between_s(whole))
    assert '"state":"covering"' in "".join(text for text in messages if isinstance(text, str))


def test_a_deleted_file_is_shown_on_and_a_cut_one_named(file, tmp_path):
    copy = tmp_path / file.name
    copy.write_bytes(file.read_bytes())
    with open_timeline([copy]) as timeline, copy.open("r+b") as writable:
        playback = Playback(timeline, [copy])
        copy.unlink()
        assert len(playback.at(1e6)) > 5
        writable.truncate(1000)
        playback.at(0.0)
        with pytest.raises(UnreadableRecording, match="can no longer be read"):
            playback.at(1e6)


def test_far_from_zero_all_lies_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(made_up, "ORIGIN", (500_012.0, 5_500_034.0))
    out = tmp_path / "runs"
    out.mkdir()
    with bus_on_free_port() as (bus, endpoint), recorder_process(bus, endpoint, out) as recorder:
        mission = made_up.Mission(bus)
        for _ in mission.frames(20):
            time.sleep(0.04)
        recorder.wait_until(lambda report: report["messages"] > 20)
        recorder.process.terminate()
        recorder.process.wait(60)
    with open_timeline(list(out.glob("*.rrd"))) as timeline:
        for entity in (entities.MAP, entities.FLOOR, entities.PHEROMONE):
            place = timeline.newest(entity, timeline.ended_ns)
            origin = timeline.grid(place).geometry.origin
            assert (origin.x, origin.y) == pytest.approx(made_up.ORIGIN, abs=1e-6)
        half_ns = (timeline.began_ns + timeline.ended_ns) // 2
        begin = timeline.line(timeline.newest(entities.PATH, half_ns)).xy[0]
        assert np.abs(mission.walk - begin).sum(axis=1).min() < 0.01
        assert timeline.poses[-1, :2] == pytest.approx(mission.walk[-1], abs=0.01)


@pytest.mark.parametrize("steps", [0, 3, 10, 11, 500])
def test_a_path_has_its_points_again(steps):
    corners = np.array([(0.0, 0.0), (1.5, 0.0), (1.5, 0.3), (0.0, 0.3)])
    points = stepped(corners, steps)
    assert max(steps, 3) - 2 <= len(points) - 1 <= max(steps, 3)
    for corner in corners:
        assert np.abs(points - corner).sum(axis=1).min() == 0.0
    if steps == 11:  # 5 + 1 + 5 cells
        assert np.hypot(*np.diff(points, axis=0).T) == pytest.approx([0.3] * 11)
    assert len(stepped(corners[:0], steps)) == 0
    assert len(stepped(np.repeat(corners[:1], 2, axis=0), steps)) >= 2


def test_a_track_of_a_night_is_thinned(timeline):
    x = np.arange(400_000) * 0.04
    poses = np.column_stack((x, np.zeros(len(x)), np.zeros(len(x))))
    times = timeline.began_ns + np.arange(len(x)) * 100_000_000
    message = track_message(replace(timeline, pose_ns=times, poses=poses))
    assert len(message) < 1_000_000
    assert JUMP_M > 0.04 * 400_000 / 50_000
    empty = replace(timeline, pose_ns=times[:0], poses=poses[:0])
    assert track_message(empty)


def test_only_a_status_overdue_in_a_recording_is_silence():
    view = RecordedView("one")
    view.take("status", Sample("", json.dumps({"state": "covering"}).encode()), 100.0)
    assert view.silent_s(115.5) == 0.0
    assert view.silent_s(119.0) == 19.0


@needs_browser
def test_the_time_line_in_a_browser(file, timeline, tmp_path):
    def text(name: str) -> str:
        return str(tab.js(f"find({name!r}).textContent"))

    with (
        serving(tmp_path, str(file)) as page,
        browsing(page.url, tmp_path / "browser") as tab,
    ):
        until(lambda: text("state") == "paused")
        assert text("film").startswith(f"Recording {file.name}, begun ")
        assert tab.js("find('commands').offsetParent === null")
        tab.js(f"find('when').value = {between_s(timeline)}")
        tab.js("find('when').dispatchEvent(new Event('input'))")
        until(lambda: text("state") == "sweeping")
        assert tab.js("model.floor") is None
        until(lambda: has(tab.picture(), tab.js("colours.driven")) > 20)
        tab.click("play")
        until(lambda: text("state") == "paused" and text("play") == "Play")
        assert text("clock").split(" of ")[0] == text("clock").split(" of ")[1]
        assert tab.js("document.documentElement.scrollWidth <= innerWidth")
        assert tab.complaints == []
