"""The contract of a path: it begins at the robot, and leads out of where the disc does not fit."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import MapReceived
from tests.mission.line_robot import RADIUS_M, TOOL_M, LineRobot


def room_with_box():
    """A room of 4 m x 3 m with a box in it, and a wall beside the robot's way."""
    pixels = np.full((60, 82), 100, np.int8)
    pixels[1:59, 1:81] = 0
    pixels[24:36, 30:44] = 100
    return pixels


def distance_to_walls(pixels, points):
    """Return the distance of points (n, 2) to the nearest wall, from pixel squares [m]."""
    rows, cols = np.nonzero(pixels > 50)
    points = np.asarray(points)
    dx = np.abs(points[:, None, 0] / 0.05 - (cols + 0.5)) - 0.5
    dy = np.abs(points[:, None, 1] / 0.05 - (rows + 0.5)) - 0.5
    return 0.05 * np.hypot(dx.clip(0), dy.clip(0)).min(axis=1)


@pytest.mark.parametrize("seed", range(2))
def test_the_path_begins_where_the_robot_is_pushed_to(seed):
    rng = np.random.default_rng(seed)
    pixels = room_with_box()
    robot = LineRobot(pixels, (0.75, 0.75))
    robot.wait(5.0 + 20.0 * rng.random(), lambda _: False)
    # Walls get a pixel thicker, and the robot is a little beside its line.
    if seed % 2:
        thick = pixels.copy()
        thick[1:2] = thick[58:59] = thick[:, 1:2] = thick[:, 80:81] = 100
        thick[23:37, 29:45] = 100
        pixels = thick
    while True:
        x, y = rng.uniform(0.1, 4.0), rng.uniform(0.1, 2.9)
        gap = distance_to_walls(pixels, [(x, y)])[0]
        if 0.6 * RADIUS_M < gap < 1.2 * RADIUS_M:
            break
    robot.x, robot.y, robot.is_stuck = x, y, True
    robot.show(pixels)
    robot.wait(40.0, lambda _: False)
    # The first ones may still be of where it was.
    since = [(points, why) for at, points, why in robot.paths if at > robot.now - 38.0]
    assert since
    for points, why in since:
        # A robot that fits where it is may begin at its place on the line, within half the tool.
        apart = math.dist(points[0], (x, y))
        assert apart < (TOOL_M / 2 if gap > RADIUS_M else 0.01), f"{why}: {x:.3f} {y:.3f} {gap:.3f}"
    # Nowhere is it nearer to a wall than where the robot is.
    steps = [np.linspace(a, b, 20) for a, b in pairwise(points)]
    nearest = distance_to_walls(pixels, np.concatenate(steps))
    assert nearest.min() > min(gap, RADIUS_M) - 0.008
    robot.is_stuck = False
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")


@pytest.mark.parametrize("after_s", [5.0, 17.7, 40.2])
def test_on_another_raster_the_path_begins_at_the_robot(after_s):
    """Not as far along its first edge as the robot was on the line before."""
    robot = LineRobot(room_with_box(), (0.75, 0.75))
    robot.wait(after_s, lambda _: False)
    pixels = room_with_box()
    # The same room by a mapper that has its rows where columns were.
    geometry = GridGeometry(*pixels.T.shape, 0.05, Pose2D(0.05 * pixels.shape[1], 0.0, math.pi / 2))
    robot.step(MapReceived(OccupancyGrid(geometry, np.ascontiguousarray(pixels.T[::-1]))))
    _, points, why = robot.paths[-1]
    assert why == "map on another raster"
    assert math.dist(points[0], (robot.x, robot.y)) < 0.01


def two_rooms(*, is_open):
    """Two rooms of 3 m x 2.5 m, and a door of 0.8 m between them."""
    pixels = np.full((52, 124), 100, np.int8)
    pixels[1:51, 1:60] = pixels[1:51, 62:123] = 0
    if is_open:
        pixels[18:34, 60:62] = 0
    return pixels


@pytest.mark.parametrize("door_s", [6.0, 47.0, 71.0])
def test_a_path_cut_off_by_a_door_begins_at_the_robot(door_s):
    robot = LineRobot(two_rooms(is_open=True), (1.0, 1.0))
    robot.wait(door_s, lambda _: False)
    apart = []
    for tick in range(80):
        count = len(robot.paths)
        if tick % 6:
            robot.step()
        else:
            robot.show(two_rooms(is_open=tick % 12 > 0))
        for _, points, _ in robot.paths[count:]:
            if len(points):
                apart.append(math.dist(points[0], robot.track[-1]))
    assert max(apart) < 0.01
