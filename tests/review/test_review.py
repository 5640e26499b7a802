"""Figures of a real mission, against what was heard on the bus and where the robot was in truth."""

from __future__ import annotations

import math
import struct
from itertools import groupby, pairwise

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.review.conversion import _used
from fasaco_edge.review.review import read_review
from tests.support.processes import fasaco_edge
from tests.support.recorded_mission import record_mission
from tests.support.reviews import document
from tests.support.rooms import TOOL_M

BROKEN_POSES = 3


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return record_mission(tmp_path_factory.mktemp("recording"), broken_poses=BROKEN_POSES)


@pytest.fixture(scope="module")
def review(recording):
    return read_review(recording.paths)


@pytest.fixture(scope="module")
def told(review):
    return document(review)


def test_cells_are_those_of_the_status(told, recording):
    coverage = recording.status["coverage"]
    assert told["covered_cells"] == coverage["covered"] > 50
    assert told["coverable_cells"] == coverage["coverable"]
    assert told["recovered_cells"] == coverage["recovered"]
    assert told["unreachable_cells"] == coverage["unreachable"]
    assert told["complete"] is True
    assert told["state"] == "done"


def test_floor_is_that_under_the_tool_of_the_simulated_robot(told, review, recording):
    """Counted here on a raster of its own, of five centimetres."""
    places = (np.indices((54, 72)).reshape(2, -1).T[:, ::-1] + 0.5) * 0.05
    shares = np.linspace(0, 1, 9)[:, None]
    pieces = [a + (b - a) * shares for a, b in pairwise(recording.trail)]
    swept = np.zeros(len(places), bool)
    for x, y in np.vstack(pieces):
        swept |= np.hypot(places[:, 0] - x, places[:, 1] - y) <= TOOL_M / 2
    assert told["swept_m2"] == pytest.approx(swept.sum() * 0.05**2, rel=0.05)
    assert told["swept_m2"] < told["reachable_m2"] < 3.5 * 2.6
    assert review.floor.figures.illegal_share == 0.0


def test_the_cells_are_those_under_the_simulated_tool(told, review, recording):
    window = review.lattice.window
    passed = {(row + window.row0, col + window.col0) for row, col in np.argwhere(review.visits)}
    # Poses come four times in a simulated second: the rim of the tool may pass a centre between
    # two of them. What it passes well inside is there, and nothing that it came not even near.
    well, nearly = (
        {cell for cell, _ in passed_cells(recording.trail, TOOL_M, reach)} for reach in (0.42, 0.58)
    )
    assert well <= passed <= nearly
    driven = sum(np.hypot(*(b - a)) for a, b in pairwise(recording.trail))
    # Corners are cut a little, for the same reason.
    assert told["driven_m"] == pytest.approx(driven, rel=0.03)


def test_shares_are_reached_when_they_were(told, review, recording):
    began = _began(recording, review)
    counts = [
        (at - began, status["coverage"]["covered"])
        for at, status in recording.statuses
        if status["coverage"]
    ]
    # The share is drawn every two seconds.
    late_s = _late_s(recording)
    for percent, at_s in told["reached_s"].items():
        needed = -(-told["coverable_cells"] * int(percent) // 100)
        assert all(count < needed for at, count in counts if at < at_s - 2.0 - late_s)
        assert all(count >= needed for at, count in counts if at > at_s + late_s)
    at_s, shares = review.covered_share.T
    assert np.all(np.diff(at_s) >= 0.0)
    assert shares[-1] == 1.0


def test_replans_match_the_recorded_paths(told, recording):
    notes = {note["revision"]: note for _, note in recording.notes}
    assert told["paths"] == len(notes) == recording.status["path"]["revision"]
    planned = [note for _, note in sorted(notes.items()) if note["planner"]]
    assert told["first_plan_ms"] == pytest.approx(planned[0]["plan_ms"], abs=0.001)
    took_ms = [note["plan_ms"] for note in planned[1:]]
    assert told["replans"] == len(took_ms) > 5
    assert told["replan_ms_p50"] == pytest.approx(
        np.percentile(took_ms, 50, method="inverted_cdf"), abs=0.001
    )
    assert told["replan_ms_p99"] == pytest.approx(
        np.percentile(took_ms, 99, method="inverted_cdf"), abs=0.001
    )
    assert told["replan_ms_max"] == pytest.approx(max(took_ms), abs=0.001)
    mine = told["replans_by_reason"]
    by_map = sum(note["reason"].startswith("map: ") for note in planned[1:])
    assert sum(count for kind, count in mine.items() if kind.startswith("map: ")) == by_map > 0
    assert sum(told["replans_by_reason"].values()) == len(took_ms)


def test_each_replan_says_why_and_where(told, recording):
    notes = {note["revision"]: note for _, note in recording.notes}
    for replan in told["replan_list"]:
        note = notes[replan["revision"]]
        assert replan["reason"] == note["reason"]
        assert replan["lower_bound_steps"] == note["lower_bound_steps"]
        assert replan["lower_bound_cost_s"] == note["lower_bound_cost_s"]
        assert (replan["gap"], replan["cost_s"]) == (note["gap"], note["planned_cost_s"])
        assert replan["changed"] == note["changed"]
        assert (note["changed"] is not None) == note["reason"].startswith(("map: ", "path blocked"))
    assert len(told["replan_list"]) == told["replans"]


def test_memory_and_threads_are_reported(told, recording):
    most = max(status["rss_mb"] for _, status in recording.statuses)
    assert told["memory_mb_max"] == pytest.approx(most, rel=0.11)
    assert told["restored_cells"] == 0
    used = [status["cpu_s"] for _, status in recording.statuses]
    assert told["processor_s"] == pytest.approx(used[-1] - used[0], abs=0.05)
    assert 0.0 < told["recorder_processor_s"] < 60.0


def test_processor_time_adds_up_over_restarts():
    assert _used([2.0, 5.0, 1.0, 4.0]) == 3.0 + 1.0 + 3.0
    assert _used([0.0, 0.0]) is None  # a daemon that does not tell it
    assert _used([]) is None


def test_states_match_the_recorded_statuses(told, review, recording):
    names = [name for name, _ in groupby(status["state"] for _, status in recording.statuses)]
    mine = [span.name for span in review.states]
    # The recorder joins later than the robot, and one that is busy takes the newest status alone.
    left = iter(names)
    assert all(name in left for name in mine), (mine, names)
    assert {"paused", "covering", "done"} <= set(mine)
    entered = {}
    for at, status in recording.statuses:
        entered.setdefault(status["state"], at)
    began = _began(recording, review)
    paused = next(span for span in review.states if span.name == "paused")
    assert paused.begin_s == pytest.approx(entered["paused"] - began, abs=_late_s(recording))
    assert sum(told["states"].values()) <= told["duration_s"] + 0.01


def test_faults_are_those_of_the_status(told, recording):
    assert recording.status["errors"]["by_code"] == {"malformed_message": BROKEN_POSES}
    assert told["faults_by_code"] == {"malformed_message": BROKEN_POSES}
    assert told["faults"] == BROKEN_POSES
    assert told["unreadable"] == {"pose": BROKEN_POSES}
    assert told["recorder_lost"] == 0
    assert told["samples_missing"] == 0


def test_the_card_says_what_was_run(told, recording):
    config = recording.status["config"]
    assert told["robot"] == recording.status["robot"]
    assert told["version"] == recording.status["version"]
    assert told["config"]["planner.budget_s"] == config["planner"]["budget_s"] == 0.05
    assert told["map"]["rows"] == recording.status["map"]["rows"]
    assert told["not_recorded"] == {}
    # It was not said to be simulated: times are the recorder's.
    assert (told["time_scale"], told["duration_s"]) == (1.0, told["recorded_s"])


def test_the_longest_stand_is_one(review, told):
    stand = told["longest_stand"]
    begin_s, end_s = stand["at_s"], stand["at_s"] + stand["seconds"]
    assert stand["seconds"] > 0.0
    # Times are in milliseconds: on a busy computer several poses come within one.
    for at_s, (x, y, _) in zip(review.data.pose_s, review.data.poses, strict=True):
        if begin_s + 0.002 < at_s < end_s - 0.002:
            assert np.hypot(x - stand["x"], y - stand["y"]) <= 0.05


def frame_ends(content: bytes) -> list[int]:
    """Return where the frames of a recording end: 12 bytes of header, then kind, length, body."""
    ends = [12]
    while ends[-1] < len(content):
        _, length = struct.unpack_from("<QQ", content, ends[-1])
        ends.append(ends[-1] + 16 + length)
    return ends


# Bytes behind the last whole frame: a cut may fall between two frames as well as into one.
@pytest.mark.parametrize(("share", "behind"), [(0.2, 0), (0.3, 17), (0.6, 1), (0.9, 0), (0.99, 17)])
def test_a_torn_file_is_read_as_far_as_it_is_whole(recording, review, tmp_path, share, behind):
    (whole,) = recording.paths
    content = whole.read_bytes()
    torn = tmp_path / "torn.rrd"
    # The footer is the last frame.
    end = max(at for at in frame_ends(content)[:-2] if at <= share * len(content))
    torn.write_bytes(content[: end + behind])
    before = torn.read_bytes()
    cut = read_review([torn])
    assert torn.read_bytes() == before
    told = document(cut)
    assert told["files"][0]["torn_bytes"] == behind
    assert told["files"][0]["ended"] is False
    if cut.visits is None:
        assert told["swept_m2"] is None
        assert told["not_recorded"]
        return
    # What is there is the beginning of the same drive.
    assert cut.data.poses == review.data.poses[: len(cut.data.poses)]
    assert (told["covered_cells"] or 0) <= review.data.counts.covered
    assert cut.duration_s <= review.duration_s


def test_a_part_that_was_only_begun_says_nothing(recording, review, tmp_path):
    begun = tmp_path / "begun.rrd"
    begun.touch()
    both = read_review([*recording.paths, begun])
    assert both.duration_s == review.duration_s
    begun.write_bytes(b"no recording")
    with pytest.raises(UnreadableRecording, match="this is no recording"):
        read_review([*recording.paths, begun])


def test_the_command_prints_a_report(recording, told):
    ended = fasaco_edge("review", *recording.paths, "--long")
    assert ended.code == 0
    for text in (
        f"{told['covered_cells']} of {told['coverable_cells']} cells",
        "Coverage over time",
        "Reasons of replans",
        "malformed_message",
        ": complete",
    ):
        assert text in ended.out


def _began(recording, review):
    """When the recording began by the clock of the statuses, told by the state it ended with."""
    done = next(at for at, status in recording.statuses if status["state"] == "done")
    span = next(span for span in review.states if span.name == "done")
    return done - span.begin_s


def _late_s(recording):
    """How late a status may come: a slow computer brings them late."""
    return 0.3 + max(np.diff([at for at, _ in recording.statuses]))


STRIDE_M = 0.001


def passed_cells(trail, cell_m, reach=0.5):
    """Return the cells (row, col) whose centre came to lie under the tool, and after how far [m].

    The tool reaches so many cells around its middle: as wide as a cell, half of one. A cell is
    passed anew once the tool has left its centre.
    """
    passed, under, way = [], None, 0.0
    points = [trail[0]]
    for begin, end in pairwise(trail):
        count = max(math.ceil(math.dist(begin, end) / STRIDE_M), 1)
        points += [begin + (end - begin) * (k + 1) / count for k in range(count)]
    last = points[0]
    for point in points:
        way += math.dist(last, point)
        last = point
        cell = (math.floor(point[1] / cell_m), math.floor(point[0] / cell_m))
        centre = ((cell[1] + 0.5) * cell_m, (cell[0] + 0.5) * cell_m)
        now = cell if math.dist(point, centre) < reach * cell_m - 1e-9 else None
        if now is not None and now != under:
            passed.append((now, way))
        under = now
    return passed
