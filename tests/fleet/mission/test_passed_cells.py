"""Passed cells in a fleet: their floor stays this robot's where the cell becomes another's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.events import MapReceived, State
from tests.fleet.mission.test_fleet_floor import divided_by
from tests.grid.test_floor import room
from tests.mission.test_line import CELL_M, CONFIG, Robot


def around(cell):
    """The floor of a cell, as a mask function."""

    def inside(window):
        rows = (np.arange(window.row0, window.row1) + 0.5) * PIXEL_M // CELL_M == cell[0]
        cols = (np.arange(window.col0, window.col1) + 0.5) * PIXEL_M // CELL_M == cell[1]
        return rows[:, None] & cols

    return inside


def begun():
    """A robot, r1, that has passed cells of a room beside another one; and one of those."""
    robot = Robot(Mission(CONFIG, kind=FleetKind("r1")))
    robot.mission.covered.shared.begin_epoch(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    robot.tell(replace(divided_by("r2", 0), parts=(), by=""))
    robot.drive(40, is_checked=False)
    passed = robot.mission.covered.passed.next(100)
    return robot, next(cell for cell in passed if robot.mission.ledger.has_visited(cell))


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
