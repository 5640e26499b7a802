"""What a follower meets says nothing of the building: not that it is another, nor that it moved."""

from __future__ import annotations

import math

import numpy as np

from fasaco_edge.mission.events import CommandReceived, FollowerBlocked
from fasaco_edge.mission.orders.order import read_order
from tests.mission.line_robot import LineRobot
from tests.mission.test_path_begins import two_rooms


def all_round(robot):
    """A follower that says it meets something wherever it looks."""
    angles = np.linspace(0.0, 6.2, 20).tolist()
    points = tuple((robot.x + 0.4 * math.cos(a), robot.y + 0.4 * math.sin(a)) for a in angles)
    return FollowerBlocked(0, "obstacle", 5.0, "map", robot.x, robot.y, points)


def test_a_robot_that_is_crowded_keeps_its_ledger():
    robot = LineRobot(two_rooms(is_open=True), (1.0, 1.0))
    robot.wait(45.0, lambda _: False)
    covered = robot.mission.covered.current.total
    for _ in range(1000):
        robot.step(*([all_round(robot)] if robot.path and round(10 * robot.now) % 10 == 0 else []))
        assert robot.mission.covered.current.total >= covered, robot.mission.reason
        assert "another building" not in robot.mission.reason
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.coverage().remaining == 0


def test_an_order_that_begins_in_a_crowd_is_not_done_in_it():
    robot = LineRobot(two_rooms(is_open=True), (1.0, 1.0))
    robot.wait(30.0, lambda _: False)
    robot.step(all_round(robot))
    for tick in range(700):
        robot.step(*([all_round(robot)] if robot.path and tick % 10 == 0 else []))
    order = read_order({"return_home": True})
    robot.step(CommandReceived(1, "start", order, discard=True))
    for tick in range(600):
        robot.step(*([all_round(robot)] if robot.path and tick % 10 == 0 else []))
        assert robot.mission.state != "done"
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.coverage().remaining == 0
