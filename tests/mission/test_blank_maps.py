"""A map without floor in mid-mission: it says nothing of the building, or of what is swept."""

import numpy as np
import pytest

from fasaco_edge.errors import LedgerMismatchError
from fasaco_edge.mission.events import MapReceived, State
from tests.mission.line_robot import LineRobot
from tests.mission.test_other_building import FLOOR, NEW, OLD, stand, swept
from tests.mission.test_reached_cells import START, two_rooms
from tests.mission.world import building

BLANK = {letter: MapReceived(building(*(letter * 14,) * 12)) for letter in "#?"}
WAITS = "waits for a map or a pose that puts it on free ground"
NOTHING = pytest.mark.parametrize("letter", BLANK, ids=["occupied", "unknown"])


@NOTHING
@pytest.mark.parametrize("seconds", [2.0, 20.0])
def test_order_and_ledger_survive_a_map_without_floor(letter, seconds):
    drive = swept(*FLOOR, ticks=60)
    drive.command("start", {"keep_covered": True})
    order, covered = drive.mission.order_state.order, drive.visited
    assert stand(drive, seconds, BLANK[letter]) == []
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.endswith(WAITS)
    assert drive.walk == []
    assert drive.mission.order_state.order == order
    assert stand(drive, 1.0, OLD) == []
    assert drive.mission.state in (State.PLANNING, State.COVERING)
    assert covered <= drive.visited
    drive.finish()
    assert drive.mission.coverage().remaining == 0


@NOTHING
def test_another_building_shown_after_a_map_without_floor_is_one(letter):
    drive = swept(*FLOOR)
    assert stand(drive, 8.0, BLANK[letter]) == []
    faults = stand(drive, 8.0, NEW)
    assert [type(fault) for fault in faults] == [LedgerMismatchError]


@NOTHING
def test_a_map_without_floor_decides_no_doubt(letter):
    drive = swept(*FLOOR, ticks=60)
    covered = drive.visited
    assert stand(drive, 2.0, NEW) == []
    assert stand(drive, 20.0, BLANK[letter]) == []
    assert stand(drive, 8.0, OLD) == []
    assert covered <= drive.visited
    drive.finish()


@NOTHING
def test_after_a_restart_a_map_without_floor_contradicts_nothing(letter):
    before = swept(*FLOOR, ticks=60)
    covered = before.visited
    drive = before.restarted()
    assert stand(drive, 8.0, BLANK[letter]) == []
    assert stand(drive, 8.0, OLD) == []
    assert covered <= drive.visited


def test_a_map_that_has_moved_meanwhile_moves_what_is_swept():
    drive = swept(*FLOOR, ticks=60)
    assert stand(drive, 8.0, BLANK["#"]) == []
    drive.cell = (1, 5)
    assert stand(drive, 10.0, MapReceived(building(*FLOOR, at=(0, 4)))) == []
    assert drive.mission.orders.goal() == (1, 5)
    assert len(drive.visited) >= 20
    assert all(col >= 4 for _, col in drive.visited)


def test_a_driving_robot_stands_and_loses_no_floor():
    robot = LineRobot(two_rooms(is_open=True), START)
    robot.wait(60.0, lambda _: False)
    swept_m2 = robot.mission.covered.floor.swept_m2
    for value in (100, -1):
        for _ in range(20):
            robot.show(np.full_like(two_rooms(is_open=True), value))
            robot.wait(1.0, lambda _: False)
        assert robot.mission.state == "blocked"
        assert robot.mission.reason.endswith(WAITS)
        assert not robot.path
        robot.show(two_rooms(is_open=True))
        assert robot.mission.covered.floor.swept_m2 >= swept_m2
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.reason.startswith("every reachable cell is covered")
