"""A map of another floor or building in the frame of the map before, in mid-mission."""

import pytest

from fasaco_edge.errors import LedgerMismatchError
from fasaco_edge.mission.events import MapReceived, State
from tests.mission.world import Drive, building, patch, pose_at, robot_in

HERE = (1, 1)
# A floor of two rooms; another one, whose lift is at the same place; a hall without its walls.
FLOOR = (
    "##############",
    *("#......#.....#",) * 4,
    "#............#",
    *("#......#.....#",) * 5,
    "##############",
)
OTHER = (
    "##############",
    "#............#",
    *("#.##########.#",) * 8,
    "#............#",
    "##############",
)
OPEN = ("." * 14,) * 12
# As the first, and askew enough to look another way from the other side.
CORNER = ("##############", *("#......#######",) * 5, *("#............#",) * 5, "##############")
OLD, NEW = MapReceived(building(*FLOOR)), MapReceived(building(*OTHER))


def swept(*rows, ticks=400):
    """A robot that has swept a floor, or a part of it, and is back at the lift."""
    drive = robot_in(*rows, cell=HERE)
    for _ in range(ticks):
        if drive.mission.state is State.DONE:
            break
        drive.plan() if drive.request is not None else drive.go()
    drive.cell = HERE
    stand(drive, 1.0)
    return drive


def stand(drive, seconds, *events):
    """Stand for a while, with the same maps once a second; return all faults."""
    faults = []
    for tick in range(round(10 * seconds)):
        again = events if tick % 10 == 0 else ()
        faults += drive.tell(*again, pose_at(*drive.cell)).faults
    return faults


@pytest.mark.parametrize("other", [OTHER, OPEN], ids=["walls elsewhere", "walls gone"])
def test_the_floor_at_the_other_end_of_a_lift_is_swept(other):
    drive = swept(*FLOOR)
    assert drive.mission.state is State.DONE
    cells = drive.mission.covered.current.snapshot().cells
    faults = stand(drive, 8.0, MapReceived(building(*other)))
    assert [str(fault) for fault in faults] == [
        f"the ledger of {cells} covered cells is of another building than the map"
    ]
    assert isinstance(faults[0], LedgerMismatchError)
    assert drive.visited == {HERE}
    drive.finish()
    assert drive.mission.coverage().remaining == 0
    assert len(drive.driven) > drive.mission.coverage().coverable


def test_the_robot_stands_while_the_building_is_in_doubt():
    drive = swept(*FLOOR, ticks=40)
    assert drive.walk
    stand(drive, 1.0, NEW)
    assert drive.walk == []
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.startswith("the map shows another building, or another floor")
    assert "5 s" in drive.mission.reason


def test_a_driving_robot_gets_no_path_from_the_building_before():
    """As when a person has another saved map published."""
    drive = swept(*FLOOR, ticks=40)
    faults = list(drive.tell(NEW).faults)
    for _ in range(80):
        drive.plan() if drive.request is not None else None
        row, col = drive.cell
        drive.cell = row, col + 0.02  # it rolls on
        faults += drive.tell(pose_at(*drive.cell)).faults
        if faults:
            break
    assert isinstance(faults[0], LedgerMismatchError)
    assert drive.walk == []


def test_a_map_turned_around_under_a_still_robot_is_another_one():
    drive = swept(*CORNER)
    faults = stand(drive, 8.0, MapReceived(building(*(row[::-1] for row in CORNER[::-1]))))
    assert [type(fault) for fault in faults] == [LedgerMismatchError]


def test_another_building_is_detected_in_a_partial_map():
    drive = swept(*FLOOR)
    faults = []
    for row in range(0, 12, 2):
        faults += stand(drive, 0.5, patch(*OTHER[::-1][row : row + 2][::-1], at=(row, 0)))
    faults += stand(drive, 8.0)
    assert [type(fault) for fault in faults] == [LedgerMismatchError]


def test_without_repeated_poses_the_building_is_decided():
    drive = swept(*FLOOR)
    drive.tell(NEW)
    faults = [fault for _ in range(80) for fault in drive.tell().faults]
    assert [type(fault) for fault in faults] == [LedgerMismatchError]


@pytest.mark.parametrize("order", ["map first", "at once", "pose first", "pose late"])
def test_a_loop_closure_keeps_what_moved_with_it(order):
    """Whichever of map and pose is the first to say so."""
    drive = swept(*FLOOR, ticks=60)
    moved, drive.cell = MapReceived(building(*FLOOR, at=(0, 4))), (1, 5)
    there = pose_at(*drive.cell)
    steps = {
        "map first": [(moved,), (there,)],
        "at once": [(moved, there)],
        "pose first": [(there,), (moved,), (there,)],
        "pose late": [(moved,), (pose_at(*HERE),), (pose_at(*HERE),), (there,)],
    }[order]
    faults = [fault for events in steps for fault in drive.tell(*events).faults]
    faults += stand(drive, 10.0, moved)
    assert faults == []
    assert drive.mission.orders.goal() == (1, 5), "it has moved with the building"
    # Those under the tool wherever the map may have lain in between.
    assert drive.mission.covered.current.snapshot().cells == 20
    assert all(col >= 4 for _, col in drive.visited)
    assert drive.mission.state is not State.BLOCKED


def test_moved_furniture_keeps_the_ledger():
    drive = swept(*FLOOR)
    covered = drive.mission.covered.current.snapshot().cells
    rows = [list(row) for row in FLOOR]
    for row, col in [(3, 3), (3, 4), (4, 3), (4, 4), (8, 9), (8, 10), (9, 9), (9, 10), (7, 3)]:
        rows[row][col] = "#"
    faults = stand(drive, 10.0, MapReceived(building(*map("".join, rows))))
    assert faults == []
    assert drive.mission.covered.current.snapshot().cells == covered
    assert drive.mission.state is State.DONE


def test_a_restarted_mapper_keeps_the_ledger_it_agrees_with():
    drive = swept(*FLOOR)
    covered = drive.mission.covered.current.snapshot().cells
    corner = [row[:4] for row in FLOOR[-4:]]
    assert stand(drive, 20.0, MapReceived(building(*corner))) == []
    assert drive.mission.covered.current.snapshot().cells == covered
    assert stand(drive, 8.0, OLD) == []
    assert drive.mission.covered.current.snapshot().cells == covered
    assert stand(drive, 20.0, MapReceived(building(*(row[:4] for row in OTHER[-4:])))) == []
    faults = stand(drive, 8.0, NEW)
    assert [type(fault) for fault in faults] == [LedgerMismatchError]


def test_a_mapper_flickering_between_two_floors_decides_nothing():
    drive = swept(*FLOOR, ticks=60)
    covered = drive.mission.covered.current.snapshot().cells
    paths, faults, states = len(drive.updates), [], set()
    for _ in range(30):
        for shown in (NEW, OLD):
            faults += stand(drive, 1.0, shown)
            states.add((str(drive.mission.state), drive.mission.reason))
    assert faults == []
    assert drive.mission.covered.current.snapshot().cells == covered
    assert {state for state, _ in states} == {"blocked"}
    assert len({reason for _, reason in states}) == 1
    assert len(drive.updates) - paths <= 1, "it is stopped once"
    # The floor before stays, and the robot goes on.
    stand(drive, 7.0, OLD)
    drive.finish()


def test_each_change_of_floors_takes_longer_to_be_believed():
    drive = swept(*FLOOR)
    changes = []
    for number in range(60):
        shown = (NEW, OLD)[number // 6 % 2]
        changes += stand(drive, 1.0, shown)
    assert len(changes) <= 2


def test_orders_tied_to_the_previous_floor_end_with_it():
    drive = swept(*FLOOR, ticks=20)
    drive.command("start", {"zones": [{"name": "a", "polygon": [[0.5, 0.5], [1, 0.5], [1, 1]]}]})
    stand(drive, 8.0, NEW)
    assert drive.mission.state is State.IDLE
    assert drive.mission.reason.endswith("than the map: the order was dropped")
    assert drive.mission.orders.goal() is None


def test_the_previous_floors_home_is_forgotten_without_an_order():
    drive = swept(*FLOOR, ticks=20)
    drive.command("start", {})
    stand(drive, 1.0)
    drive.command("cancel")
    assert drive.mission.orders.goal() is not None
    stand(drive, 8.0, NEW)
    assert drive.mission.orders.goal() is None
    drive.command("home")
    assert drive.refused.code == "not_now"


def test_a_paused_robot_stays_paused_on_the_other_floor():
    drive = swept(*FLOOR, ticks=20)
    drive.command("pause")
    faults = stand(drive, 8.0, NEW)
    assert [type(fault) for fault in faults] == [LedgerMismatchError]
    assert drive.mission.state is State.PAUSED


@pytest.mark.parametrize("other", [OTHER, OPEN], ids=["walls elsewhere", "walls gone"])
def test_a_reload_keeps_the_doubt_about_the_building(other):
    """As after a reload of the configuration, while the robot stands between the floors."""
    first = swept(*FLOOR)
    shown = MapReceived(building(*other))
    stand(first, 3.0, shown)
    again = Drive(HERE)
    again.mission.restore(first.mission.snapshot(), first.mission.order_state)
    again.mission.continue_from(first.mission)
    again.now = first.now
    faults = stand(again, 4.0, shown)
    assert [type(fault) for fault in faults] == [LedgerMismatchError]
    again.finish()
