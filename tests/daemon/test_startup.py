"""Before there is a mission: what is held until there is one, and that it does not grow."""

from __future__ import annotations

import numpy as np

from fasaco_edge.daemon.loop.mission_runner import HeldEvents
from fasaco_edge.errors import PatchWithoutBase
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.core.events import MapReceived, PatchesLost, PatchReceived, PoseReceived

SIDE = 8
GEOMETRY = GridGeometry(SIDE, SIDE, 0.1, Pose2D(0.0, 0.0))


def a_map(frame="map"):
    return MapReceived(OccupancyGrid(GEOMETRY, np.zeros((SIDE, SIDE), np.int8), frame))


def update(place, frame="map"):
    """An update of one pixel."""
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


def test_what_misfits_is_told_at_once():
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
