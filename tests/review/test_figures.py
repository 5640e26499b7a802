"""Figures of small made-up missions, worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.run import RunRecord
from fasaco_edge.review.moments import (
    Span,
    faults_of,
    kind_of,
    longest_gap,
    longest_stand,
    spans_of,
)
from fasaco_edge.review.output.panels import curve
from fasaco_edge.review.run_data import PlanLog, RunData, StatusSample
from fasaco_edge.review.wording import clock
from fasaco_edge.wire.documents.replies import CoverageReport
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.documents.turns import Cycle, Decided, LogStart, PlanTaken, TurnBatch

ALL = Span("under way", 0.0, 100.0)


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
    at_s = np.arange(12.0)
    x = np.array([0, 1, 2, 2.01, 2.02, 2.02, 2.02, 3, 4, 4, 4, 4.0])
    yaw = np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3.0])
    trail = np.column_stack((x, np.zeros(12), yaw))
    stand = longest_stand(at_s, trail, ALL, [Span("paused", 4.0, 5.0)])
    assert (stand.at_s, stand.value) == (2.0, 4.0)
    assert stand.note == "at (2.00, 0.00) m: paused"
    assert longest_stand(at_s, trail, Span("", 50.0, 60.0)) is None


def test_gaps_reach_from_end_to_end():
    assert longest_gap([10.0, 30.0, 95.0], ALL).value == 65.0
    assert longest_gap([60.0, 70.0], ALL).at_s == 0.0
    assert longest_gap([], ALL).value == 100.0


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


def turn(number, *, ready=None, asked=None, path=None):
    plan = ready and PlanTaken(ready, 0.002 * ready, [], (1, 0, 0), 7)
    decided = Decided("covering", "", asked, path) if asked or path else None
    return Cycle(number, plan=plan, decided=decided)


def test_plans_are_told_from_those_that_became_a_path():
    log = PlanLog()
    first = [
        turn(1, asked=(1, "first plan")),
        turn(2, ready=1, path=(1, "first plan", 7), asked=(2, "spare time")),
    ]
    log.take(TurnBatch(1, [10.0, 10.5], first, LogStart("1", {})), at_s=3.0)
    # A path that was cut off just then is not the one that was planned.
    second = [
        turn(3, ready=2, path=(2, "better further on", 8), asked=(3, "map: 1 cell more")),
        turn(4, ready=3, path=(3, "path blocked at cell (1, 2)", 9)),
        turn(5, ready=4),
    ]
    log.take(TurnBatch(3, [11.0, 11.5, 12.0], second), at_s=5.0)
    assert [(p.reason, p.is_attempt, p.is_used) for p in log.plans] == [
        ("first plan", False, True),
        ("spare time", True, True),
        ("map: 1 cell more", False, False),
        ("", False, False),
    ]
    assert [p.at_s for p in log.plans] == [3.0, 4.0, 4.5, 5.0]
    assert [p.took_ms for p in log.plans] == [2.0, 4.0, 6.0, 8.0]
    # A daemon that was started again counts from 1 again.
    log.take(TurnBatch(1, [1.0], [turn(1, ready=3)], LogStart("1", {})), at_s=9.0)
    assert log.plans[-1].reason == ""


def test_counts_by_code_go_on_after_a_restart():
    plots = {
        "metrics/errors/wrong_frame": np.array([(0, 1), (1, 3), (2, 1), (3, 2)], np.float64),
        "metrics/latency/plan": np.array([(0, 9)], np.float64),
    }
    record = RunRecord("", (), 0, 0, RobotClock(0), plots, {}, {}, (), ())
    assert faults_of(RunData(), record).by_code == {"wrong_frame": 5}
