"""Cells off the robot's way whose floor is worth less than the way there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.daemon.loop.status import floor_report
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.events import MapReceived
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.line.asides import MOST_CELLS, marked, not_worth_the_way
from fasaco_edge.planners.line import LineConfig
from tests.mission.test_line import CONFIG, Robot

# A step takes 2 s, a quarter-turn 1 s; a square metre is worth 100 s.
LINE = LineConfig(price_s_m2=100.0, speed_m_s=0.25, quarter_turn_s=1.0)
CELL_M = 0.5
ORIGIN = 7, -20


def left_over(asides, goals, m2, shape=(3, 30), line=LINE, walls=()):
    """Return which cells of a corridor are left, each with so much floor, from (0, 0)."""
    free = np.ones(shape, bool)
    for cell in walls:
        free[cell] = False
    row0, col0 = ORIGIN
    window = Window(row0, col0, row0 + shape[0], col0 + shape[1])
    plain = CoverageLattice.from_free(free, CELL_M)
    lattice = replace(plain, window=window)

    def mask(cells):
        return marked(np.array([(row + row0, col + col0) for row, col in cells]), window)

    found = not_worth_the_way(
        lattice, mask(asides), mask(goals), lambda cells: m2 * len(cells), line
    )
    return sorted((row - row0, col - col0) for row, col in found)


def test_a_cell_is_left_where_the_way_takes_longer_than_its_floor_is_worth():
    # 0.24 m2 are worth 24 s: 4 s for turns, 20 for five steps there and five back.
    assert left_over([(1, 15)], [(1, 10)], 0.24) == []
    assert left_over([(1, 15)], [(1, 9)], 0.24) == [(1, 15)]
    assert left_over([(1, 15)], [(1, 10)], 0.239) == [(1, 15)]
    # Straight on, but a wall is between: round it there are seven steps.
    wall = [(0, 12), (1, 12)]
    assert left_over([(1, 15)], [(1, 10)], 0.24, walls=wall) == [(1, 15)]
    assert left_over([(1, 15)], [(1, 10)], 0.32, walls=wall) == []
    # What is worth less than the turns is left, however near.
    assert left_over([(1, 15)], [(1, 14)], 0.03) == [(1, 15)]


def test_cells_that_hang_together_are_worth_going_to_together():
    pair = [(1, 15), (1, 16)]
    assert left_over(pair, [(1, 10)], 0.12) == []
    assert left_over(pair, [(1, 9)], 0.12) == pair
    many = [(1, 15 + number) for number in range(MOST_CELLS + 1)]
    assert left_over(many, [(1, 0)], 0.0) == []
    # What is not worth it alone may be beside something that the robot comes to.
    assert left_over([(1, 12), *[(1, 15 + number) for number in range(7)]], [(1, 0)], 0.17) == []


def test_cells_beyond_the_window_are_no_goals():
    window = Window(0, 0, 2, 2)
    cells = np.array([(0, 1), (-1, 0), (2, 1), (1, -1)])
    assert np.argwhere(marked(cells, window)).tolist() == [[0, 1]]


def building(recess=None):
    """Return a hall of 9 by 1.2 m; a recess, 0.4 m wide and 0.3 m deep, at a place [pixels]."""
    cells = np.full((40, 190), 100, np.int8)
    cells[4:28, 4:184] = 0
    if recess is not None:
        cells[28:34, recess : recess + 8] = 0
    return OccupancyGrid(GridGeometry(40, 190, 0.05, Pose2D(0.0, 0.0)), cells)


def reveal_far_away(price_s_m2):
    """Let a robot sweep the hall, and then see a recess at the other end of it.

    Returns:
        the robot, done; how near it came to the recess afterwards [m].
    """
    line = replace(CONFIG.sweeping.line, price_s_m2=price_s_m2)
    sweeping = replace(CONFIG.sweeping, line=line)
    robot = Robot(Mission(replace(CONFIG, sweeping=sweeping)), at=(1.0, 0.8))
    robot.tell(MapReceived(building()))
    while len(robot.mission.route.path.ahead) > 6:
        robot.drive()
    recess = 10 if robot.at[0] > 4.5 else 170
    robot.tell(MapReceived(building(recess)))
    driven = len(robot.trail)
    robot.finish()
    at = (recess + 4) * 0.05
    return robot, min(abs(x - at) for x, _ in [*robot.trail[driven:], robot.at])


def test_a_recess_that_a_map_shows_far_off_is_left_unless_it_is_worth_the_way():
    robot, nearest_m = reveal_far_away(200.0)
    assert nearest_m > 3.0
    told = floor_report(robot.mission)
    assert told.left[0].reason == "beside the path, and not worth the way"
    assert told.left[0].m2 > 0.05
    assert robot.mission.coverage().remaining == 0
    robot, nearest_m = reveal_far_away(3000.0)
    assert nearest_m < 0.2
