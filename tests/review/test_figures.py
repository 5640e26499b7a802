"""Figures of small made-up missions, worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.cli.review.screen import curve
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.run import RunRecord
from fasaco_edge.review.moments import (
    faults_of,
    kind_of,
    longest_stand,
    spans_of,
)
from fasaco_edge.review.run_data import RunData, StatusSample
from fasaco_edge.review.wording import clock
from fasaco_edge.wire.documents.replies import CoverageReport
from fasaco_edge.wire.documents.status import Status


@pytest.mark.parametrize(
    ("counted", "first_s"),
    [
        ([(1.0, 0), (2.0, 2), (3.0, 3)], [1.5, 2.0, 3.0]),
        # A loop closure: one of three counts no more, then others do.
        ([(1.0, 3), (2.0, 2), (3.0, 2), (4.0, 4)], [1.0, 1.0, 3.5, 4.0]),
        ([(1.0, 3), (2.0, 0), (3.0, 1)], [3.0]),
    ],
    ids=["rising", "a loop closure", "a reset"],
)
def test_cells_that_stopped_counting_count_once_covered_again(counted, first_s):
    statuses = [
        StatusSample(at_s, Status(coverage=CoverageReport(covered=covered)))
        for at_s, covered in counted
    ]
    assert RunData(statuses=statuses).counted_s.tolist() == first_s


def test_the_longest_stand_neither_drives_nor_turns():
    x = [0, 1, 2, 2.01, 2.02, 2.02, 2.02, 3, 4, 4, 4, 4.0]
    yaw = [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3.0]
    poses = [(at_x, 0.0, at_yaw) for at_x, at_yaw in zip(x, yaw, strict=True)]
    data = RunData(pose_s=[float(at) for at in range(12)], poses=poses)
    states = spans_of([(0.0, "covering", ""), (4.0, "paused", ""), (5.0, "covering", "")], 12.0)
    stand = longest_stand(data, states)
    assert (stand.at_s, stand.seconds, stand.x, stand.y) == (2.0, 4.0, 2.0, 0.0)
    assert stand.states == ["covering", "paused"]
    assert longest_stand(data, spans_of([(0.0, "done", "")], 12.0)) is None
    assert longest_stand(data, spans_of([(50.0, "covering", "")], 60.0)) is None


def test_states_said_again_go_on():
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


def test_times_are_told_as_on_a_clock():
    assert [clock(s) for s in (0, 59.96, 61.5, 3600, 7325.25)] == [
        "0:00.0",
        "1:00.0",
        "1:01.5",
        "1:00:00.0",
        "2:02:05.2",
    ]


def test_counts_by_code_go_on_after_a_restart():
    plots = {
        "metrics/errors/wrong_frame": np.array([(0, 1), (1, 3), (2, 1), (3, 2)], np.float64),
        "metrics/latency/plan": np.array([(0, 9)], np.float64),
    }
    record = RunRecord("", (), 0, 0, RobotClock(0), plots, {}, {}, (), ())
    assert faults_of(RunData(), record).by_code == {"wrong_frame": 5}
