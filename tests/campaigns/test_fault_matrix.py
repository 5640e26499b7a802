"""The fault matrix's short form: two of its combinations, on a machine that may be busy."""

from __future__ import annotations

from tests.campaigns.fault_matrix import DRIVES, LIMIT_S, STOPS, Cell, run_cell

# A busy machine takes its time for a cycle, and for the start of what follows a fault [s].
BUSY_S = 2.0
WATCH_S = 6.0


def test_a_hung_planner_stops_the_robot_despite_a_second_daemon():
    """The second daemon restarts again and again."""
    cell = run_cell(Cell((("second daemon", "restarted"), ("planner", "frozen")), STOPS), WATCH_S)
    assert cell.last_s is None or cell.last_s <= LIMIT_S + BUSY_S
    assert cell.together == 0


def test_the_end_of_a_second_follower_leaves_the_robot_driving():
    cell = run_cell(Cell((("second follower", "killed"),), DRIVES), WATCH_S)
    assert cell.longest_gap_s <= BUSY_S
    assert cell.together == 0
