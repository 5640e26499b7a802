"""Keep-outs that are added and removed while a mission runs: the order goes on."""

import pytest

from fasaco_edge.errors import OrderError
from fasaco_edge.mission.events import MapReceived, State
from fasaco_edge.mission.orders.keep_outs import MOST_KEEP_OUT, KeepOut
from tests.mission.world import CELL, Drive, building, cells, idle, pose_at, rectangle, started

ROOM = ("........",) * 6
ALL = cells(0, 0, 6, 8)


def keep_out(name, *bounds):
    return KeepOut(name, tuple(map(tuple, rectangle(*bounds))))


VASE = keep_out("vase", 1, 3, 4, 5)


def add(drive, new):
    return drive.command("keep_out_add", keep_out=new)


def remove(drive, name):
    return drive.command("keep_out_remove", keep_out=KeepOut(name))


def test_a_keep_out_during_a_mission_keeps_coverage_and_order():
    drive = started(*ROOM)
    drive.go(times=12)
    before, covered = drive.mission.order_state, drive.visited
    decision = add(drive, keep_out("vase", *_ahead(drive)))
    assert drive.visited == covered
    assert drive.mission.order_state.order is before.order
    assert decision.path is not None, "the path led there"
    assert decision.plan.reason.startswith("path blocked at cell")
    drive.finish()
    assert covered < drive.visited
    assert len(drive.visited) == 47


def _ahead(drive):
    row, col = drive.walk[3]
    return row, col, row + 1, col + 1


def test_no_path_leads_into_it_from_that_step_on():
    drive = started("..........")
    drive.go()
    assert add(drive, keep_out("door", 0, 6, 1, 7)).path.cells.tolist()[-1] == [0, 5]
    drive.finish()
    assert drive.driven[-1] == (0, 5)


def test_a_robot_inside_a_keep_out_stops_until_its_removal():
    drive = started(*ROOM)
    drive.go(times=12)
    covered = drive.visited
    decision = add(drive, keep_out("here", 0, 0, 6, 8))
    assert decision.path.cells.shape == (0, 2)
    assert (drive.mission.state, drive.walk) == (State.BLOCKED, [])
    assert "robot is in a keep-out zone" in drive.mission.reason
    remove(drive, "here")
    drive.tell(after=3.0)
    drive.finish()
    assert covered < drive.visited == ALL


def test_a_robot_at_a_keep_out_border_stops_and_is_led_out():
    drive = started(*ROOM)
    drive.go(times=3)
    row, col = drive.cell
    decision = add(drive, keep_out("here", row, col, row + 1, col + 1))
    assert decision.path.cells.shape == (0, 2)
    drive.plan()
    drive.cell = drive.walk.pop(0)
    assert drive.cell in ((row, col - 1), (row, col + 1), (row + 1, col), (row - 1, col))
    drive.tell(pose_at(*drive.cell))
    drive.finish()
    assert (row, col) not in drive.driven[4:]


def test_it_holds_under_every_order_until_it_is_removed():
    drive = idle(*ROOM)
    add(drive, VASE)
    assert drive.mission.state is State.IDLE
    for order in ({"keep_out": [rectangle(0, 7, 1, 8)]}, {}):
        drive.command("start", order)
        drive.driven.clear()
        drive.finish()
        assert not set(drive.driven) & cells(1, 3, 4, 5)
    drive.command("cancel")
    drive.command("reset")
    assert drive.mission.order_state.keep_out == (VASE,)
    drive.command("start")
    remove(drive, "vase")
    drive.finish()
    assert drive.visited == ALL


def test_it_outlives_the_daemon():
    drive = started(*ROOM)
    add(drive, VASE)
    again = drive.restarted(MapReceived(building(*ROOM)), pose_at(*drive.cell))
    again.finish()
    assert again.visited == ALL - cells(1, 3, 4, 5)


def test_without_one_the_note_is_as_older_daemons_read_it():
    drive = started(*ROOM)
    before = drive.mission.snapshot().note
    add(drive, VASE)
    assert drive.mission.snapshot().note != before
    remove(drive, "vase")
    assert drive.mission.snapshot().note == before


def test_paused_and_sent_home_it_stays_so():
    drive = started(*ROOM)
    drive.go(times=12)
    drive.command("pause")
    add(drive, VASE)
    assert (drive.mission.state, drive.walk) == (State.PAUSED, [])
    drive.command("home")
    add(drive, keep_out("way", *_ahead(drive)))
    drive.go(times=60)
    assert (drive.cell, drive.mission.reason) == ((0, 0), "at home, paused by command")


def test_added_twice_it_is_added_once():
    drive = started(*ROOM)
    add(drive, VASE)
    revision = drive.mission.route.revision
    assert add(drive, VASE).path is None
    assert drive.refused is None
    assert drive.mission.order_state.keep_out == (VASE,)
    assert drive.mission.route.revision == revision


def test_an_invalid_keep_out_is_refused_and_changes_nothing():
    drive = started(*ROOM)
    add(drive, VASE)
    for give, said in (
        (lambda: add(drive, keep_out("vase", 0, 0, 1, 1)), "a keep-out 'vase' already, with other"),
        (lambda: remove(drive, "vase "), "no keep-out 'vase ' was added; there are 'vase'"),
    ):
        before = drive.mission.order_state
        assert give().path is None
        assert isinstance(drive.refused, OrderError)
        assert said in str(drive.refused)
        assert drive.mission.order_state == before


@pytest.mark.parametrize(
    ("count", "corners", "said"),
    [(MOST_KEEP_OUT, 4, "there are 100 keep-outs already"), (5, 1000, "at most 5000 corners")],
)
def test_they_are_bounded(count, corners, said):
    polygon = tuple((CELL * index, 0.0) for index in range(corners))
    drive = Drive((0, 0))
    for number in range(count):
        add(drive, KeepOut(str(number), polygon))
        assert drive.refused is None
    add(drive, KeepOut("more", polygon))
    assert said in str(drive.refused)
