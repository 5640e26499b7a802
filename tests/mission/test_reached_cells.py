"""What was reachable once, and no longer is: never counted as done, and said at the end."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.work.reached_cells import ReachedCells
from tests.mission.line_robot import PIXEL_M, LineRobot
from tests.mission.test_path_begins import two_rooms
from tests.mission.test_shut_in import room_with_niche, shut_in

START = (1.0, 1.0)
WALL = slice(60, 62)


def changed(how):
    """The same where the door is closed, the other room is unknown, or the map is cut there."""
    pixels = two_rooms(is_open=True)
    pixels[:, WALL] = 100
    if how == "unknown":
        pixels[:, 62:] = -1
    return pixels[:, :62] if how == "cut" else pixels


def in_first_room():
    """A robot that has come back from the other room before that was swept."""
    robot = LineRobot(two_rooms(is_open=True), START)
    assert robot.wait(100.0, lambda robot: robot.x > 3.5)
    assert robot.wait(100.0, lambda robot: robot.x < 2.5)
    return robot


@pytest.mark.parametrize(
    ("how", "is_restarted", "why"),
    [
        ("closed", False, "closed off by obstacles"),
        ("unknown", True, "unknown to the map"),
        ("cut", False, "unknown to the map"),
    ],
)
def test_the_end_says_what_is_out_of_reach_now(how, is_restarted, why):
    robot = in_first_room()
    robot.show(changed(how))
    if is_restarted:
        robot.restart(changed(how))
    assert robot.wait(600.0, lambda robot: robot.mission.state == "done")
    assert " of 15.1 m2 covered; 2.5 m2 not reached: " in robot.mission.reason
    assert why in robot.mission.reason
    # A restart after the end says the same.
    said = robot.mission.reason
    robot.restart(changed(how))
    robot.wait(10.0, lambda _: False)
    assert (robot.mission.state, robot.mission.reason) == ("done", said)


def test_reached_cells_turn_with_the_lattice():
    """As after a restart with another ``lattice_deg``."""
    robot = in_first_room()
    robot.show(changed("unknown"))
    robot.config = replace(robot.config, lattice_deg=30.0)
    robot.restart(changed("unknown"))
    assert robot.wait(600.0, lambda robot: robot.mission.state == "done")
    said = re.search(r"; (\d\.\d) m2 not reached: ", robot.mission.reason)
    assert 1.7 <= float(said[1]) <= 3.0, robot.mission.reason


def test_a_robot_that_is_shut_in_is_not_done_after_a_restart():
    robot = shut_in(by=5)
    robot.wait(20.0, lambda _: False)
    closed = robot.mission.grid.cells
    robot.restart(closed)
    assert not robot.wait(100.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.state == "blocked"
    assert "shut in" in robot.mission.reason
    robot.show(room_with_niche())
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")


def test_a_shut_in_robot_with_no_floor_left_is_done():
    robot = LineRobot(two_rooms(is_open=True), START)
    assert robot.wait(300.0, lambda robot: robot.mission.coverage().remaining < 15)
    assert robot.x > 3.3
    # With the door the cells beside it are closed, so less than half remains in reach.
    door = ((2.9, 0.0), (3.2, 0.0), (3.2, 2.6), (2.9, 2.6))
    robot.command("keep_out_add", KeepOut("door", door))
    assert robot.wait(100.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.reason.startswith("every reachable cell is covered")


def with_map_moved(robot, pixels, x, y, deg):
    """The same robot, once its map and pose have turned about the origin and moved."""
    yaw = math.radians(deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    robot.x, robot.y = cos * robot.x - sin * robot.y + x, sin * robot.x + cos * robot.y + y
    robot.yaw += yaw
    robot.path = []
    geometry = GridGeometry(*pixels.shape, PIXEL_M, Pose2D(x, y, yaw))
    robot.step(MapReceived(OccupancyGrid(geometry, np.ascontiguousarray(pixels))))
    return robot


TURNED, SHIFTED = (0.0, 0.0, 3.0), (0.1, 0.1, 0.0)


@pytest.mark.parametrize(
    ("after_s", "motion"),
    [
        (60.0, (0.5, 0.3, 8.0)),
        # Rows of cells along its walls were said not to be reached: 2.4 of 15 m2.
        (30.0, SHIFTED),
    ],
)
def test_reached_cells_move_with_the_map(after_s, motion):
    robot = LineRobot(two_rooms(is_open=True), START)
    robot.wait(after_s, lambda _: False)
    with_map_moved(robot, two_rooms(is_open=True), *motion)
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.reason.startswith("every reachable cell is covered")
    covered = robot.mission.coverage()
    assert covered.coverable == np.count_nonzero(robot.mission.map.area.reachable)


@pytest.mark.parametrize("motion", [TURNED, SHIFTED])
def test_a_room_closed_as_the_map_moves_is_reported_once(motion):
    robot = LineRobot(two_rooms(is_open=True), START)
    assert robot.wait(100.0, lambda robot: robot.x < 2.0)
    with_map_moved(robot, changed("closed"), *motion)
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    # The rooms have 99 cells each and the door 9 at most, as they lie before the motion.
    not_reached = robot.mission.coverage().remaining
    assert 80 <= not_reached <= 115
    assert "unknown" not in robot.mission.reason


def test_cells_are_kept_as_they_were():
    window = Window(-7, 3, 5, 24)
    mask = np.random.default_rng(1).random((window.rows, window.cols)) < 0.1
    kept = ReachedCells.of(mask, window)
    again = np.zeros_like(mask)
    again[kept.window.slices_in(window)] = kept.mask
    assert np.array_equal(again, mask)
    assert ReachedCells.of(np.zeros_like(mask), window) is None
