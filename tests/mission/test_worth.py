"""Floor by its priority: what comes first where time or battery do not allow all."""

import tracemalloc

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import room_progress, zone_progress
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import CommandReceived, MapReceived, PriorityReceived, State
from fasaco_edge.mission.map.placing import are_same
from fasaco_edge.mission.orders.order import EVERYTHING, Zone, order_document, read_order
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.mission.work.present_part import MAX_IN_VAIN
from fasaco_edge.mission.work.worth import WorthFirst, least_priority
from tests.mission.battery import Battery
from tests.mission.test_room_orders import (
    BOTH,
    EAST_COLUMNS,
    IN_EAST,
    IN_WEST,
    WAITS,
    WEST_COLUMNS,
    name,
    room_at,
    settle,
    settled,
    visited,
)
from tests.mission.world import CELL, Drive, building, pose_at, rectangle

# Both rooms have 90 cells, a second each; the passage between them 8.
TIGHT_MIN = 2.5


def tick(drive):
    drive.tick()
    drive.tell(after=0.9)


def finish(drive):
    """Drive a cell a second until the mission is done; return how many cells of each room."""
    for _ in range(400):
        if drive.mission.state is State.DONE:
            return len(visited(drive, WEST_COLUMNS)), len(visited(drive, EAST_COLUMNS))
        tick(drive)
    raise AssertionError(drive.mission.reason)


def ranked(priority, **settings):
    """A robot in the west of two rooms, the eastern one with a priority."""
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "bath")
    if priority is not None:
        drive.command("room_set", room=RoomRequest("bath", priority=priority))
    drive.command("start", settings)
    assert drive.refused is None
    return drive


def test_if_time_is_short_the_room_of_higher_priority_is_first():
    assert finish(ranked(None, until_min=TIGHT_MIN))[1] < 60
    drive = ranked(80, until_min=TIGHT_MIN)
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 80
    west, east = finish(drive)
    assert east == 90
    assert west < 60
    assert drive.mission.orders.scope.worth.least == 0
    # A room of lower priority comes last.
    assert finish(ranked(20, until_min=TIGHT_MIN))[1] < 60


@pytest.mark.parametrize("settings", [{}, {"until_min": 60.0}, {"until_min": 0.0}])
def test_with_enough_time_priorities_change_no_path(settings):
    driven = []
    for priority in None, 80:
        drive = ranked(priority, **settings)
        assert min(finish(drive)) == 90
        driven.append(drive.driven)
        assert "the most worthwhile" not in " ".join(each.reason for each in drive.updates)
    assert driven[0] == driven[1]


def test_a_robot_that_turns_out_too_slow_turns_to_what_matters():
    drive = ranked(80, until_min=5.0)
    for _ in range(20):
        tick(drive)
        assert drive.mission.orders.scope.worth.least == 0
    for _ in range(30):
        tick(drive)
        drive.tell(after=3.0)
    assert drive.mission.orders.scope.worth.least == 80
    tick(drive)
    reasons = [each.reason for each in drive.updates]
    assert "not all can be done in time: the most worthwhile floor first" in reasons
    assert finish(drive)[1] == 90
    assert "floor planned first is done: the rest" in [each.reason for each in drive.updates]


def test_after_the_time_limit_no_floor_comes_first():
    drive = ranked(80, until_min=0.5)
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 80
    drive.command("pause")
    drive.tell(after=40.0)
    assert drive.mission.orders.scope.worth.least == 0


def test_the_rest_follows_where_time_is_left_after_all():
    drive = ranked(80, until_min=TIGHT_MIN)
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 80
    drive.command("room_set", room=RoomRequest("bath", priority=50))
    drive.command("start", {"until_min": 60.0})
    assert min(finish(drive)) == 90


def test_the_battery_is_a_limit_too():
    shares = []
    for priority in None, 80:
        drive = Battery(0.9, cell=IN_WEST, rows=BOTH, order_state=WAITS, dock=None, drain=0.005)
        settle(drive)
        drive.level = 0.9
        number = room_at(drive, *IN_EAST).id
        if priority:
            drive.command("room_set", room=RoomRequest(number, priority=priority))
        drive.command("start")
        for _ in range(130):
            tick(drive)
        shares.append(room_progress(drive.mission)[number].share)
    assert shares[0] < 0.6
    assert shares[1] == 1.0


def test_unreachable_floor_of_high_priority_is_given_up():
    drive = ranked(80, until_min=TIGHT_MIN)
    drive.plan()
    orders = drive.mission.orders
    for _ in range(MAX_IN_VAIN):
        assert not orders.part.record_path_end("")
        assert drive.mission.orders.scope.worth.least == 80
    assert not orders.part.record_path_end("")
    assert drive.mission.orders.scope.worth.least == 0
    problem = drive.command("replan").plan.problem
    assert np.count_nonzero(problem.to_cover) > 150, "the other room, too"


def dirt(value, frame="map", columns=EAST_COLUMNS):
    """A dirt map of cells as wide as the lattice's: a value in some columns, else none."""
    cells = np.full((10, 21), -1, np.int8)
    cells[:, list(columns)] = value
    return PriorityReceived(OccupancyGrid(GridGeometry(10, 21, 0.25, Pose2D(0, 0)), cells, frame))


def test_a_map_of_dirt_says_what_comes_first():
    drive = settled(*BOTH)
    drive.tell(dirt(90))
    drive.command("start", {"until_min": TIGHT_MIN})
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 90
    west, east = finish(drive)
    assert east == 90
    assert west < 60
    # It also holds in a mission that succeeds this one, and within zones.
    after = Mission(drive.config)
    after.restore(order=WAITS)
    after.step(drive.mission.newest_inputs(), 0.0)
    order = {"zones": [{"name": "all", "polygon": rectangle(0, 0, 10, 21)}], "until_min": 2.5}
    decision = after.step([CommandReceived(1, "start", read_order(order), discard=True)], 1.0)
    assert after.orders.scope.worth.least == 90
    assert np.count_nonzero(decision.plan.problem.to_cover) == 90


def test_a_new_map_of_dirt_counts_only_if_time_is_short():
    drive = ranked(80, until_min=TIGHT_MIN)
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 80
    for _ in range(5):
        tick(drive)
    drive.tell(dirt(95, columns=WEST_COLUMNS))
    assert (drive.request.reason, drive.mission.orders.scope.worth.least) == (
        "priorities have changed",
        95,
    )
    drive.plan()
    drive.tell(dirt(95, columns=WEST_COLUMNS))
    assert drive.request is None, "the same again"
    assert finish(drive)[0] == 90
    drive = ranked(None, until_min=60.0)
    drive.plan()
    drive.tell(dirt(95))
    assert (drive.request, drive.mission.orders.scope.worth.least) == (None, 0)


def test_a_map_of_dirt_in_another_frame_is_refused():
    drive = settled(*BOTH)
    early = Drive((0, 0), dirt(90, frame="odom"))
    first_map = MapReceived(building(*BOTH)), pose_at(0, 0)
    for decision in drive.tell(dirt(90, frame="odom")), early.tell(*first_map):
        (fault,) = decision.faults
        said = "priorities in frame 'odom', map in 'map'"
        assert (fault.code, str(fault)) == ("wrong_frame", said)
    assert not early.tell(*first_map).faults
    drive.command("start", {"until_min": TIGHT_MIN})
    drive.plan()
    assert drive.mission.orders.scope.worth.least == 0


def test_one_slow_path_does_not_count_in_later_passes():
    window, everything = Window(0, 0, 10, 21), np.ones((10, 21), bool)
    worth = WorthFirst(CELL, 1.0, lambda: Zone(EVERYTHING, None), lambda: "map")
    worth.receive(dirt(90).grid)
    worth.allow(300.0)
    assert worth.puts_other_first(everything, window, 2000.0)
    worth.begin_pass()
    worth.choose(everything, window)
    assert worth.least == 0
    assert not worth.are_too_many(everything.size)


def test_a_map_of_dirt_takes_a_few_bytes_per_cell():
    window = Window(-400, -700, 1600, 1300)
    worth = WorthFirst(CELL, 1.0, lambda: Zone(EVERYTHING, None), lambda: "map")
    worth.receive(dirt(90).grid)
    worth.allow(100.0)
    everything = np.ones((window.rows, window.cols), bool)
    tracemalloc.start()
    worth.choose(everything, window)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * everything.size
    # Each cell has the value of the pixel at its centre.
    assert worth.least == 90
    first = np.argwhere(worth.first(everything, window))
    first += np.array([window.row0, window.col0])
    assert first.tolist() == [[row, col] for row in range(10) for col in EAST_COLUMNS]


WEST, EAST = rectangle(0, 0, 10, 10), rectangle(0, 11, 10, 21)


def zones(west=None, east=None):
    given = (("west", WEST, west), ("east", EAST, east))
    return [
        {"name": name, "polygon": polygon} | ({} if priority is None else {"priority": priority})
        for name, polygon, priority in given
    ]


@pytest.mark.parametrize(
    ("priorities", "until_min", "first"),
    [
        ({"east": 51}, 1.5, "east"),
        ({"west": 49}, 1.5, "east"),
        ({"west": 51}, 1.5, "west"),
        ({}, 1.5, "west"),
        ({"east": 51}, 60.0, "west"),
        ({"east": 51}, 0.0, "west"),
    ],
)
def test_if_time_is_short_zones_of_higher_priority_are_first(priorities, until_min, first):
    drive = settled(*BOTH)
    order = {"zones": zones(**priorities), "until_min": until_min}
    drive.command("start", order)
    assert drive.mission.order_state.order.zones[0].name == first
    assert zone_progress(drive.mission)[0].name == first
    # The same order goes on, and so does one that is kept over a restart.
    assert are_same(drive.mission.order_state.order, read_order(order))
    kept = OrderState.from_json(drive.mission.order_state.to_json())
    assert kept.order.zones == drive.mission.order_state.order.zones


@pytest.mark.parametrize(
    ("settings", "enough_min"), [({"passes": ["edge", "rest"]}, 3.5), ({"keep_covered": True}, 2.0)]
)
def test_zones_are_counted_by_what_their_passes_cover(settings, enough_min):
    drive = settled(*BOTH)
    if "keep_covered" in settings:
        drive.command("start", {"zones": zones()[:1]})
        finish(drive)
    for until_min, first in (enough_min, "west"), (1.4, "east"):
        order = {"zones": zones(east=60), "until_min": until_min, **settings}
        drive.command("start", order)
        assert drive.mission.order_state.order.zones[0].name == first
        drive.command("cancel")


def test_a_room_gives_its_priority_to_the_zone_of_its_name():
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "bath")
    name(drive, room_at(drive, *IN_WEST).id, "hall")
    drive.command("room_set", room=RoomRequest("bath", priority=70))
    named = [{"name": "hall"}, {"name": "bath"}]
    drive.command("start", {"zones": named, "until_min": 1.5})
    first, second = drive.mission.order_state.order.zones
    assert (first.name, first.worth, second.worth) == ("bath", 70, 50)
    # A room's other priority makes the same order no other one.
    order = drive.mission.order_state.order
    for priority in 80, 50, 20:
        drive.command("room_set", room=RoomRequest("bath", priority=priority))
        drive.command("start", {"zones": named, "until_min": 1.5})
        assert drive.mission.order_state.order == order
    drive.command("cancel")
    named[1]["priority"] = 10
    drive.command("start", {"zones": named, "until_min": 1.5})
    assert [zone.worth for zone in drive.mission.order_state.order.zones] == [50, 10]
    document = order_document(drive.mission.order_state.order)
    assert document["zones"][1]["priority"] == 10


@pytest.mark.parametrize(
    ("cells", "may_work_s", "least"),
    [
        ({50: 10}, 1.0, 0),
        ({50: 10, 60: 10}, 20.0, 0),
        ({50: 10, 60: 10}, 19.0, 60),
        # Some that fit together are one plan; what does not fit is still first.
        ({50: 10, 60: 5, 70: 5}, 15.0, 60),
        ({50: 10, 60: 5, 70: 5}, 10.0, 70),
        ({50: 10, 60: 5, 70: 5}, 1.0, 70),
        ({0: 5, 100: 5}, 0.0, 100),
    ],
)
def test_the_least_priority_that_fits_is_found(cells, may_work_s, least):
    counts = np.zeros(101, np.int64)
    counts[list(cells)] = list(cells.values())
    assert least_priority(counts, 1.0, may_work_s) == least
