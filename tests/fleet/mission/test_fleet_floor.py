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
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.events import MapReceived, MemberReceived, Part, State
from tests.fleet.mission.test_fleet import tiles_of
from tests.grid.test_floor import room
from tests.mission.test_line import CELL_M, CONFIG, RADIUS_M, ROBOT, Robot, shifted

# Where along an edge its distance to a place is measured.
SHARES = np.linspace(0.0, 1.0, 21)


def divided_by(member, number):
    parts = (Part("r1", (5, 9), 1e6, 1.0), Part(member, (5, 10), 0.0, 1.0))
    return MemberReceived(
        robot=member,
        frame="map",
        state="covering",
        x=0.3,
        y=0.3,
        epoch=1,
        division=number,
        by=member,
        parts=parts,
        radius_m=RADIUS_M,
    )


def in_room():
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    return robot


def met(robot, steps):
    robot.drive(steps)
    while math.dist(robot.at, path_ahead(robot.mission)[1]) > 2 * CELL_M:
        robot.drive()
    x, y = path_ahead(robot.mission)[1].tolist()
    return replace(divided_by("r2", 0), state="done", parts=(), by="", x=x, y=y)


def test_a_robot_without_a_part_sweeps_missed_floor_of_another():
    robot, grid = in_room(), room(4.5, 3.5)
    for number in range(1, 2000):
        if robot.mission.state is State.DONE:
            break
        robot.tell(divided_by("r2", number))
        robot.drive(is_checked=False)
    figures = judge_floor(grid, np.array([*robot.trail, robot.at]), ROBOT).figures
    assert figures.swept_share > 0.9


def test_a_polished_line_survives_the_wait_for_another_robot():
    robot = in_room()
    in_the_way = met(robot, 60)
    before = {tuple(point) for point in robot.mission.line._ahead.xy().tolist()}
    robot.tell(in_the_way)
    assert robot.mission.giving_way.waits_for == "r2"
    assert not robot.line
    for _ in range(10):
        robot.tell(replace(in_the_way, x=100.0))
    assert robot.mission.giving_way.waits_for == ""
    assert len(before & {tuple(point) for point in robot.line}) > 0.6 * len(before)
    robot.drive(20)


def test_a_yielding_robot_does_not_cross_its_cell_centre_first():
    robot = in_room()
    in_the_way = met(robot, 40)
    x, y = in_the_way.x, in_the_way.y
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
    robot = in_room()
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
    points = [a + (b - a) * share for a, b in pairwise(np.array(line)) for share in SHARES]
    return min(math.dist(point, place) for point in points)


@pytest.mark.parametrize("toward", range(12))
def test_a_yielding_robot_comes_no_nearer_to_a_close_one(toward):
    # Both stood in a doorway for good: straight to its refuge meant into the other's side.
    robot = in_room()
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


def around(cell):
    def inside(window):
        rows = (np.arange(window.row0, window.row1) + 0.5) * PIXEL_M // CELL_M == cell[0]
        cols = (np.arange(window.col0, window.col1) + 0.5) * PIXEL_M // CELL_M == cell[1]
        return rows[:, None] & cols

    return inside


def begun():
    robot = in_room()
    robot.tell(replace(divided_by("r2", 0), parts=(), by=""))
    robot.drive(40, is_checked=False)
    passed = robot.mission.covered.passed.next(100)
    return robot, next(cell for cell in passed if robot.mission.covered.current.has_visited(cell))


def test_floor_of_a_passed_cell_stays_with_the_robot_that_passed():
    unswept_m2 = []
    for is_left in (False, True):
        robot, cell = begun()
        if is_left:
            robot.mission.covered.floor.forget(around(cell))
        for number in range(1, 9):
            robot.tell(replace(divided_by("r2", number), x=0.3 + 0.2 * (number % 2)))
            robot.drive(is_checked=False)
        assert robot.mission.company.part_cells() == 0
        to_sweep = robot.mission.line.left.areas
        unswept_m2.append(to_sweep.ahead_m2 + to_sweep.left_m2)
    assert unswept_m2[1] - unswept_m2[0] > 0.5 * CELL_M**2


def test_unswept_floor_in_a_passed_cell_does_not_delay_others():
    robot, cell = begun()
    for _ in range(2000):
        if robot.mission.state is State.DONE:
            break
        robot.drive(is_checked=False)
        robot.mission.covered.floor.forget(around(cell))
    assert robot.mission.state is State.DONE
