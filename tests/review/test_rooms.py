"""Each room of a recording has a chapter: where the robot was, and what it left there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.review.floor_and_rooms import room_at, room_chapters, swept_floor
from fasaco_edge.review.moments import spans_of
from fasaco_edge.review.run_data import RunData, StatusSample
from fasaco_edge.wire.documents.replies import MissionReport, ZoneReport
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.documents.status import Status

CONFIG = {"robot": {"radius_m": 0.15, "tool_width_m": 0.3}, "planner": {"line": "quick"}}
# A hall around a closet, and a kitchen beside it.
HALL = RoomReport(1, "", ((0, 0), (4, 0), (4, 4), (0, 4)), 15.0, (2,), (3,), 0.5)
KITCHEN = RoomReport(2, "kitchen", ((4, 0), (8, 0), (8, 4), (4, 4)), 16.0, (1,), (), 0.25)
CLOSET = RoomReport(3, "closet", ((1, 1), (2, 1), (2, 2), (1, 2)), 1.0, skip=True)


def driven() -> RunData:
    pixels = np.zeros((80, 160), np.int8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 100
    grid = OccupancyGrid(GridGeometry(80, 160, 0.05, Pose2D(0.0, 0.0)), pixels)
    # A metre in four seconds: a pose each quarter of a metre.
    way = [*np.arange(0.5, 6.6, 0.25), *np.arange(6.25, 0.4, -0.25)]
    poses = [(float(x), 3.0, 0.0) for x in way]
    zone = ZoneReport("kitchen", 2, 2, 9, 9)
    mission = StatusSample(40.0, Status(state="covering", mission=MissionReport(zones=(zone,))))
    return RunData(
        pose_s=[float(index) for index in range(len(poses))],
        poses=poses,
        statuses=[mission],
        grid=grid,
        rooms=Rooms("map", 4, (HALL, KITCHEN, CLOSET)),
        config=CONFIG,
    )


def test_a_room_knows_its_time_its_share_and_what_is_left():
    data = driven()
    # It paused for the last ten seconds of its way out, in the kitchen.
    states = spans_of([(0.0, "covering", ""), (15.0, "paused", ""), (25.0, "covering", "")], 50.0)
    assert data.footprint is not None
    floor = swept_floor(data, CoverageLattice.from_map(data.grid, data.footprint))
    hall, kitchen, closet = room_chapters(data, states, floor)
    assert (hall.title, kitchen.title) == ("room 1", "kitchen")
    assert (hall.entered, kitchen.entered, closet.entered) == (2, 1, 0)
    assert hall.seconds + kitchen.seconds == pytest.approx(len(data.poses) - 1 - 10, abs=0.1)
    assert kitchen.seconds == pytest.approx(20 - 10, abs=2.0)
    # A lane of 0.3 m over half the kitchen's four metres.
    assert kitchen.swept_share == pytest.approx(0.3 * 2.65 / 15.2, abs=0.01)
    assert kitchen.left_m2 == pytest.approx(15.2 - 0.3 * 2.65, abs=0.4)
    # The closet within the hall's outline is no part of it.
    assert closet.left_m2 == pytest.approx(1.0, abs=0.05)
    assert hall.left_m2 == pytest.approx(15.2 - 1.0 - 0.3 * 3.55, abs=0.4)
    assert (kitchen.passes, hall.passes, closet.skip) == (2, None, True)
    found = [room_at(data, place) for place in ((1.5, 1.5), (3.0, 3.0), (9.0, 1.0))]
    assert [room.id if room else None for room in found] == [3, 1, None]


def test_without_a_floor_the_daemon_has_counted():
    data = driven()
    hall, kitchen, _ = room_chapters(data, (), None)
    assert (hall.swept_share, hall.left_m2, hall.counted_share) == (None, None, 0.5)
    assert kitchen.counted_share == 0.25


def test_recordings_without_rooms_have_no_chapters():
    data = driven()
    nothing = RoomReport(1, outline=((0, 0), (1, 1)))
    far = RoomReport(2, outline=((0, 0), (1e14, 0), (0, 1e14)))
    for rooms in (Rooms(), Rooms("map", 1, (nothing, far))):
        assert room_chapters(replace(data, rooms=rooms), (), None) == ()
    # Rooms without a map, or without a pose, as of a torn recording.
    assert room_chapters(replace(data, grid=None), (), None) == ()
    still = room_chapters(replace(data, poses=[], pose_s=[]), (), None)
    assert [room.entered for room in still] == [0, 0, 0]
