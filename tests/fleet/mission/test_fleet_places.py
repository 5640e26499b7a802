"""Where robots' maps lie in the frame of a fleet: put right, or not known, as on another floor."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from msgspec import structs

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.config.config import DaemonConfig, FleetConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.daemon.fleet_wing import company_of
from fasaco_edge.fleet.daemon.exchange import FleetReceiver, FleetSender, kind_of
from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.shared import MapPlace, SharedProgress
from fasaco_edge.fleet.mission.tiles import tile_bits
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import UNKNOWN, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.core.company_kind import ALONE
from fasaco_edge.mission.events import MapReceived, MemberReceived
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember
from fasaco_edge.wire.documents.json_text import encode_json
from tests.fleet.mission.test_fleet_frames import AT, bits_of
from tests.mission.test_other_building import HERE, NEW, OLD, stand
from tests.mission.world import CELL, Drive, building, pose_at

HALL = DaemonConfig(
    robot=RobotConfig(name="r1", overlap=0.0, tool_width_m=CELL, radius_m=CELL / 2),
    fleet=FleetConfig("hall", "house"),
)
IN_FLEET = kind_of(HALL)
BLOCK = {(row, col) for row in range(5, 10) for col in range(5, 10)}


def told_from(x_m, **changes):
    tiles = (CellTile(0, 0, bits_of(BLOCK)),)
    said = FleetMember(1, "hall", CELL, "house", "covering", 2.0, 2.0, 1.0, 1, 0, 5, tiles)
    said = structs.replace(said, ground=tiles, origin=(x_m, 0.0, 0.0), **changes)
    return Sample("fasaco/@v1/r2/fleet", encode_json(said))


def cells_in(window, mask):
    return {(window.row0 + int(row), window.col0 + int(col)) for row, col in np.argwhere(mask)}


def swept_by_others(mission):
    window = mission.lattice.window
    return cells_in(window, mission.covered.shared.swept(window))


def test_a_moved_map_of_another_robot_drops_its_earlier_cells():
    """It was restarted with an origin put right, and keeps its epoch."""
    receiver, drive = FleetReceiver(HALL), Drive((3, 3), kind=IN_FLEET)
    drive.mission.covered.shared.begin_epoch(1)
    drive.tell(MapReceived(building(*["." * 60] * 20)), pose_at(3, 3))
    drive.tell(receiver.event(told_from(0.0)))
    assert swept_by_others(drive.mission) == BLOCK
    drive.tell(receiver.event(told_from(20 * CELL)))
    moved = {(row, col + 20) for row, col in BLOCK}
    assert swept_by_others(drive.mission) == moved
    lattice = drive.mission.lattice
    unknown = np.full_like(lattice.states, UNKNOWN), np.zeros_like(lattice.steps)
    nothing = ReachableArea(
        CoverageLattice(lattice.window, lattice.cell_m, *unknown), np.zeros((20, 60), np.bool_)
    )
    ground = drive.mission.company.others.ground.joint(nothing).lattice
    assert cells_in(ground.window, ground.coverable) == moved


def test_cells_of_a_moved_robot_count_if_none_were_disregarded():
    shared, tiles = SharedProgress(), (((0, 0), bits_of(BLOCK)),)
    shared.begin_epoch(1)
    shared.receive("r2", 1, tiles)
    assert shared.receive("r2", 1, tiles, lattice=AT)
    assert shared.cells_of("r2") == 25
    # Which of its cells these are is not known at the new place.
    shared.disregard(lambda rows, _: rows < 7)
    assert shared.cells_of("r2") == 15
    kept = shared.encode()
    for again in (shared, SharedProgress()):
        again.restore(kept)
        again.receive("r2", 1, tiles, lattice=Pose2D(0.0, 0.0))
        again.receive("r2", 1, tiles, lattice=Pose2D(0.0, 0.0))
        assert again.cells_of("r2") == 0
        more = (((0, 0), bits_of(BLOCK | {(20, 20), (20, 21)})),)
        again.receive("r2", 2, more, lattice=Pose2D(0.0, 0.0))
        assert again.cells_of("r2") == 2


@pytest.mark.parametrize(
    "place", [None, MapPlace((0.0, 2.0, 0.0)), MapPlace((1.0, 2.0, 90.0))], ids=str
)
def test_cells_from_before_a_correction_of_the_own_map_are_void(place):
    shared, tiles = SharedProgress(MapPlace((1.0, 2.0, 0.0))), (((0, 0), bits_of(BLOCK)),)
    shared.begin_epoch(5)
    shared.receive("r2", 1, tiles, lattice=AT)
    shared.receive("r3", 1, tiles)
    same, other = SharedProgress(MapPlace((1.0, 2.0, 0.0))), SharedProgress(place)
    for again in (same, other):
        again.restore(shared.encode())
        assert again.epoch == 5
    assert [same.cells_of(robot) for robot in ("r2", "r3")] == [25, 25]
    assert not other.swept(Window(0, 0, 99, 99)).any()
    other.restore(other.encode())
    other.receive("r2", 1, tiles)
    assert other.cells_of("r2") == 25


class Listener:
    def put(self, payload):
        self.payload = payload


FLOORS = [building(*["." * 10] * 4, frame=frame) for frame in ("floor1", "floor2")]


class OnFloors(Drive):
    """A robot in a building with a lift."""

    def __init__(self, place=IN_FLEET.map_place, before=None, frame="house"):
        super().__init__((0, 0), kind=FleetKind("r1", place))
        if before is not None:
            self.mission.restore(before)
        self.mission.covered.shared.begin_epoch(1)
        fleet = FleetConfig("hall", frame, place.origin[0])
        self.receiver = FleetReceiver(structs.replace(HALL, fleet=fleet))
        self.listener = Listener()
        self.sender = FleetSender(self.listener, structs.replace(HALL, fleet=fleet))

    def stay_on(self, floor, seconds=15):
        for second in range(seconds):
            pose = pose_at(1, second % 10, frame=floor.frame)
            self.tell(MapReceived(floor), pose, after=1.0)
        self.sender.publish(self.mission, self.now)

    def receive(self, payload):
        self.tell(self.receiver.event(Sample("fasaco/@v1/r2/fleet", payload)))
        return self.mission.company.others.known["r2"].left_out

    def told(self):
        said = json.loads(self.listener.payload)
        return said["frame"], bool(said["swept"])


def test_cells_of_a_robot_on_another_floor_do_not_count():
    first, second = FLOORS
    rider, other = OnFloors(), OnFloors()
    other.stay_on(first)
    rider.stay_on(first)
    assert rider.told() == ("house", True)
    assert other.receive(rider.listener.payload) == ""
    rider.receive(other.listener.payload)
    before = swept_by_others(other.mission)
    assert before
    rider.stay_on(second)
    assert rider.told() == ("floor2", True)
    assert other.receive(rider.listener.payload) == (
        "its frame is 'floor2', that of this fleet is 'house'"
    )
    assert swept_by_others(other.mission) == before
    # Nor does it take their cells for such of this floor, or them for robots in its way.
    assert rider.receive(other.listener.payload) == (
        "the map frame is 'floor2' here, fleet.x_m, y_m and yaw_deg belong to 'floor1' "
        "(fleet.map_frame)"
    )
    assert swept_by_others(rider.mission) == set()
    rider.stay_on(first)
    assert rider.told() == ("house", True)
    assert rider.receive(other.listener.payload) == other.receive(rider.listener.payload) == ""


def test_after_a_reset_nothing_counts_before_the_frame_is_known():
    robot, other = OnFloors(), OnFloors()
    for one in (robot, other):
        one.stay_on(FLOORS[0])
    robot.command("reset")
    robot.receive(other.listener.payload)
    robot.stay_on(FLOORS[1])
    assert swept_by_others(robot.mission) == set()


def test_the_map_of_the_place_is_kept_over_a_restart():
    robot = OnFloors()
    robot.stay_on(FLOORS[0])
    kept = robot.mission.snapshot()
    for place, told in (
        (IN_FLEET.map_place, "floor2"),
        (MapPlace((4.0, 0.0, 0.0)), "house"),
        (replace(IN_FLEET.map_place, frame="floor2"), "house"),
    ):
        again = OnFloors(place, kept)
        again.stay_on(FLOORS[1])
        assert again.told()[0] == told
        # It stays so, also where it has been on both.
        again = OnFloors(place, again.mission.snapshot())
        again.stay_on(FLOORS[1])
        assert again.told()[0] == told


def test_a_daemon_gives_its_mission_the_place_of_the_map():
    fleet = FleetConfig("hall", "house", 4.2, -1.5, 90.0, "floor1")
    blocks = fleet, FleetConfig("hall"), msgspec.UNSET
    kinds = [company_of(structs.replace(HALL, fleet=block)) for block in blocks]
    place = MapPlace((4.2, -1.5, 90.0), "floor1")
    name = HALL.robot.name
    assert kinds == [FleetKind(name, place), FleetKind(name), ALONE]


def test_a_map_frame_named_as_the_fleets_frame_is_another_frame():
    robot = OnFloors(frame="floor2")
    robot.stay_on(FLOORS[0])
    assert robot.told()[0] == "floor2"
    robot.stay_on(FLOORS[1])
    assert robot.told()[0] == "floor2 of another map"


def test_cells_of_others_on_the_previous_floor_do_not_count():
    """They go on telling of it, in the frame that the map here has, too."""
    everywhere = tile_bits(np.ones((64, 64), np.uint16))
    tiles = (((0, 0), everywhere),)
    other = MemberReceived("b", frame="map", state="covering", epoch=1, tiles=tiles)
    drive = Drive(HERE, OLD, pose_at(*HERE), kind=FleetKind("a"))
    drive.tell(other)
    assert drive.mission.coverage().remaining == 0
    stand(drive, 8.0, NEW)
    drive.tell(other)
    assert drive.mission.coverage().remaining == 39
    assert "another building" in drive.mission.covered.shared.why_misplaced("map")
    drive.command("reset")
    assert drive.mission.covered.shared.why_misplaced("map") == ""
