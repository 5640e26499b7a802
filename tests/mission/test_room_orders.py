"""Orders by room name: rooms found on the map, named, set, and swept by name."""

import json
import math
from dataclasses import replace

import pytest

from fasaco_edge.daemon.loop.mission_reports import room_progress, zone_progress
from fasaco_edge.errors import OrderError
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.polygons import is_near
from fasaco_edge.grid.rooms import find_rooms
from fasaco_edge.grid.rotation import rotated_geometry, rotated_pose
from fasaco_edge.mission.events import MapReceived, PoseReceived, State
from fasaco_edge.mission.map.frame_selector import PATIENCE_S
from fasaco_edge.mission.map.placing import are_same
from fasaco_edge.mission.orders.commands import command_document, read_command
from fasaco_edge.mission.orders.order import Command, ConfiguredZone, order_document, read_order
from fasaco_edge.mission.orders.passes import PassDocument
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.rooms import room_watch
from fasaco_edge.mission.rooms.room_watch import PERIOD_S
from fasaco_edge.mission.work import sequencer
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.planners.passes import Pass
from tests.mission.world import CONFIG, Drive, building, pose_at, rectangle, robot_in, with_policy

BOTH = (
    *(["..........#.........."] * 4),
    *(["....................."] * 2),
    *(["..........#.........."] * 4),
)
ONLY_WEST = tuple(row[:11] + "?" * 10 for row in BOTH)
IN_WEST, IN_EAST = (2, 2), (2, 18)
WAITS = OrderState.idle("waits")
# As many as any change of rooms takes.
LOOKS = 10


def settled(*rows, **members):
    """A robot whose map has shown its rooms for long enough."""
    return settle(robot_in(*rows, cell=IN_WEST, **{"order_state": WAITS} | members))


def settle(drive, frame="map"):
    for _ in range(LOOKS):
        drive.tell(pose_at(*drive.cell, frame), after=1.01 * PERIOD_S)
        assert not drive.mission.rooms.sheet or len(drive.mission.rooms.rooms) < 5
    return drive


def room_at(drive, row, col):
    """The room around a cell."""
    place = (col + 0.5) * 0.25, (row + 0.5) * 0.25
    (found,) = (room for room in drive.mission.rooms.rooms if is_near(room.outline, place, 1e-9))
    return found


def name(drive, called, to):
    drive.command("room_name", room=RoomRequest(called, name=to))
    assert drive.refused is None


def start(drive, *names, **members):
    drive.command("start", {"zones": [{"name": each} for each in names], **members})


def visited(drive, columns):
    return {cell for cell in drive.visited if cell[1] in columns}


WEST_COLUMNS, EAST_COLUMNS = range(9), range(12, 21)


def test_a_room_is_ordered_by_its_name_and_by_its_number():
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "kitchen")
    start(drive, "kitchen")
    drive.finish()
    east = {(row, col) for row in range(10) for col in EAST_COLUMNS}
    assert east <= drive.visited
    assert len(visited(drive, WEST_COLUMNS)) < 30
    (zone,) = zone_progress(drive.mission)
    assert (zone.name, zone.covered) == ("kitchen", zone.cells)
    progress = room_progress(drive.mission)
    east_room = progress[room_at(drive, *IN_EAST).id]
    assert (east_room.cells, east_room.covered, east_room.share) == (zone.cells, zone.covered, 1.0)
    assert progress[room_at(drive, *IN_WEST).id].covered < 30
    start(drive, f"room {room_at(drive, *IN_WEST).id}")
    assert drive.refused is None
    drive.finish()
    assert len(visited(drive, WEST_COLUMNS)) == 90


def test_an_unknown_room_is_refused_with_the_known_ones():
    zone = ConfiguredZone(name="rug", polygon=[tuple(at) for at in rectangle(0, 0, 4, 4)])
    drive = settled(*BOTH, config=with_policy(CONFIG, zones=(zone,)))
    name(drive, room_at(drive, *IN_EAST).id, "kitchen")
    start(drive, "rug", "attic")
    assert drive.refused.code == "bad_order"
    assert "zones[1].name: no zone 'attic'" in str(drive.refused)
    assert "there are rug; nor a room: there are " in str(drive.refused)
    assert "'kitchen'" in str(drive.refused)
    assert drive.mission.state is State.IDLE
    # A configured zone comes before a room of its name.
    name(drive, room_at(drive, *IN_WEST).id, "rug")
    start(drive, "rug")
    assert drive.mission.order_state.order.zones[0].polygon == tuple(map(tuple, zone.polygon))


def test_a_zone_follows_its_room_as_the_map_grows():
    half = tuple(row[:6] + "?" * 15 for row in BOTH)
    drive = settled(*half)
    name(drive, 1, "hall")
    start(drive, "hall")
    before = drive.mission.order_state.order.zones[0]
    drive.plan()
    assert drive.mission.state is State.COVERING
    drive.tell(MapReceived(building(*ONLY_WEST)))
    settle(drive)
    after = drive.mission.order_state.order.zones[0]
    assert after.room == before.room == 1
    assert after.polygon != before.polygon
    assert drive.mission.order_state.begun
    drive.finish()
    assert len(visited(drive, WEST_COLUMNS)) == 90


def test_an_equal_order_continues_after_its_room_has_grown():
    drive = settled(*tuple(row[:6] + "?" * 15 for row in BOTH))
    name(drive, 1, "hall")
    start(drive, "hall")
    drive.plan()
    drive.go(times=5)
    covered = len(drive.visited)
    drive.tell(MapReceived(building(*ONLY_WEST)))
    settle(drive)
    drive.command("start", {"zones": [{"name": "hall"}]}, discard=False)
    assert drive.refused is None
    assert len(drive.visited) >= covered > 3


def test_a_known_room_is_ordered_before_the_map_has_grown_to_it():
    """As after a restart, with a mapper that begins anew; it was refused as off the map."""
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "kitchen")
    drive.tell(MapReceived(building(*(row[:9] for row in BOTH))))
    settle(drive)
    start(drive, "kitchen")
    assert drive.refused is None
    drive.tell(MapReceived(building(*BOTH)))
    settle(drive)
    drive.finish()
    assert len(visited(drive, EAST_COLUMNS)) == 90


def test_an_order_waits_for_a_room_after_its_other_zones():
    drive = settled(*ONLY_WEST)
    name(drive, 1, "hall")
    start(drive, "kitchen", "hall", unknown="wait")
    assert drive.refused is None
    assert [zone.name for zone in drive.mission.order_state.order.zones] == ["hall", "kitchen"]
    drive.run(State.BLOCKED)
    assert "waits for a room 'kitchen'" in drive.mission.reason
    assert len(visited(drive, WEST_COLUMNS)) == 90
    # A restart waits on.
    note = drive.mission.order_state.to_json()
    assert OrderState.from_json(note).waits_for == "kitchen"
    drive.tell(MapReceived(building(*BOTH)))
    settle(drive)
    assert drive.mission.state is State.BLOCKED
    name(drive, room_at(drive, *IN_EAST).id, "kitchen")
    drive.finish()
    assert len(visited(drive, EAST_COLUMNS)) == 90


def test_settings_of_a_room_apply_to_orders_without_them():
    drive = settled(*BOTH)
    number = room_at(drive, *IN_EAST).id
    drive.command("room_set", room=RoomRequest(number, passes=["auto", "cross"]))
    start(drive, f"room {number}")
    assert drive.mission.order_state.order.zones[0].kinds == (Pass(), Pass(lanes="cross"))
    start(drive, f"room {number}", passes=1)
    assert drive.mission.order_state.order.zones[0].passes == 1
    # What is not given stays as it was.
    drive.command("room_set", room=RoomRequest(number, skip=True))
    assert drive.mission.rooms.room(number).settings.passes == 2


def test_an_order_for_everything_reports_the_skipped_room(monkeypatch):
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "bath")
    drive.command("room_set", room=RoomRequest("bath", skip=True))
    drive.command("start")
    drive.finish()
    assert not visited(drive, range(13, 21))
    assert len(visited(drive, WEST_COLUMNS)) == 90
    assert drive.mission.reason.endswith("; left out: 'bath'")
    # Of many rooms it names as many as can be read.
    monkeypatch.setattr(sequencer, "MOST_LISTED", 3)
    drive.command("start")
    drive.finish()
    assert drive.mission.reason.endswith("; left out: 'ba")
    # By its name it is swept all the same.
    start(drive, "bath")
    drive.finish()
    assert len(visited(drive, EAST_COLUMNS)) == 90
    drive.command("room_set", room=RoomRequest("bath", skip=False))
    drive.command("start")
    assert drive.mission.order_state.order.zones[0].without == ()


@pytest.mark.parametrize(
    ("zone", "where"),
    [
        ({"name": "bay", "room": 99}, "zones[0].room: there is no room 99"),
        ({"name": "x", "room": 99, "polygon": rectangle(0, 0, 4, 4)}, "zones[0].room: there is no"),
        ({"name": "room 99"}, "zones[0].name: no zone 'room 99'"),
        ({"name": "room 123456"}, "zones[0].name: no zone 'room 123456'"),
        ({"name": "99"}, "zones[0].name: no zone '99'"),
    ],
)
@pytest.mark.parametrize("unknown", ["refuse", "wait"])
def test_an_unknown_room_number_is_always_refused(zone, where, unknown):
    """Whatever room gets the number next would be swept."""
    bay = ConfiguredZone(name="bay", polygon=[tuple(at) for at in rectangle(0, 0, 4, 4)])
    drive = settled(*BOTH, config=with_policy(CONFIG, zones=(bay,)))
    drive.command("start", {"zones": [zone], "unknown": unknown})
    assert where in str(drive.refused)
    assert drive.mission.state is State.IDLE


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_an_order_does_not_follow_a_room_that_gets_a_lost_number(is_cancelled):
    """After a power cut the rooms' file may be older than the order, or broken."""
    drive = settled(*BOTH)
    start(drive, f"room {room_at(drive, *IN_EAST).id}")
    if is_cancelled:
        drive.command("cancel")
    kept = OrderState.from_json(drive.mission.order_state.to_json())
    (before,) = (kept.last or kept.order).zones
    again = settled(*BOTH, order_state=kept)
    state = again.mission.order_state
    (zone,) = (state.last or state.order).as_given.zones
    assert (zone.room, zone.polygon) == (0, before.polygon)
    assert min(room.id for room in again.mission.rooms.rooms) > before.room


# A room of 12 x 12 cells, with a door in its eastern wall, within corridors 6 cells wide.
RING = (
    *(["." * 26] * 6),
    "......" + "#" * 14 + "......",
    *(["......#" + "." * 12 + "#......"] * 5),
    *(["......#" + "." * 19] * 2),
    *(["......#" + "." * 12 + "#......"] * 5),
    "......" + "#" * 14 + "......",
    *(["." * 26] * 6),
)


@pytest.mark.parametrize("deg", [0.0, 20.0])
def test_a_ring_of_corridors_does_not_contain_the_room_within(deg):
    """An order for it, or one that leaves it out, is about the corridors alone."""
    drive = rotated(RING, deg)
    book = drive.mission.rooms
    (ring,) = (room for room in book.rooms if room.encloses)
    assert len(book.rooms) == 2
    start(drive, ring.title)
    drive.plan()
    (zone,) = zone_progress(drive.mission)
    within = {(row, col) for row in range(7, 19) for col in range(7, 19)}
    assert 400 < zone.cells <= 26 * 26 - 14 * 14 + 2
    lattice = drive.mission.lattice
    asked = in_zones(drive.mission.order_state.order.zones, lattice.window, lattice.cell_m)
    assert not any(asked[lattice.local(cell)] for cell in within)
    drive.command("room_set", room=RoomRequest(ring.id, skip=True))
    drive.command("start")
    drive.tell()
    asked = in_zones(drive.mission.order_state.order.zones, lattice.window, lattice.cell_m)
    assert all(asked[lattice.local(cell)] for cell in within)
    assert not asked[lattice.local((1, 1))]


def rotated(rows, deg):
    """A robot on a map that is rotated, and its lattice with it, once the rooms are known."""
    grid, config = building(*rows), replace(CONFIG, lattice_deg=deg)
    turned = OccupancyGrid(rotated_geometry(grid.geometry, deg), grid.cells, "map")
    pose = pose_at(*IN_WEST).pose
    here = PoseReceived(replace(pose, pose=rotated_pose(pose.pose, deg)))
    drive = Drive(IN_WEST, MapReceived(turned), here, order_state=WAITS, config=config)
    for _ in range(LOOKS):
        drive.tell(here, after=1.01 * PERIOD_S)
    return drive


def test_documents_are_read_as_they_were_written():
    for command in (
        Command("room_name", room=RoomRequest(3, name="kitchen")),
        Command("room_split", room=RoomRequest("kitchen", cut=[(0.0, 1.0), (2.0, 1.0)])),
        Command("room_merge", room=RoomRequest(3, others=[4, "bath"], name="wet")),
        Command("room_set", room=RoomRequest(3, passes=2, skip=True, priority=80)),
        Command("room_set", room=RoomRequest(3, passes=["edge", PassDocument(angle_deg=30.0)])),
    ):
        assert read_command(json.loads(json.dumps(command_document(command)))) == command
    order = {"zones": [{"name": "kitchen"}], "unknown": "wait"}
    written = order_document(read_order(order))
    assert (written["zones"], written["unknown"]) == (order["zones"], "wait")
    assert are_same(read_order(written), read_order(order))
    followed = {"name": "k", "room": 3, "polygon": rectangle(0, 0, 2, 2), "passes": 1}
    assert order_document(read_order({"zones": [followed]}))["zones"][0]["room"] == 3


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"command": "room_name"}, "room: goes with room_name, room_split"),
        ({"command": "pause", "room": {"id": 3}}, "room: goes with room_name"),
        ({"command": "room_name", "room": {}}, "room.id: missing"),
        ({"command": "room_name", "room": {"id": 3}}, "room.name: missing with room_name"),
        ({"command": "room_name", "room": {"id": 3, "skip": True}}, "room.skip: does not go with"),
        ({"command": "room_split", "room": {"id": 3}}, "room.cut: missing with room_split"),
        (
            {"command": "room_split", "room": {"id": 3, "cut": [[0, 0]]}},
            "room.cut: expected a list of",
        ),
        (
            {"command": "room_split", "room": {"id": 3, "cut": [[0, 0], [math.inf, 0]]}},
            "must be finite",
        ),
        ({"command": "room_merge", "room": {"id": 3, "name": "a"}}, "room.others: missing"),
        ({"command": "room_set", "room": {"id": 3}}, "room: passes or priority or skip is missing"),
        ({"command": "room_set", "room": {"id": 3, "passes": ["rest"]}}, "rest goes after an edge"),
    ],
)
def test_a_wrong_member_of_a_request_is_named(document, said):
    with pytest.raises(OrderError) as refused:
        read_command(document)
    assert said in str(refused.value)


def test_rooms_of_another_frame_are_not_known_on_this_map():
    """Not even between its first map and the first look at it."""
    drive = settled(*BOTH)
    name(drive, room_at(drive, *IN_EAST).id, "kitchen")
    upstairs = MapReceived(building(*BOTH, frame="upstairs"))
    for _ in range(round(4 * PATIENCE_S)):
        drive.tell(upstairs, pose_at(*IN_WEST, frame="upstairs"), after=0.5)
        if drive.mission.grid.frame == "upstairs":
            break
    assert drive.mission.grid.frame == "upstairs"
    start(drive, "kitchen")
    assert drive.refused.code == "bad_order"
    settle(drive, "upstairs")
    assert len(drive.mission.rooms.rooms) == 2
    start(drive, "kitchen")
    assert "nor a room: there are room 3, room 4" in str(drive.refused)


def test_a_look_that_fails_is_a_fault_and_the_robot_sweeps_on(monkeypatch):
    def fail(*_):
        raise IndexError("index 0 is out of bounds")

    monkeypatch.setattr(room_watch, "find_rooms", fail)
    drive = robot_in(*BOTH, cell=IN_WEST)
    faults = []
    for _ in range(3):
        decision = drive.tell(MapReceived(building(*BOTH)), pose_at(*IN_WEST), after=PERIOD_S)
        faults += decision.faults
    assert {str(fault) for fault in faults} == {
        "rooms of this map were not published: IndexError: index 0 is out of bounds"
    }
    drive.finish()


def test_a_map_is_looked_at_once_however_often_it_comes(monkeypatch):
    looks = []

    def find(grid, cuts):
        looks.append(len(cuts))
        return find_rooms(grid, cuts)

    monkeypatch.setattr(room_watch, "find_rooms", find)
    drive = settled(*BOTH)
    for _ in range(4):
        drive.tell(MapReceived(building(*BOTH)), pose_at(*IN_WEST), after=PERIOD_S)
        drive.tell(after=PERIOD_S)
    assert looks == [0]
    drive.command("room_split", room=RoomRequest(1, cut=((1.5, -0.1), (1.5, 2.6))))
    settle(drive)
    drive.tell(MapReceived(building(*ONLY_WEST)), pose_at(*IN_WEST))
    settle(drive)
    assert looks == [0, 1, 1]
