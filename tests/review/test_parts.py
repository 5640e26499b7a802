"""Recordings in several parts, of several runs, or without what a review needs."""

from __future__ import annotations

import json
import signal
import time

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("rerun")

from fasaco_edge.cli import main
from fasaco_edge.errors import DifferentRuns
from fasaco_edge.recording.read.frames import recording_id
from fasaco_edge.review.comparison import side_by_side
from fasaco_edge.review.conversion import document_of
from fasaco_edge.review.output.rows import screen_rows
from fasaco_edge.review.review import read_review
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.paths import encode_path
from tests.support.recordings import TIMEOUT_S, begun_parts, told_recorder
from tests.support.reviews import document
from tests.support.rooms import map_bytes, pose_bytes, room

CONFIG = {"robot": {"tool_width_m": 0.3, "radius_m": 0.18}, "mission": {"lost_pose_s": 3.0}}
# Three cells to the right and back, in the lowest row of the room.
WAY = [0.45, 0.75, 1.05, 1.35, 1.05, 0.75]
Y = 0.45
PATHS = (
    ("fasaco", 50.0, "first plan"),
    ("fasaco", 4.0, "map: 1 cell more"),
    ("fasaco", 8.0, "path blocked at cell (1, 2)"),
    (None, 0.0, "stopped"),
)
DEAD_DOCK = {"code": "no_current", "text": "the dock gives no current"}


def run_told(folder, *, faults, silent=0, killed=False):
    with told_recorder(folder, part_bytes=1) as told:
        told.tell("map", map_bytes(room(2.4, 1.8)))
        told.tell("status", _status("planning", "first plan", {}))
        for revision, (planner, ms, why) in enumerate(PATHS):
            note = {"revision": revision + 1, "reason": why, "planner": planner, "plan_ms": ms}
            told.tell("path", _path(), note)
        told.tell("status", _status("covering", "path 1", {}))
        for x in WAY:
            told.tell("pose", pose_bytes(x, Y))
        # A part ends with a flush, and these are seconds apart.
        told.recorder.wait_until(lambda report: "-part1." not in report["file"])
        told.tell("status", _status("degraded", "no pose for 3 s", {}))
        told.tell("status", _status("paused", "paused by command", {}, troubles=[DEAD_DOCK]))
        told.tell("status", _status("covering", "path 1", faults))
        for _ in range(silent):
            told.tell("status", _status("covering", "path 1", faults | {"late": 1}))
        if killed:
            told.recorder.written(told.sent)
            kill_within_a_part(told.recorder, folder, faults)
            told.recorder.process.wait(120)
        else:
            told.end()
    return sorted(folder.glob("*.rrd"))


def kill_within_a_part(recorder, folder, faults):
    """Kill it once all faults are on the disk, and the newest part with anything in it is open.

    What came is written once a second, and as often a part of so small a run ends.
    """
    deadline, told = time.monotonic() + TIMEOUT_S, {"files": [], "faults_by_code": {}}
    while not faults.items() <= told["faults_by_code"].items() or told["files"][-1]["ended"]:
        assert time.monotonic() < deadline, (told["files"][-1:], told["faults_by_code"])
        recorder.process.send_signal(signal.SIGCONT)
        time.sleep(0.1)
        recorder.process.send_signal(signal.SIGSTOP)
        told = document(read_review(begun_parts(folder)))
    recorder.process.kill()


def _status(state, reason, faults, troubles=()):
    errors = {"total": sum(faults.values()), "last": "one", "by_code": faults}
    return encode_json(
        {"robot": "robot", "version": "9", "state": state, "reason": reason, "config": CONFIG}
        | {"coverage": {"coverable": 24, "covered": 0 if state == "planning" else 4}}
        | {"errors": errors, "recorder": {"lost": 2}, "map": {"rows": 1}, "troubles": troubles}
    )


def _path():
    xy = np.array([(0.45, Y), (0.75, Y)])
    return encode_path(xy, np.zeros(2), "map", 1)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    return run_told(tmp_path_factory.mktemp("one") / "runs", faults={"wrong_frame": 2}, silent=1)


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    return run_told(tmp_path_factory.mktemp("other") / "runs", faults={})


def test_parts_are_one_run(parts):
    assert len(parts) >= 2
    told = document(read_review(list(reversed(parts))))
    assert len(told["files"]) == len(parts)
    assert told["driven_m"] == pytest.approx(1.5)
    assert (told["covered_cells"], told["coverable_cells"]) == (4, 24)
    assert told["reached_s"]["50"] is None
    assert told["complete"] is False
    # Each part begins with the state in force.
    last = read_review(parts[-1:])
    assert all(span.begin_s >= 0 for span in last.states)
    assert last.lattice is not None
    assert (document(last)["robot"], document(last)["samples_missing"]) == ("robot", 0)


def test_progress_is_reported(parts, monkeypatch):
    monkeypatch.setattr("fasaco_edge.review.review.REPORT_EVERY", 2)
    told = []
    read_review(parts, lambda *what: told.append(what))
    # The poses of a long recording take longest, so they move the bar, too.
    assert [counts for what, *counts in told if what == "poses"] == [[0, 6], [2, 6], [4, 6]]
    assert list(dict.fromkeys(what for what, _, _ in told)) == [
        "reading kB",
        "decoding",
        "poses",
    ]
    reading = [(done, total) for what, done, total in told if what == "reading kB"]
    assert [done for done, _ in reading] == sorted(done for done, _ in reading)
    # The bar has room for numbers of six digits.
    assert {total for _, total in reading} == {sum(part.stat().st_size for part in parts) // 1000}
    assert 0.5 * reading[-1][1] < reading[-1][0] <= reading[-1][1]


def test_paths_without_a_plan_do_not_count_as_replans(parts):
    told = document(read_review(parts))
    assert told["paths"] == 4
    assert told["first_plan_ms"] == 50.0
    assert told["replans_by_reason"] == {"map: cells more": 1, "path blocked": 1}
    assert [told["replans"]] == [order["replans"] for order in told["orders"]] == [2]
    assert (told["replan_ms_p50"], told["replan_ms_p99"], told["replan_ms_max"]) == (4.0, 8.0, 8.0)


def test_troubles_and_faults_are_reported(parts):
    review = read_review(parts)
    told = document(review)
    # On a slow computer the planner is heard late, too.
    row = dict(screen_rows(read_review(parts), document_of(read_review(parts))))["troubles"]
    assert "degraded" not in row
    troubles = [one for one in told["troubles"] if one["state"] != "silent"]
    assert troubles[0]["reason"] in row
    assert [(one["state"], one["reason"]) for one in troubles] == [
        ("degraded", "no pose for 3 s"),
        ("paused", "the dock gives no current"),
    ]
    texts = [line for _, line in review.record.texts["log/mission"]]
    assert texts.index("trouble: the dock gives no current") < texts.index(
        "trouble is over: the dock gives no current"
    )
    assert told["recorder_lost"] == 2
    assert told["faults_by_code"] == {"wrong_frame": 2, "late": 1}
    assert told["faults"] == 3


def test_a_killed_recorder_loses_no_figures(tmp_path, parts):
    files = run_told(tmp_path / "runs", faults={"wrong_frame": 2}, silent=1, killed=True)
    content = [file.read_bytes() for file in files]
    told, whole = document(read_review(files)), document(read_review(parts))
    assert [file.read_bytes() for file in files] == content
    assert told["files"][-1]["ended"] is False
    for name in ("driven_m", "swept_m2", "replans_by_reason", "paths", "state"):
        assert told[name] == whole[name]
    assert told["faults_by_code"]["wrong_frame"] == 2


def test_the_newest_of_several_runs_is_reviewed(parts, other, capsys):
    """As of ``review recordings/*.rrd`` in the guide."""
    with pytest.raises(DifferentRuns, match="parts of different runs"):
        read_review([parts[0], other[0]])
    earlier, newest = sorted(map(recording_id, (parts[0], other[0])))
    assert main(["review", *map(str, (*parts, *other)), "--json"]) == 0
    told = capsys.readouterr()
    assert newest.startswith(json.loads(told.out)["recording"])
    assert f"2 runs: this is the newest, {newest}; for another run" in told.err
    assert f"as {earlier}-*.rrd" in told.err


def test_a_recording_has_the_name_of_its_files(parts, tmp_path):
    copies = [tmp_path / f"monday-part{number}.rrd" for number in range(1, len(parts) + 1)]
    for copy, part in zip(copies, parts, strict=True):
        copy.write_bytes(part.read_bytes())
    assert document_of(read_review(copies)).recording == "monday"


def test_two_runs_side_by_side(parts, other, tmp_path, capsys):
    one, two = (document_of(read_review(files)) for files in (parts, other))
    both = side_by_side(one, two)
    assert (both["recording"]["faults"], both["against"]["faults"]) == (one.faults, two.faults)
    assert one.faults == two.faults + 3
    one_alone, both_png = tmp_path / "one.png", tmp_path / "both.png"
    words = ["review", *map(str, parts)]
    assert main([*words, "--png", str(one_alone)]) == 0
    words += ["--against", *map(str, other), "--png", str(both_png)]
    capsys.readouterr()
    assert main(words) == 0
    table = capsys.readouterr().out
    with Image.open(one_alone) as alone, Image.open(both_png) as drawn:
        assert 1.5 * alone.width < drawn.width < 2.5 * alone.width
    assert "messages refused" in table
    assert "+3" in table
