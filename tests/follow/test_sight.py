"""What the lidar sees and no map shows: the robot stands before it, and only there."""

import math

import numpy as np
import pytest

from fasaco_edge.follow.sight import (
    KNOWN_M,
    MARGIN_M,
    STANDS_S,
    STOP_M,
    Mount,
    Sight,
    Thing,
    first_met,
    points_of,
)
from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire.messages.base import LaserScan, encode_scan
from fasaco_edge.wire.messages.maps import encode_map_update, encode_occupancy_grid
from tests.follow.closed_loop import LIMITS
from tests.follow.seeing import RADIUS_M, Disc, Seeing, plain_map, scan_at


def test_it_stops_before_an_obstacle_and_resumes_once_it_is_gone():
    seeing = Seeing([Disc(2.0, 0.05)])
    seeing.send((0.0, 0.0), (4.0, 0.0))
    assert FollowerState.OBSTACLE in seeing.run(12.0)
    assert seeing.follower.state is FollowerState.OBSTACLE
    assert "something stands" in seeing.follower.detail
    assert MARGIN_M / 2 < seeing.gap < MARGIN_M + STOP_M + 0.02
    seeing.discs.clear()
    seeing.run(20.0)
    assert seeing.follower.state is FollowerState.DRIVEN
    assert seeing.pose.x == pytest.approx(4.0, abs=0.01)


def test_it_may_drive_along_an_obstacle_inside_the_margin():
    """An object 1 cm beside the robot: it may drive along it, but not towards it."""
    seeing = Seeing([Disc(0.0, 0.2 + RADIUS_M + 0.01)])
    seeing.send((0.0, 0.0), (1.0, 0.0))
    seeing.run(STANDS_S + 8.0)
    assert seeing.follower.state is FollowerState.DRIVEN
    seeing = Seeing([Disc(0.0, 0.2 + RADIUS_M + 0.01)])
    seeing.send((0.0, 0.0), (0.0, 1.0))
    seeing.run(STANDS_S + 8.0)
    assert seeing.follower.state is FollowerState.OBSTACLE
    assert seeing.touched_at == []


def test_walls_of_the_map_do_not_slow_it_down():
    """The line runs a centimetre beside a wall, and ends as near to it; ranges scatter by 2 cm."""

    def seconds(**wall):
        seeing = Seeing(noise=0.02, **wall)
        seeing.send((0.0, 0.0), (2.0, 0.0), (2.0, -0.5))
        begun = seeing.now
        while seeing.step() is not FollowerState.DRIVEN:
            assert seeing.now < begun + 60.0
        return seeing.now - begun

    assert seconds(wall_y=RADIUS_M + 0.01) == pytest.approx(seconds(), abs=0.2)


@pytest.mark.parametrize("toward", [0.0, 0.6, 1.2, 2.0])
def test_it_stands_before_a_person_reaches_it(toward):
    """From ahead at a walk, and from aside: whoever touches it then has walked into it."""
    seconds = 7.5
    vx, vy = -0.4 * math.cos(toward), -0.4 * math.sin(toward)
    seeing = Seeing([Disc(1.0 - vx * seconds, -vy * seconds, 0.2, vx, vy)])
    seeing.send((0.0, 0.0), (5.0, 0.0))
    seeing.run(seconds + 2.0)
    # Here they walk on through it: only how that begins says anything.
    assert seeing.touched_at[:1] in ([], [0.0])


@pytest.mark.parametrize("how", ["none", "lost", "malformed", "blind", "repeated"])
def test_it_stands_without_scans_and_says_why(how):
    seeing = Seeing(scans=how != "none")
    seeing.send((0.0, 0.0), (5.0, 0.0))
    seeing.run(1.0)
    if how == "none":
        assert (seeing.follower.state, seeing.follower.detail) == (
            FollowerState.NO_SCAN,
            "none has come",
        )
        assert seeing.pose.x == 0.0
        return
    assert seeing.follower.state is FollowerState.DRIVING
    seeing.scans = False
    nothing = LaserScan(0.0, 0.1, 0.1, 8.0, (math.nan,) * 40)
    if how == "malformed":
        seeing.follower.take_scan(b"\0\1\0\0junk", seeing.now)
    elif how == "blind":
        seeing.follower.take_scan(encode_scan(nothing), seeing.now)
    elif how == "repeated":
        for _ in range(30):
            seeing.follower.take_scan(scan_at(seeing.pose, [], stamp_ns=7), seeing.now)
            seeing.run(0.1)
    if how in ("lost", "repeated"):
        seeing.run(0.5)
        assert how == "repeated" or seeing.follower.state is FollowerState.DRIVING
        seeing.run(1.0)
        assert seeing.follower.state is FollowerState.NO_SCAN
    else:
        seeing.step()
        assert seeing.follower.state is FollowerState.BAD_SCAN
    assert seeing.last.speed == 0.0 or seeing.run(1.0)
    seeing.scans = True
    seeing.run(1.0)
    assert seeing.follower.state is FollowerState.DRIVING


def test_the_lidar_may_be_mounted_anywhere_and_upside_down():
    mount = Mount(0.1, -0.05, 2.0, upside_down=True)
    seeing = Seeing([Disc(2.0, 0.0)], mount=mount)
    seeing.send((0.0, 0.0), (4.0, 0.0))
    seeing.run(12.0)
    assert seeing.follower.state is FollowerState.OBSTACLE
    assert 0.0 < seeing.gap < 0.1


def test_a_scan_says_what_it_does():
    ranges = (1.0, math.nan, math.inf, -math.inf, 0.01, 9.0, 2.0)
    points = points_of(LaserScan(0.0, 0.5, 0.1, 8.0, ranges), Mount(0.2))
    assert points is not None
    assert sorted((round(x, 3), round(y, 3)) for x, y in points) == sorted(
        (round(0.2 + far * math.cos(angle), 3), round(far * math.sin(angle), 3))
        for far, angle in ((1.0, 0.0), (0.1, 1.5), (2.0, 3.0))
    )


def test_the_first_thing_on_a_line_with_corners_is_met():
    line = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
    way, _ = first_met([Thing(1.1, 0.8, False), Thing(3.0, 0.0, False)], line, 0.2)
    near = 0.2 + MARGIN_M
    assert way == pytest.approx(1.0 + 0.8 - math.sqrt(near * near - 0.01))
    assert first_met([Thing(-0.3, 0.0, False)], line, 0.2)[0] == math.inf


def test_motion_behind_the_robot_does_not_stop_it():
    seeing = Seeing([Disc(-0.5, 0.0)])
    seeing.send((0.0, 0.0), (1.0, 0.0))
    seeing.run(0.5)
    assert seeing.follower.state is FollowerState.DRIVING
    assert seeing.last.speed == pytest.approx(0.45 * LIMITS.acceleration, abs=0.1)


def test_people_beside_mapped_obstacles_are_seen():
    """They leave marks on a map where they walked; what stands there is the map's business."""
    for vy, stops in ((-0.4, True), (0.0, False)):
        seeing = Seeing([Disc(1.5, 0.0 - vy * 6.0, 0.2, 0.0, vy)], wall_y=1.2)
        seeing._sight.take_map(plain_map(wall_y=-0.3))
        seeing.send((0.0, 0.0), (5.0, 0.0))
        assert (FollowerState.OBSTACLE in seeing.run(7.5)) == stops
        assert not stops or seeing.touched_at[:1] in ([], [0.0])


def map_with(cells, yaw=0.0):
    geometry = GridGeometry(*cells.shape, 0.05, Pose2D(1.0, 2.0, yaw))
    return geometry, encode_occupancy_grid(OccupancyGrid(geometry, cells, "map", 1))


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_the_map_shows_places_near_occupied_pixels_at_any_yaw(yaw):
    cells = np.zeros((40, 60), np.int8)
    cells[20, 30], cells[5, 5], cells[6, 50] = 100, 25, -1
    geometry, payload = map_with(cells, yaw)
    sight = Sight(Mount(), RADIUS_M)

    def shown(col, row):
        return sight._shows(*geometry.to_map(col, row))

    assert not shown(30.5, 20.5)
    sight.take_map(payload)
    near, far = KNOWN_M / 0.05 - 0.01, KNOWN_M / 0.05 + 1.5
    for angle in np.linspace(0.0, math.tau, 8, endpoint=False):
        right, up = math.cos(angle), math.sin(angle)
        assert shown(30.5 + near * right, 20.5 + near * up)
        right, up = right / max(abs(right), abs(up)), up / max(abs(right), abs(up))
        assert not shown(30.5 + far * right, 20.5 + far * up)
    # Neither free nor unknown pixels are obstacles; beside the map there are none.
    for col, row in ((5.5, 5.5), (50.5, 6.5), (-90.0, 20.0), (30.0, 90.0)):
        assert not shown(col, row)


def test_updates_change_the_map():
    geometry, payload = map_with(np.zeros((40, 60), np.int8))
    sight = Sight(Mount(), RADIUS_M)
    patch = encode_map_update(MapPatch(Window(10, 10, 12, 13), np.full((2, 3), 100, np.int8)))
    place = geometry.to_map(11.5, 11.0)
    # Without a map an update says nothing; a map takes the place of all before it.
    for update in (True, False, True, False):
        sight.take_map(patch if update else payload, is_update=update)
        assert sight._shows(*place) == (update and sight._grid is not None)
