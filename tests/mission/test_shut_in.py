"""A robot that the map shuts in where it has just driven in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.mission.core.back_out import MOST_M, WAITS_S
from fasaco_edge.mission.core.events import FollowerBlocked
from fasaco_edge.mission.map.obstacles import CLOSED_S
from fasaco_edge.mission.orders.keep_outs import KeepOut
from tests.mission.line_robot import CONFIG, PIXEL_M, RADIUS_M, LineRobot

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


def test_where_there_is_no_way_it_waits_and_is_never_done():
    robot = shut_in(by=5)
    assert not robot.wait(400.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.state == "blocked"
    assert "shut in" in robot.mission.reason
    assert "shut_in" in troubles(robot)
    assert not robot.path
    # Once the way is open again, it goes on by itself.
    robot.show(room_with_niche())
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")


def test_a_shut_in_robot_that_gives_up_its_cells_is_not_done():
    """What it could not come to in the niche was given up, and with it all of the room."""
    robot = shut_in(by=5)
    for _ in range(5):
        robot.mission._orders.advance(robot.now)
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


def filled(pixels, from_m):
    """A map that is wrong: a wall from here on [m]."""
    pixels = pixels.copy()
    pixels[1:59, round(from_m / PIXEL_M) :] = 100
    return pixels


def inside_wall(room, where_m, from_m, config=CONFIG):
    """A robot that has come to some x [m], where the next map shows a wall."""
    robot = LineRobot(room, START, config)
    assert robot.wait(600.0, lambda robot: robot.x > where_m)
    robot.show(filled(room, from_m))
    return robot


def inside_niche(config=CONFIG):
    return inside_wall(room_with_niche(), 4.7, 4.2, config)


def inside_corridor():
    """A robot that is farther from floor than it may back out."""
    return inside_wall(room_with_corridor(), 6.9, 4.9)


def flickering(robot, wrong, seconds, until):
    """Show the robot maps that differ in a pixel each time; return whether something holds."""
    end, wrong = robot.now + seconds, wrong.copy()
    while robot.now < end and not until(robot):
        wrong[30, -2] ^= 100
        robot.show(wrong)
    return until(robot)


NICHE, CORRIDOR = filled(room_with_niche(), 4.2), filled(room_with_corridor(), 4.9)


def driven_m(track):
    return float(np.hypot(*np.diff(track, axis=0).T).sum())


def test_a_robot_inside_a_wall_of_the_map_backs_out():
    """The map, or the pose, was off by more than its radius: it waited for another for good."""
    robot = inside_niche()
    assert not robot.wait(WAITS_S - 1.0, lambda robot: robot.path)
    assert "occupied cell" in robot.mission.reason
    begun = robot.now
    assert robot.wait(20.0, lambda robot: robot.x < 4.1)
    assert robot.now - begun < 10.0
    robot.show(room_with_niche())
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    covered = robot.mission.coverage()
    assert covered.covered == covered.coverable > 140


def test_maps_without_a_way_do_not_stop_it_and_one_with_replaces_it():
    robot = inside_niche()
    assert flickering(robot, NICHE, WAITS_S + 1.0, lambda robot: robot.path)
    assert not flickering(robot, NICHE, 1.0, lambda robot: not robot.path)
    assert robot.x > 4.4
    robot.show(room_with_niche())
    assert robot.wait(1.0, lambda robot: "track" not in robot.paths[-1][2])
    assert robot.path


def test_out_of_a_wall_it_never_drives_forward_again():
    robot = inside_corridor()
    assert flickering(robot, CORRIDOR, WAITS_S + 1.0, lambda robot: robot.path)
    before, nearest = len(robot.paths), robot.x
    for _ in range(4):
        assert not flickering(robot, CORRIDOR, 1.0, lambda robot: not robot.path)
        robot.command("pause")
        robot.command("resume")
        assert flickering(robot, CORRIDOR, WAITS_S + 1.0, lambda robot: robot.path)
        assert robot.x < nearest - 0.15
        nearest = robot.x
    for _, xy, _ in robot.paths[before:]:
        assert (np.diff(xy[:, 0]) < 1e-6).all()


def test_a_rest_begins_its_wait_in_a_wall_anew():
    robot = inside_niche()
    assert not robot.wait(WAITS_S - 1.0, lambda robot: robot.path)
    robot.command("pause")
    robot.wait(30.0, lambda robot: False)
    robot.command("resume")
    assert not robot.wait(WAITS_S - 1.0, lambda robot: robot.path)
    assert robot.wait(2.0, lambda robot: robot.path)


def test_out_of_a_wall_it_touches_no_keep_out_zone():
    robot = inside_niche()
    zone = ((4.25, 1.0), (4.3, 1.0), (4.3, 2.0), (4.25, 2.0))
    robot.command("keep_out_add", KeepOut("strip", zone))
    assert robot.wait(WAITS_S + 1.0, lambda robot: robot.path)
    robot.wait(60.0, lambda robot: False)
    assert min(x for x, _ in robot.track[-600:]) >= 4.3 + RADIUS_M
    assert robot.x < 4.3 + RADIUS_M + 0.1
    assert not robot.path


def test_a_robot_in_a_keep_out_zone_alone_does_not_back_out():
    robot = LineRobot(room_with_niche(), START)
    assert robot.wait(600.0, lambda robot: robot.x > 4.7)
    niche = ((4.2, 1.0), (5.2, 1.0), (5.2, 2.0), (4.2, 2.0))
    robot.command("keep_out_add", KeepOut("niche", niche))
    assert not robot.wait(60.0, lambda robot: robot.path)


def test_where_it_backs_out_in_vain_it_stops_and_says_so():
    robot = inside_corridor()
    assert flickering(robot, CORRIDOR, WAITS_S + 1.0, lambda robot: robot.path)
    before = len(robot.track)
    flickering(robot, CORRIDOR, 120.0, lambda robot: False)
    assert MOST_M - 0.15 < driven_m(robot.track[before - 1 :]) <= MOST_M + 1e-6
    assert not robot.path
    assert "shut_in" in troubles(robot)
    assert "backed out" in robot.mission.troubles[0].text
    # Once the way is open again, it goes on by itself, and may back out again.
    robot.show(room_with_corridor())
    assert robot.wait(2.0, lambda robot: robot.path)
    assert "shut_in" not in troubles(robot)
    assert robot.wait(10.0, lambda robot: robot.x < 5.2)
    robot.show(filled(room_with_corridor(), 4.2))
    assert robot.wait(30.0, lambda robot: robot.x < 4.1)


def test_something_new_in_the_way_out_of_a_wall_holds_it():
    robot = inside_niche()
    thing = FollowerBlocked(0, "a box", 5.0, "map", robot.x, robot.y, ((robot.x - 0.3, robot.y),))
    robot.step(thing)
    assert not robot.wait(CLOSED_S - 1.0, lambda robot: robot.path)
    assert robot.wait(WAITS_S + 5.0, lambda robot: robot.path)
    robot.step(replace(thing, revision=robot.mission.route.revision))
    assert not robot.path


def test_a_robot_driven_out_of_a_wall_by_hand_has_that_track():
    robot = inside_corridor()
    assert flickering(robot, CORRIDOR, WAITS_S + 1.0, lambda robot: robot.path)
    robot.path, robot.is_stuck = [], True
    for _ in range(10):
        robot.y += 0.05
        robot.step()
    assert robot.wait(60.0, lambda robot: robot.path)
    assert {x for x, _ in robot.path} == {robot.x}
