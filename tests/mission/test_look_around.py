"""A robot whose first map shows hardly more than the place where it stands."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.mission.core.look_around import LOOK_S, WAITS
from fasaco_edge.planners.curve_config import CurveConfig
from tests.mission.line_robot import CONFIG, LineRobot
from tests.support.rooms import room

# In the middle of a cell; half the edge of a first scan's floor that holds this cell alone [m].
START, HALF_M = (2.07, 1.518), 0.25


ROOM = room(4.0, 3.0)


def first_scan(half_m=HALF_M):
    """The room before anything but a square around the robot is known."""
    pixels = np.full((60, 80), -1, np.int8)
    (col, row), half = (round(at / 0.05) for at in START), round(half_m / 0.05)
    pixels[row - half : row + half, col - half : col + half] = 0
    return pixels


def looked(robot):
    return [xy for _, xy, reason in robot.paths if reason.startswith("looks around")]


def test_it_turns_on_the_spot_and_sweeps_what_it_then_sees():
    robot = LineRobot(first_scan(), START)
    assert robot.mission.state == "covering"
    (xy,) = looked(robot)
    assert np.hypot(*(xy - START).T).max() < 0.05
    headings = np.arctan2(*np.diff(xy, axis=0).T[::-1])
    turns = [
        math.remainder(b - a, math.tau)
        for a, b in zip((0.0, *headings[:-1]), headings, strict=True)
    ]
    assert sum(turns) == pytest.approx(math.tau)
    robot.wait(5.0, lambda robot: False)
    robot.show(ROOM)
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.coverage().fraction == 1.0
    assert len(looked(robot)) == 1


def test_without_a_better_map_it_waits_and_is_never_done():
    robot = LineRobot(first_scan(), START)
    assert not robot.wait(300.0, lambda robot: robot.mission.state == "done")
    assert (robot.mission.state, robot.mission.reason) == ("blocked", WAITS)
    robot.show(ROOM)
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")


def test_on_unknown_ground_it_looks_around_too():
    robot = LineRobot(np.full((60, 80), -1, np.int8), START)
    assert len(looked(robot)) == 1
    robot.wait(LOOK_S + 1.0, lambda robot: False)
    assert robot.mission.state == "blocked"
    assert robot.mission.reason.startswith("robot is on unknown ground: waits for a map")


def test_a_pause_stops_the_turn():
    robot = LineRobot(first_scan(), START)
    robot.command("pause")
    assert not robot.path
    assert robot.mission.state == "paused"


def test_a_pose_that_jumps_ends_the_turn():
    robot = LineRobot(first_scan(), START)
    robot.is_stuck, robot.x = True, robot.x + 1.0
    robot.wait(1.0, lambda robot: False)
    assert not robot.path
    assert robot.mission.state == "blocked"


@pytest.mark.parametrize("why", ["obstacle", "cannot turn", "sees floor", "small room"])
def test_it_does_not_turn(why):
    pixels, config = first_scan(), CONFIG
    if why == "obstacle":
        pixels[30 + 4, 41 + 4] = 100
    elif why == "cannot turn":
        curves = CurveConfig(0.5, False, 0.25, 0.25, 1.0, 1.0)
        config = replace(CONFIG, sweeping=replace(CONFIG.sweeping, curves=curves))
    elif why == "sees floor":
        pixels = first_scan(0.9)
    else:
        # Its walls are far enough away for a turn.
        pixels = first_scan(0.3)
        pixels[pixels < 0] = 100
    assert not looked(LineRobot(pixels, START, config))
