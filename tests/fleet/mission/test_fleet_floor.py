"""The floor of a fleet: swept wherever the path leads, along the line that was polished."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.layer import MANY_TAKEN
from fasaco_edge.fleet.mission.message import path_ahead
from fasaco_edge.judge.floor import judge_floor
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived, MemberReceived, Part, State
from tests.fleet.mission.test_fleet import tiles_of
from tests.grid.test_floor import room
from tests.mission.test_line import CELL_M, CONFIG, RADIUS_M, ROBOT, Robot, shifted

# Where along an edge its distance to a place is measured.
SHARES = np.linspace(0.0, 1.0, 21)


def divided_by(member, number):
    """A robot that stands in the corner, and gives all that is left to itself."""
    parts = (Part("r1", (5, 9), 1e6, 1.0), Part(member, (5, 10), 0.0, 1.0))
    return MemberReceived(
        robot=member,
        frame="map",
        state="covering",
        x=0.3,
        y=0.3,
        epoch=1,
        division=number,
        tiles=(),
        ground=(),
        by=member,
        parts=parts,
        radius_m=RADIUS_M,
        ahead=(),
        waits_for="",
    )


def test_a_robot_without_a_part_sweeps_missed_floor_of_another():
    grid = room(4.5, 3.5)
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(grid))
    for number in range(1, 2000):
        if robot.mission.state is State.DONE:
            break
        robot.tell(divided_by("r2", number))
        robot.drive(is_checked=False)
    figures = judge_floor(grid, np.array([*robot.trail, robot.at]), ROBOT).figures
    assert figures.swept_share > 0.9


def test_a_polished_line_survives_the_wait_for_another_robot():
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    robot.drive(60)
    while math.dist(robot.at, path_ahead(robot.mission)[1]) > 2 * CELL_M:
        robot.drive()
    before = {tuple(point) for point in robot.mission.line._ahead.xy().tolist()}
    x, y = path_ahead(robot.mission)[1].tolist()
    in_the_way = replace(divided_by("r2", 0), state="done", parts=(), by="", x=x, y=y)
    robot.tell(in_the_way)
    assert robot.mission.giving_way.waits_for == "r2"
    assert not robot.line
    for _ in range(10):
        robot.tell(replace(in_the_way, x=x + 100.0))
    assert robot.mission.giving_way.waits_for == ""
    assert len(before & {tuple(point) for point in robot.line}) > 0.6 * len(before)
    robot.drive(20)


def test_a_yielding_robot_does_not_cross_its_cell_centre_first():
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    robot.drive(40)
    while math.dist(robot.at, path_ahead(robot.mission)[1]) > 2 * CELL_M:
        robot.drive()
    x, y = path_ahead(robot.mission)[1].tolist()
    in_the_way = replace(divided_by("r2", 0), state="done", parts=(), by="", x=x, y=y)
    robot.tell(in_the_way)
    assert robot.mission.giving_way.waits_for == "r2"
    # Beside the middle of its cell, on the side of the other robot.
    (here_x, here_y), apart = robot.at, math.dist(robot.at, (x, y))
    robot.at = tuple(a + 0.3 * CELL_M * (b - a) / apart for a, b in ((here_x, x), (here_y, y)))
    over = ((here_x, here_y), (2 * here_x - x, 2 * here_y - y))
    robot.tell(replace(in_the_way, state="covering", ahead=over))
    assert "makes way for r2" in robot.reasons[-1]
    begin, *_, end = robot.line
    assert len(robot.line) == 2
    assert math.dist(end, (x, y)) > math.dist(begin, (x, y))


def test_a_robot_leaves_the_rest_of_a_line_without_open_floor():
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    alone = replace(divided_by("r2", 0), parts=(), by="")
    robot.tell(alone)
    # Fewer are no reason for another path at once.
    while robot.mission.orders.cells.left() > MANY_TAKEN - 1:
        robot.drive(is_checked=False)
    assert len(robot.line) > 5
    robot.tell(replace(alone, tiles=tiles_of(product(range(-2, 30), range(-2, 30)))))
    robot.drive(4, is_checked=False)
    assert robot.mission.state is State.DONE


def nearest_to(line, place):
    """Return the least distance of a line to a place."""
    points = [a + (b - a) * share for a, b in pairwise(np.array(line)) for share in SHARES]
    return min(math.dist(point, place) for point in points)


@pytest.mark.parametrize("toward", range(12))
def test_a_yielding_robot_comes_no_nearer_to_a_close_one(toward):
    # Both stood in a doorway for good: straight to its refuge meant into the other's side.
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    robot.drive(150)
    angle, apart = toward * math.tau / 12, 2 * RADIUS_M + 0.01
    x, y = robot.at[0] + apart * math.cos(angle), robot.at[1] + apart * math.sin(angle)
    over = ((robot.at[0] - 0.3 * (x - robot.at[0]), robot.at[1] - 0.3 * (y - robot.at[1])),)
    other = replace(divided_by("r2", 0), parts=(), by="", x=x, y=y, ahead=over)
    for _ in range(12):
        if robot.mission.giving_way.waits_for != "r2" or not robot.line:
            robot.now += 1.0
            robot.tell(other)
    assert robot.mission.giving_way.waits_for == "r2"
    assert len(robot.line) > 1
    assert nearest_to(robot.line, (x, y)) >= apart - 1e-6
    # Others are told where it goes, not of the path that it has set aside.
    assert math.dist(path_ahead(robot.mission)[-1], robot.line[-1]) < CELL_M
    robot.reasons.clear()
    for _ in range(6):
        robot.now += 0.3
        robot.tell(other)
    assert "line polished" not in robot.reasons
    for by_m in (0.012, 0.006):
        robot.tell(MapReceived(shifted(room(4.5, 3.5), by_m)))
        assert nearest_to(robot.line, (x, y)) >= apart - 1e-6
