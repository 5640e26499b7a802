"""Passed cells: their floor stays a robot's, whoever's part they lie in, but is not driven to."""

from __future__ import annotations

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.mission_ledger import MOST_PASSED, PassedCells


def test_a_cell_is_kept_until_its_floor_is_swept():
    cells = PassedCells()
    cells.add((3, 5))
    assert cells.next(9) == [(3, 5)]
    assert cells.inside(Window(3, 5, 4, 6)).all()
    cells.drop((3, 5))
    assert cells.next(9) == []
    assert not cells.inside(Window(0, 0, 9, 9)).any()


def test_passed_cells_are_checked_in_turn_and_bounded():
    cells = PassedCells()
    for col in range(MOST_PASSED + 5):
        cells.add((0, col))
    seen = [cells.next(500)[0][1] for _ in range(5)]
    assert seen == [5, 505, 1005, 1505, 5]
