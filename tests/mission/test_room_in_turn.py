"""``by_room: always``: a room is finished before the robot goes to another."""

from itertools import groupby

import numpy as np
import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.mission.events import MemberReceived
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.mission.work.present_part import MAX_IN_VAIN
from tests.mission.test_room_orders import (
    BOTH,
    EAST_COLUMNS,
    IN_EAST,
    IN_WEST,
    WEST_COLUMNS,
    name,
    room_at,
    settled,
    visited,
)
from tests.mission.test_worth import TIGHT_MIN, tick
from tests.mission.test_worth import finish as finish_slowly
from tests.mission.world import CONFIG, pose_at, rectangle, robot_in, with_policy

ALWAYS = with_policy(CONFIG, by_room="always")


def rooms_swept(drive):
    """The rooms in which the robot drove over new cells, one after the other."""
    new = [cell for at, cell in enumerate(drive.driven) if cell not in drive.driven[:at]]
    sides = ("west" if cell[1] in WEST_COLUMNS else "east" for cell in new if abs(cell[1] - 10) > 1)
    return [side for side, _ in groupby(sides)]


def planned(drive):
    """How many cells of each room the plan asked for is to cover."""
    problem = drive.request.problem
    columns = np.flatnonzero(problem.to_cover) % problem.to_cover.shape[1]
    return tuple(int(np.isin(columns, side).sum()) for side in (WEST_COLUMNS, EAST_COLUMNS))


@pytest.mark.parametrize(
    ("order", "sides"),
    [
        ({}, ["west", "east"]),
        ({"zones": [{"name": "all", "polygon": rectangle(0, 0, 10, 21)}]}, ["west", "east"]),
        ({"zones": [{"name": "bath"}, {"name": "den"}]}, ["east", "west"]),
    ],
)
def test_a_room_is_finished_before_the_next_is_begun(order, sides):
    drive = settled(*BOTH, config=ALWAYS)
    name(drive, room_at(drive, *IN_EAST).id, "bath")
    name(drive, room_at(drive, *IN_WEST).id, "den")
    drive.command("start", order)
    drive.plan()
    assert bool(drive.mission.orders.scope.is_part) == ("bath" not in str(order))
    drive.finish()
    # On the way to the first room of an order the robot drives over floor of another.
    assert rooms_swept(drive)[-2:] == sides
    assert {(row, col) for row in range(10) for col in (*WEST_COLUMNS, *EAST_COLUMNS)} <= set(
        drive.driven
    )


def test_once_rooms_are_known_the_robot_finishes_its_own():
    drive = robot_in(*BOTH, cell=IN_WEST, config=ALWAYS)
    assert planned(drive) == (89, 90)
    drive.plan()
    while drive.request is None:
        drive.tell(pose_at(*drive.cell), after=1.0)
    assert drive.request.reason == "rooms have changed: another room first"
    assert planned(drive) == (89, 0)
    drive.finish()
    assert rooms_swept(drive) == ["west", "east"]


def test_a_path_ends_at_home_only_in_the_last_room():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("start", {"return_home": True})
    assert drive.request.problem.end is None
    drive.plan()
    while drive.request is None:
        drive.go()
    assert drive.request.reason == "floor planned first is done: the rest"
    assert planned(drive) == (0, 90)
    assert drive.request.problem.end == IN_WEST
    drive.finish()


def test_floor_tried_in_vain_is_left_until_other_rooms_are_finished():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("start")
    drive.plan()
    for _ in range(MAX_IN_VAIN + 1):
        assert not drive.mission.orders.part.record_path_end("")
    drive.command("replan")
    west, east = planned(drive)
    assert (west, east) == (0, 90)
    drive.finish()
    assert rooms_swept(drive)[-1] == "west"
    assert len(visited(drive, WEST_COLUMNS)) == 90
    # Where nothing can be done, a path more is tried than without rooms, and the order ends.
    drive.command("start")
    drive.plan()
    orders = drive.mission.orders
    ends = [orders.part.record_path_end("") for _ in range(3 * (MAX_IN_VAIN + 1))]
    assert ends.index(True) == MAX_IN_VAIN + 1


@pytest.mark.parametrize("change", ["split", "merge", "rename"])
def test_the_order_is_done_while_people_change_the_rooms(change):
    drive = settled(*BOTH, config=ALWAYS)
    west, east = room_at(drive, *IN_WEST).id, room_at(drive, *IN_EAST).id
    drive.command("start")
    drive.plan()
    drive.go(times=30)
    request = {
        "split": RoomRequest(west, cut=((0.0, 1.25), (2.5, 1.25))),
        "merge": RoomRequest(west, others=(east,)),
        "rename": RoomRequest(west, name="den"),
    }[change]
    drive.command(f"room_{change.replace('rename', 'name')}", room=request)
    assert drive.refused is None
    drive.finish()
    assert len(visited(drive, WEST_COLUMNS)) + len(visited(drive, EAST_COLUMNS)) == 180
    if change != "merge":
        assert rooms_swept(drive) == ["west", "east"]


def test_if_the_robot_turns_out_to_be_in_a_new_room_it_finishes_that_first():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("start")
    drive.plan()
    cut = ((0.0, 1.0), (2.5, 1.0))
    drive.command("room_split", room=RoomRequest(room_at(drive, *IN_WEST).id, cut=cut))
    drive.tell(pose_at(*drive.cell))
    assert drive.request.reason == "rooms have changed: another room first"
    assert planned(drive) == (4 * len(WEST_COLUMNS) - 1, 0), "the smaller part, with a new number"
    drive.finish()


def test_another_order_begins_in_the_robots_own_room():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("start")
    drive.plan()
    drive.go(times=5)
    drive.command("cancel")
    drive.cell = IN_EAST
    drive.tell(pose_at(*IN_EAST))
    drive.command("start")
    assert planned(drive) == (0, 89)


def test_a_robot_too_slow_for_all_rooms_leaves_its_own_for_one_of_higher_priority():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("room_set", room=RoomRequest(room_at(drive, *IN_EAST).id, priority=80))
    drive.command("start", {"until_min": 5.0})
    for _ in range(20):
        tick(drive)
    assert drive.mission.orders.scope.worth.least == 0
    for _ in range(40):
        tick(drive)
        drive.tell(after=3.0)
    assert drive.mission.orders.scope.worth.least == 80
    assert finish_slowly(drive)[1] > 60


def test_priority_comes_before_the_room_that_the_robot_is_in():
    drive = settled(*BOTH, config=ALWAYS)
    drive.command("room_set", room=RoomRequest(room_at(drive, *IN_EAST).id, priority=80))
    drive.command("start", {"until_min": TIGHT_MIN})
    assert finish_slowly(drive)[1] == 90


def test_robots_of_a_fleet_share_rooms_as_with_auto():
    drive = settled(*BOTH, config=ALWAYS, kind=FleetKind("r1"))
    drive.command("start")
    assert planned(drive) == (89, 0)
    drive.plan()
    drive.tell(MemberReceived("r2", frame="map", epoch=1, state="idle"))
    drive.command("replan")
    assert planned(drive)[1] == 90
