"""Before there is a mission: what is held until there is one, and that it does not grow."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, NoDisk
from fasaco_edge.daemon.loop.inbox import make_mailbox
from fasaco_edge.daemon.loop.mission_runner import HeldEvents, MissionRunner
from fasaco_edge.errors import PatchWithoutBase
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.events import (
    CommandReceived,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PoseReceived,
)
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.mission.work.order_state import OrderState
from tests.daemon.test_rooms_file import two_rooms
from tests.support.ledgers import lane

SIDE = 8
GEOMETRY = GridGeometry(SIDE, SIDE, 0.1, Pose2D(0.0, 0.0))


def a_map(frame="map"):
    return MapReceived(OccupancyGrid(GEOMETRY, np.zeros((SIDE, SIDE), np.int8), frame))


def update(place, frame="map"):
    row, col = divmod(place, SIDE)
    cells = np.full((1, 1), 100, np.int8)
    return PatchReceived(MapPatch(Window(row, col, row + 1, col + 1), cells, frame))


def maps(held):
    return {one.grid.frame: one.grid.cells for one in held if isinstance(one, MapReceived)}


def test_updates_merge_into_their_map_and_take_no_more_memory():
    before = HeldEvents()
    before.take([a_map()])
    for place in range(SIDE * SIDE):
        assert before.take([update(place)]) == []
        assert len(before.events) == 1
    assert (maps(before.events)["map"] == 100).all()


def test_each_update_finds_the_map_of_its_frame():
    """Which of two frames counts is not known yet: neither map may be lost, or wrong."""
    before = HeldEvents()
    before.take([a_map("map"), a_map("odom")])
    pose = PoseReceived(StampedPose(Pose2D(0.0, 0.0), "map"))
    faults = before.take([update(1, "map"), update(2, "odom"), pose, update(3, "map")])
    assert faults == []
    found = {frame: np.flatnonzero(cells).tolist() for frame, cells in maps(before.events).items()}
    assert found == {"map": [1, 3], "odom": [2]}
    assert before.events[-1] is pose


def test_an_update_that_does_not_fit_is_refused_at_once():
    before = HeldEvents()
    assert [str(fault) for fault in before.take([update(0)])] == [
        "map update refused: there is no map yet"
    ]
    before.take([a_map()])
    beyond = PatchReceived(MapPatch(Window(0, 0, 1, SIDE + 1), np.zeros((1, SIDE + 1), np.int8)))
    faults = before.take([beyond, update(0, "odom"), update(7)])
    assert [type(fault) for fault in faults] == [PatchWithoutBase] * 2
    assert np.flatnonzero(maps(before.events)["map"]).tolist() == [7]


def test_after_lost_updates_only_another_map_counts():
    before = HeldEvents()
    before.take([a_map()])
    for _ in range(100):
        (fault,) = before.take([PatchesLost(3)])
        assert str(fault) == "3 map updates were lost"
    (fault,) = before.take([update(0)])
    assert str(fault) == "map update refused: updates before it were lost"
    # The mission is to hear of it, too: once.
    assert [type(held) for held in before.events] == [MapReceived, PatchesLost]
    before.take([a_map()])
    assert before.take([update(0)]) == []
    assert [type(held) for held in before.events] == [MapReceived]


def runner_of(config: DaemonConfig, restored=None, rooms=None) -> MissionRunner:
    """Return a runner before its first mission, with the ledger of the process before."""
    keeper = LedgerKeeper(NoDisk(restored), config.cell_m, autostart=False)
    return MissionRunner(config, keeper, make_mailbox(config.map.max_pixels), rooms=rooms)


def start(runner: MissionRunner, **order):
    (answer,) = runner.answer([CommandReceived(1, "start", read_order(order))])
    return answer.error


def test_an_order_for_a_room_belongs_to_the_frame_of_the_room():
    """Its outline would lie anywhere on the map of another one."""
    runner = runner_of(DaemonConfig(), rooms=two_rooms())
    runner.rooms.name(1, "kitchen")
    assert start(runner, zones=[{"name": "kitchen"}]) is None
    state = runner.order_state
    assert state.frame == "map"
    assert state.in_other_frame("it moved").order is None


def test_a_zone_named_before_a_map_applies_only_to_its_map():
    kitchen = {"name": "kitchen", "polygon": [[0.3, 0.9], [1.5, 0.9], [1.5, 1.5]]}
    mission = {"map_frame": "floor_1", "zones": [kitchen]}
    runner = runner_of(msgspec.convert({"mission": mission}, DaemonConfig))
    assert start(runner, zones=[{"name": "kitchen"}]) is None
    assert runner.order_state.frame == "floor_1"
    # Progress on another map says before any map comes that it is not theirs.
    note = replace(OrderState.idle("done"), frame="floor_2").to_json()
    runner = runner_of(runner.config, replace(lane(5), frame="floor_2", note=note))
    refused = start(runner, zones=[{"name": "kitchen"}])
    assert refused.code == "bad_order"
    assert "given for the map in frame 'floor_1'" in str(refused)


def test_an_order_that_cannot_be_read_moves_no_robot():
    runner = runner_of(DaemonConfig(), replace(lane(5), note='{"version":9}'))
    assert runner.order_state.order is None
    assert runner.order_state.why.startswith("the order kept with the ledger cannot be read")
    assert start(runner, keep_covered=True) is None
    assert runner.order_state.order is not None
