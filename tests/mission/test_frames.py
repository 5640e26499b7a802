"""Which frame counts, and that no single message in a wrong one ever decides it."""

from dataclasses import replace

import pytest

from fasaco_edge.errors import LedgerMismatchError, WrongFrame
from fasaco_edge.mission.events import MapReceived, State
from fasaco_edge.mission.map.frame_selector import PATIENCE_S
from tests.mission.world import Drive, building, patch, pose_at, started

HALL = ("########", *("#......#",) * 4, "########")
MAP, ODOM = MapReceived(building(*HALL)), MapReceived(building(*HALL, frame="odom"))
HERE, THERE = pose_at(1, 1), pose_at(1, 1, frame="odom")


@pytest.fixture
def driven():
    drive = started(*HALL, cell=(1, 1))
    drive.go(times=6)
    return drive


def told_for(drive, seconds, *events):
    """Tell the same again and again; return all faults."""
    ends, faults = drive.now + seconds, []
    while drive.now < ends:
        faults += drive.tell(*events, after=1.0).faults
    return faults


def test_a_single_map_in_another_frame_changes_nothing(driven):
    """As it comes from a tf prefix, or from SLAM that was started with other parameters."""
    again = driven.restarted(ODOM)
    assert again.mission.state is State.WAITING_FOR_MAP
    assert again.mission.reason == (
        "no map in frame 'map' yet, in which progress is kept: the newest is in 'odom'"
    )
    decision = again.tell(MAP, HERE)
    assert decision.faults == ()
    assert again.visited == driven.visited
    assert again.mission.covered.current.frame == "map"


def test_updates_of_another_map_are_laid_over_that_one(driven):
    updates = [patch("#", at=(2, col), frame="odom") for col in (2, 3, 5)]
    driven.tell(ODOM)
    faults = driven.tell(*updates, patch("##", at=(2, 7), frame="odom")).faults
    assert sorted(fault.code for fault in faults) == ["patch_without_base", *["wrong_frame"] * 3]
    faults = told_for(driven, 2 * PATIENCE_S, THERE)
    expected = MAP.grid.patched(*(replace(one.patch, frame="map") for one in updates))
    assert driven.mission.grid.frame == "odom"
    assert (driven.mission.grid.cells == expected.cells).all()


@pytest.mark.parametrize("first", [(ODOM,), (ODOM, HERE), (HERE, ODOM)])
def test_map_and_pose_decide_not_who_came_first(first):
    drive = Drive((1, 1))
    drive.tell(*first)
    assert drive.request is None
    assert drive.tell(MAP, HERE).faults == ()
    assert drive.request is not None
    assert (drive.mission.grid.frame, drive.mission.pose.frame) == ("map", "map")
    assert isinstance(drive.tell(ODOM).faults[0], WrongFrame)


def test_a_replaced_map_is_used_if_the_poses_are_in_its_frame():
    drive = Drive((1, 1))
    drive.tell(MAP)
    drive.tell(ODOM)
    assert drive.mission.grid.frame == "odom", "as long as nobody knows"
    drive.tell(HERE)
    assert drive.mission.grid.frame == "map"
    assert drive.request is not None


def test_the_state_says_which_frame_is_where():
    drive = Drive((1, 1))
    drive.tell(ODOM, HERE)
    assert drive.mission.state is State.WAITING_FOR_POSE
    assert drive.mission.reason == "poses arrive in frame 'map', the map is in 'odom'"


def test_progress_is_set_aside_only_once_it_is_certain(driven):
    again = driven.restarted(ODOM, THERE)
    faults = told_for(again, PATIENCE_S - 1.5, ODOM, THERE)
    assert {type(fault) for fault in faults} == {WrongFrame}
    assert again.mission.snapshot().cells == driven.mission.snapshot().cells
    assert "is used once map and poses have arrived only in it for 10 s" in again.mission.reason
    mismatch = [
        fault
        for fault in told_for(again, 3.0, ODOM, THERE)
        if isinstance(fault, LedgerMismatchError)
    ]
    cells = driven.mission.snapshot().cells
    assert [str(fault) for fault in mismatch] == [
        f"the ledger of {cells} covered cells lies in frame 'map', the map in 'odom'"
    ]
    assert again.visited == {(1, 1)}
    assert again.mission.covered.current.frame == "odom"
    assert again.request is not None


def test_a_pose_in_the_frame_that_counts_keeps_it(driven):
    for _ in range(8):
        told_for(driven, PATIENCE_S - 2.0, ODOM, THERE)
        driven.tell(pose_at(*driven.cell))
    assert driven.mission.grid.frame == "map"
    driven.finish()


def test_a_pose_in_the_frame_of_the_progress_keeps_the_progress(driven):
    again = driven.restarted(ODOM)
    told_for(again, 2.0 * PATIENCE_S, THERE, HERE)
    assert again.mission.snapshot().cells == driven.mission.snapshot().cells


def test_single_poses_do_not_change_the_frame(driven):
    again = driven.restarted(ODOM)
    for _ in range(4):
        again.tell(THERE, after=PATIENCE_S + 1.0)
    assert again.mission.snapshot().cells == driven.mission.snapshot().cells


def test_a_mapper_restarted_in_another_frame_takes_over(driven):
    """And the robot does not drive on along a path that leads through another map."""
    walked = driven.walk
    assert walked
    told_for(driven, PATIENCE_S + 2.0, ODOM, THERE)
    assert any(not len(update.cells) for update in driven.updates)
    assert driven.mission.grid.frame == "odom"
    assert driven.mission.covered.current.frame == "odom"
    driven.cell = (1, 1)
    driven.plan()
    driven.finish()


@pytest.mark.parametrize("wedge", [(ODOM,), (ODOM, THERE), (ODOM, HERE), (MAP, THERE)])
def test_a_reset_gets_out_of_every_state(driven, wedge):
    again = driven.restarted(*wedge)
    again.command("reset")
    assert again.mission.snapshot().cells <= 1
    again.command("start")
    again.tell(MAP, HERE)
    assert again.tell(HERE).faults == ()
    assert (again.mission.grid.frame, again.mission.pose.frame) == ("map", "map")


@pytest.mark.parametrize("order", [1, -1])
def test_after_a_reset_the_next_map_and_pose_decide_in_any_order(driven, order):
    driven.command("reset")
    for event in (ODOM, THERE)[::order]:
        driven.tell(event)
    assert driven.mission.grid.frame == driven.mission.pose.frame == "odom"
    assert driven.mission.snapshot().frame == "odom"
    assert driven.visited == {(1, 1)}
    assert driven.command("start").plan is not None


def test_updates_go_to_the_map_of_their_frame(driven):
    again = driven.restarted(ODOM)
    (fault,) = again.tell(patch("#", at=(2, 2), frame="odom")).faults
    assert isinstance(fault, WrongFrame)
    told_for(again, PATIENCE_S + 2.0, THERE)
    assert again.mission.coverage().coverable == 23


def test_frames_without_end_are_not_all_held():
    drive = started(*HALL, cell=(1, 1))
    for number in range(50):
        name = f"f{number}"
        drive.tell(MapReceived(building(*HALL, frame=name)), pose_at(1, 1, frame=name))
    frames = drive.mission.map.frames
    assert len(frames._maps) == len(frames._poses) == 2
    drive.finish()


def test_an_order_for_all_survives_a_frame_with_nothing_covered():
    """Only what is bound to places in the frame before means nothing any more."""
    drive = Drive((1, 1), ODOM, pose_at(90, 90, frame="odom"))
    drive.command("reset")
    drive.command("start")
    faults = drive.tell(MAP, HERE).faults
    assert [fault for fault in faults if not isinstance(fault, WrongFrame)] == []
    assert drive.mission.covered.current.frame == "map"
    drive.tell(HERE, after=2.0)  # a robot that had to stop stands a moment
    assert drive.request is not None, drive.mission.reason


def test_an_order_of_zones_is_dropped_with_the_frame_they_lie_in():
    drive = Drive((1, 1), ODOM, pose_at(90, 90, frame="odom"))
    drive.command("reset")
    corners = [[0.3, 0.3], [1.0, 0.3], [1.0, 1.0], [0.3, 1.0]]
    drive.command("start", {"keep_out": [corners]})
    drive.tell(MAP, HERE)
    assert drive.mission.state is State.IDLE
    assert "no longer in 'odom': the order was dropped" in drive.mission.reason
