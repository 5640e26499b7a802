"""Left floor: a robot of a fleet comes back once to the cells that it passed with floor unswept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.core.events import MapReceived, State
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.coverage.left_floor import MOST_PASSED, LeftFloor
from tests.grid.test_floor import room
from tests.mission.test_fleet_floor import divided_by
from tests.mission.test_line import CELL_M, CONFIG, Robot

CELL = (3, 5)


def test_a_cell_that_it_came_back_to_is_never_looked_at_again():
    floor = LeftFloor()
    floor.note_passed(CELL)
    assert floor.next(9) == [CELL]
    floor.note_left(CELL, is_left=True)
    assert floor.left_in(Window(3, 5, 4, 6)).all()
    for _ in range(3):
        floor.note_passed(CELL)
        assert floor.next(9) == []
        assert not floor.left_in(Window(0, 0, 9, 9)).any()


def test_a_cell_that_a_whole_path_did_not_lead_back_to_is_given_up():
    floor = LeftFloor()
    floor.note_passed(CELL)
    floor.note_left(CELL, is_left=True)
    floor.note_path_end()
    assert floor.left == {CELL}
    floor.note_path_end()
    assert floor.left == set()
    floor.note_passed(CELL)
    assert floor.next(9) == []


def test_what_another_line_sweeps_is_no_longer_left_and_may_be_left_again():
    floor = LeftFloor()
    floor.note_passed(CELL)
    for is_left in (True, False, True):
        floor.note_left(CELL, is_left=is_left)
        assert floor.left == ({CELL} if is_left else set())
        assert floor.passed_in(Window(3, 5, 4, 6)).all()


def test_cells_are_looked_at_in_turn_and_no_more_are_kept_than_there_is_room_for():
    floor = LeftFloor()
    for col in range(MOST_PASSED + 5):
        floor.note_passed((0, col))
    seen = [floor.next(500)[0][1] for _ in range(5)]
    assert seen == [5, 505, 1005, 1505, 5]


def around(cell):
    """The floor of a cell, as a mask function."""

    def inside(window):
        rows = (np.arange(window.row0, window.row1) + 0.5) * PIXEL_M // CELL_M == cell[0]
        cols = (np.arange(window.col0, window.col1) + 0.5) * PIXEL_M // CELL_M == cell[1]
        return rows[:, None] & cols

    return inside


@pytest.mark.parametrize("is_again", [False, True], ids=["once", "each-time"])
def test_floor_left_in_a_passed_cell_is_swept_and_one_that_stays_unswept_holds_nobody_up(is_again):
    robot = Robot(Mission(replace(CONFIG, robot="r1")))
    robot.mission.shared.begin(1)
    robot.tell(MapReceived(room(4.5, 3.5)))
    robot.tell(replace(divided_by("r2", 0), parts=(), by=""))
    robot.drive(40, is_checked=False)
    (cell, *_) = (
        cell
        for cell in robot.mission.covered.left_floor.next(100)
        if robot.mission.ledger.has_visited(cell)
    )
    robot.mission.floor.forget(around(cell))
    for _ in range(2000):
        if robot.mission.state is State.DONE:
            break
        robot.drive(is_checked=False)
        if is_again:
            robot.mission.floor.forget(around(cell))
    assert robot.mission.state is State.DONE
    row, col = (round((number + 0.5) * CELL_M / PIXEL_M) for number in cell)
    swept = robot.mission.floor.swept_in(Window(row - 3, col - 3, row + 3, col + 3))
    assert is_again or swept.all()
