"""A robot that the map shuts in where it has just driven in."""

import numpy as np

from fasaco_edge.mission.orders.keep_outs import KeepOut
from tests.mission.line_robot import RADIUS_M, LineRobot

# From here the robot is in the niche long before the room is swept.
START = (3.7, 1.5)


def room_with_niche():
    """A room of 4 m x 3 m, and a niche of 1 m x 0.8 m behind a gap 0.45 m wide."""
    pixels = np.full((60, 104), 100, np.int8)
    pixels[1:59, 1:80] = 0
    pixels[22:38, 82:103] = 0
    pixels[26:35, 80:82] = 0
    return pixels


def thicker(pixels, by=1):
    """The same with the gap's walls some pixels thicker on both sides; from 5 on it is closed."""
    closed = pixels.copy()
    closed[26 : 26 + by, 80:82] = closed[35 - by : 35, 80:82] = 100
    return closed


def shut_in(by=1, where=lambda robot: robot.x > 4.5):
    """A robot in the niche, whose gap has become narrower behind it."""
    robot = LineRobot(room_with_niche(), START)
    assert robot.wait(600.0, where)
    robot.show(thicker(room_with_niche(), by))
    return robot


def troubles(robot):
    return {trouble.code for trouble in robot.mission.troubles}


def test_it_drives_out_along_its_track_and_sweeps_on():
    robot = shut_in()
    before = len(robot.track)
    assert robot.wait(60.0, lambda robot: robot.x < 3.8)
    assert any("drives back along its track" in reason for _, _, reason in robot.paths)
    x, y = np.array(robot.track[before:]).T
    in_gap = (x > 4.0) & (x < 4.1)
    # Its hull, of 0.17 m, touches no wall that is a pixel thicker than it was.
    assert np.abs(y[in_gap] - 1.525).max() + RADIUS_M - 0.01 <= 0.45 / 2
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert "shut_in" not in troubles(robot)
    covered = robot.mission.coverage()
    assert covered.covered == covered.coverable > 140


def test_without_a_way_it_waits_and_is_never_done():
    robot = shut_in(by=5)
    floor_m2 = LineRobot(room_with_niche(), START).mission.line.left.areas.asked_m2
    assert not robot.wait(400.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.state == "blocked"
    assert "shut in" in robot.mission.reason
    assert "shut_in" in troubles(robot)
    assert not robot.path
    # It does not call the floor swept that it cannot get to.
    floor = robot.mission.line.left.areas
    assert floor.asked_m2 > 0.9 * floor_m2
    assert floor.left_m2 > 0.5 * floor_m2
    # Once the way is open again, it goes on by itself.
    robot.show(room_with_niche())
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")


def test_a_shut_in_robot_that_gives_up_its_cells_is_not_done():
    """What it could not come to in the niche was given up, and with it all of the room."""
    robot = shut_in(by=5)
    for _ in range(5):
        robot.mission.orders.advance(robot.now)
    assert robot.mission.order_state.is_open
    robot.wait(10.0, lambda robot: False)
    assert robot.mission.state != "done"
    assert "shut in" in robot.mission.reason
    robot.show(room_with_niche())
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    covered = robot.mission.coverage()
    assert covered.covered == covered.coverable > 140


def test_in_the_gap_itself_it_drives_on_out():
    robot = shut_in(by=1, where=lambda robot: 4.02 < robot.x < 4.08)
    assert robot.wait(60.0, lambda robot: robot.x < 3.8)


def test_a_way_back_that_the_map_closes_is_withdrawn():
    robot = shut_in()
    assert robot.wait(60.0, lambda robot: "shut_in" in troubles(robot) and robot.path)
    robot.show(thicker(room_with_niche(), by=5))
    assert not robot.path
    assert robot.mission.state == "blocked"


def test_a_pause_stops_it_and_resume_leads_on():
    robot = shut_in()
    assert robot.wait(60.0, lambda robot: "shut_in" in troubles(robot) and robot.path)
    robot.command("pause")
    assert not robot.path
    assert robot.mission.state == "paused"
    robot.command("resume")
    assert robot.wait(30.0, lambda robot: robot.x < 3.8)


def test_no_way_leads_through_a_keep_out_zone():
    robot = shut_in()
    assert robot.wait(60.0, lambda robot: "shut_in" in troubles(robot) and robot.path)
    gap = ((3.9, 1.0), (4.1, 1.0), (4.1, 2.0), (3.9, 2.0))
    robot.command("keep_out_add", KeepOut("gap", gap))
    assert not robot.wait(60.0, lambda robot: robot.x < 4.2)
    assert not robot.path


def test_a_robot_stuck_on_its_way_out_retries_less_often():
    robot = shut_in()
    assert robot.wait(60.0, lambda robot: "shut_in" in troubles(robot) and robot.path)
    robot.is_stuck = True
    begun, drives = robot.now, []
    while robot.now < begun + 300.0:
        robot.show(thicker(room_with_niche(), by=1))
        if robot.path:
            drives.append(robot.now - begun)
    assert len(drives) < 1000  # of 3000 ticks
    assert max(drives) > 200.0


# A robot inside a wall of the map.


def room_with_corridor():
    """The same room, with a corridor 3 m long instead of the niche."""
    pixels = np.full((60, 146), 100, np.int8)
    pixels[1:59, 1:80] = 0
    pixels[26:35, 80:145] = 0
    return pixels


def inside_wall():
    """A robot 2 m deep in a corridor that the newest map shows as a wall."""
    robot = LineRobot(room_with_corridor(), START)
    assert robot.wait(600.0, lambda robot: robot.x > 6.9)
    pixels = room_with_corridor()
    pixels[1:59, 98:] = 100
    robot.show(pixels)
    return robot


def test_a_robot_inside_a_wall_is_a_trouble_until_it_is_out():
    robot = inside_wall()
    assert not robot.wait(19.0, troubles)
    assert robot.wait(2.0, lambda robot: troubles(robot) == {"shut_in"})
    assert "pose or map is off" in robot.mission.troubles[0].text
    robot.command("pause")
    assert not troubles(robot)
    robot.command("resume")
    assert not robot.wait(19.0, troubles)
    robot.show(room_with_corridor())
    assert robot.wait(2.0, lambda robot: robot.path)
    assert "shut_in" not in troubles(robot)


def test_a_way_out_that_ends_at_a_border_leads_into_the_cell():
    """It was a millimetre long, and the robot stood for ever: it can go on from the next cell."""
    robot = LineRobot(room_with_niche(), START)
    robot.wait(5.0, lambda robot: False)
    mission, way_out = robot.mission, robot.mission._executive.way_out
    cell = mission.map.cell_at_pose()
    stand = mission.map.ground.place_of(cell)
    # The track led here from behind a wall that was not there.
    way_out._track.clear()
    way_out._track.extend([(10.0, 10.0), (robot.x + 0.001, robot.y)])
    way = way_out._find(lambda area: area.contains(cell))
    assert tuple(way[-1]) == stand
    assert len(way) == 3
