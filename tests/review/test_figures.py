"""Figures of small made-up missions, worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.cli.review.screen import curve
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.robot_clock import RobotClock, clock
from fasaco_edge.recording.read.run import RunRecord
from fasaco_edge.review.moments import (
    kind_of,
    longest_stand,
    refused_by_code,
    spans_of,
)
from fasaco_edge.review.review import review_of
from fasaco_edge.review.run_data import PathSample, RunData, StatusSample
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.replies import CoverageReport
from fasaco_edge.wire.documents.status import ErrorCounts, Status


def shares(drawn, counted):
    """Return a review of drawn shares, (time, share), and of counts, (time, covered, coverable).

    The mission is done once all is covered.
    """
    plots = {entities.COVERED_FRACTION: np.array(drawn, np.float64)}
    statuses = [
        StatusSample(
            at_s,
            Status(
                state="done" if covered == cells else "covering",
                coverage=CoverageReport(coverable=cells, covered=covered),
            ),
        )
        for at_s, covered, cells in counted
    ]
    record = RunRecord((), 0, 0, RobotClock(0), plots, {}, {}, np.zeros(2), ())
    return review_of(record, RunData(statuses=statuses), 0)


def test_shares_are_of_the_cells_known_at_the_end():
    drawn, begun = [(0.0, 0.0), (2.0, 0.5), (5.0, 0.6), (6.0, 0.4), (9.0, 0.9)], (0.0, 0, 50)
    found = shares(drawn, [begun, (4.0, 50, 100), (8.0, 100, 100)])
    assert found.covered_share[:, 0].tolist() == [0.0, 0.0, 2.0, 4.0, 5.0, 6.0, 8.0]
    assert found.covered_share[:, 1] == pytest.approx([0.0, 0.0, 0.375, 0.5, 0.6, 0.4, 1.0])
    # What was reached and then lost, as by a loop closure, counts once it is reached again.
    assert found.reached_s == dict.fromkeys((50, 90, 99, 100), 8.0)
    found = shares(drawn[:3], [begun, (4.0, 50, 100)])
    assert found.reached_s == {50: 4.0, 90: None, 99: None, 100: None}
    assert shares(drawn, []).reached_s is None


def test_the_longest_stand_neither_drives_nor_turns():
    x = [0, 1, 2, 2.01, 2.02, 2.02, 2.02, 3, 4, 4, 4, 4.0]
    yaw = [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3.0]
    poses = [(at_x, 0.0, at_yaw) for at_x, at_yaw in zip(x, yaw, strict=True)]
    data = RunData(pose_s=[float(at) for at in range(12)], poses=poses)
    states = spans_of([(0.0, "covering", ""), (4.0, "paused", ""), (5.0, "covering", "")], 12.0)
    stand = longest_stand(data, states)
    assert (stand.at_s, stand.seconds, stand.x, stand.y) == (2.0, 4.0, 2.0, 0.0)
    assert (stand.states, stand.reason) == (["covering", "paused"], "")
    # A robot of a fleet is "covering" while it waits: the path says for what.
    waits = PathAttachment(revision=2, reason="waits for r1")
    data.paths = [PathSample(0.0, PathAttachment(steps=9)), PathSample(2.5, waits)]
    assert longest_stand(data, states).reason == "waits for r1"
    assert longest_stand(data, spans_of([(0.0, "done", "")], 12.0)) is None
    assert longest_stand(data, spans_of([(50.0, "covering", "")], 60.0)) is None


def test_a_repeated_state_continues():
    spans = spans_of([(0, "a", "why"), (2, "a", ""), (3, "b", ""), (5, "a", "")], 9.0)
    assert [(s.name, s.begin_s, s.end_s, s.reason) for s in spans] == [
        ("a", 0, 3, "why"),
        ("b", 3, 5, ""),
        ("a", 5, 9.0, ""),
    ]


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        ("map: 3 cells more", "map: cells more"),
        ("map: 1 cell fewer", "map: cells fewer"),
        ("map: 3 cells more, 1 cell fewer", "map: cells more and fewer"),
        ("map: passages changed at 4 cells", "map: passages changed"),
        ("map and pose moved: 3 cells to be covered again", "map and pose moved"),
        ("path blocked at cell (3, 4)", "path blocked"),
        ("first plan, 30 cells were covered before", "first plan"),
        ("the pose jumped 1.20 m", "the pose jumped"),
        ("better further on", "better further on"),
        ("", "no reason given"),
    ],
)
def test_reasons_have_kinds(reason, kind):
    assert kind_of(reason) == kind


def test_a_curve_fills_its_picture():
    lines = curve(np.array([5.0]), np.array([1.0]), 10.0, 4, 2)
    assert lines == [" ███", " ███"]
    little = curve(np.array([0.0]), np.array([0.001]), 10.0, 4, 2)
    assert little == ["    ", "▁▁▁▁"]
    nearly = curve(np.array([0.0]), np.array([0.999]), 10.0, 4, 2)
    assert nearly == ["▇▇▇▇", "████"]


def test_times_are_printed_as_on_a_clock():
    assert [clock(s) for s in (-61.7, -0.04, 0, 59.96, 61.5, 3600, 7325.25)] == [
        "-1:01.7",
        "0:00.0",
        "0:00.0",
        "1:00.0",
        "1:01.5",
        "1:00:00.0",
        "2:02:05.2",
    ]


def test_counts_by_code_add_up_over_restarts():
    counts = ({"wrong_frame": 1}, {"wrong_frame": 3}, {"wrong_frame": 1, "odd": 1}, {"odd": 2})
    told = [
        StatusSample(float(at_s), Status(errors=ErrorCounts(by_code=by_code)))
        for at_s, by_code in enumerate(counts)
    ]
    assert refused_by_code(RunData(statuses=told)) == {"odd": 2, "wrong_frame": 4}
