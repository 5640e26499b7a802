"""Cells that the robot comes back to for floor that it has left."""

from __future__ import annotations

from fasaco_edge.mission.coverage.mission_ledger import MOST_AGAIN, MissionLedger
from tests.mission.world import CELL, pose_at


def test_the_robot_comes_back_to_a_cell_a_few_times_only():
    ledger = MissionLedger(CELL, CELL)
    for _ in range(MOST_AGAIN):
        assert ledger.may_open_again((0, 1))
        ledger.open_again([(0, 1)])
    assert not ledger.may_open_again((0, 1))
    assert ledger.may_open_again((1, 0))
    ledger.begin_elsewhere("map")
    assert ledger.may_open_again((0, 1))


def test_a_reopened_cell_is_covered_only_by_another_visit():
    ledger = MissionLedger(CELL, CELL)
    for col in (0, 1, 2):
        ledger.record(pose_at(0, col).pose.pose)
    before = ledger.version
    ledger.open_again([(0, 1), (5, 5)])
    assert ledger.version != before
    assert [ledger.current.has_visited((0, col)) for col in (0, 1, 2)] == [True, False, True]
    assert not ledger.current.has_visited((5, 5))
    ledger.record(pose_at(0, 1).pose.pose)
    assert ledger.current.has_visited((0, 1))
