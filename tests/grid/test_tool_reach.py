"""A tool wider than the robot reaches nothing through walls, on the floor map and for the judge."""

import numpy as np
import pytest

from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.kernels.floor.bits import unpacked

PIXEL_M, RADIUS_M = 0.05, 0.2


def two_rooms():
    """Two closed rooms of 2 m x 2 m, between them a wall of one pixel."""
    cells = np.zeros((42, 83), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[:, 41] = 100
    return OccupancyGrid(GridGeometry(42, 83, PIXEL_M, Pose2D(0.0, 0.0, 0.0)), cells)


def seen_from(floor, tool_m):
    """Which pixels lie within the tool of a place, in sight of it: by brute force."""
    free = ~unpacked(floor.blocked, floor.geometry.cols)
    places = np.argwhere(unpacked(floor.places, floor.geometry.cols))
    reach = tool_m / 2 / floor.geometry.resolution
    seen = np.zeros(free.shape, bool)
    for row, col in np.argwhere(free):
        near = places[np.hypot(*(places - (row, col)).T) <= reach]
        for place in near[:: max(len(near) // 8, 1)]:
            way = np.linspace((row, col), place, 2 * int(reach) + 2)
            if free[tuple(np.rint(way).astype(int).T)].all():
                seen[row, col] = True
                break
    return seen, free


@pytest.mark.parametrize("tool_m", [0.5, 1.2])
def test_all_that_is_in_sight_and_nothing_that_is_not_free(tool_m):
    floor = Floor.around(two_rooms(), RobotDiscs(RADIUS_M, tool_m), (1.0, 1.0))
    seen, free = seen_from(floor, tool_m)
    assert not (floor.reachable & ~free).any()
    assert not (seen & ~floor.reachable).any()
    # The other room is behind the wall: all of this one, and no more.
    assert floor.reachable_m2 == pytest.approx(4.0, abs=0.02)


def test_a_tool_within_the_robot_is_a_disc_as_before():
    floor = Floor.around(two_rooms(), RobotDiscs(RADIUS_M, 0.3), (1.0, 1.0))
    assert floor.reachable_m2 == pytest.approx(1.9 * 1.9, abs=0.05)


def test_the_floor_map_has_the_same_in_any_window():
    grid, footprint = two_rooms(), Footprint(1.1, RADIUS_M)
    plain = CoverageLattice.from_map(grid, footprint)
    floor = FloorMap(grid, plain, footprint, RobotDiscs(RADIUS_M, 1.2), 1_000_000)
    every = np.ones(floor.stands.lattice.states.shape, bool)
    whole = floor.reached(every, Window(0, 0, floor.geometry.rows, floor.geometry.cols))
    assert np.count_nonzero(whole) * floor.geometry.resolution**2 == pytest.approx(8.0, abs=0.05)
    for row0, col0 in ((0, 0), (17, 40), (30, 90)):
        part = Window(row0, col0, row0 + 40, col0 + 50)
        inside = whole[part.row0 : part.row1, part.col0 : part.col1]
        assert (floor.reached(every, part) == inside).all()


def test_the_judge_counts_no_floor_behind_walls():
    line = np.array([(0.3, 0.3), (1.75, 0.3), (1.75, 1.75), (0.3, 1.75), (0.3, 1.0), (1.0, 1.0)])
    robot = SweepingRobot(tool_m=1.2, radius_m=RADIUS_M)
    figures = judge_floor(two_rooms(), line, robot).figures
    assert figures.reachable_m2 == pytest.approx(4.0, abs=0.02)
    assert figures.swept_m2 == pytest.approx(4.0, abs=0.02)
    # Nor what it sweeps of the room next door, which it can come to by a door.
    grid = two_rooms()
    cells = grid.cells.copy()
    cells[30:41, 41] = 0
    ways = np.array([(1.75, 0.3), (1.75, 0.4)])
    beside = judge_floor(OccupancyGrid(grid.geometry, cells), ways, robot)
    col = int((2.1 - beside.geometry.origin.x) / beside.geometry.resolution)
    assert beside.reachable[:, col + 1 :].any()
    assert not beside.swept[:, col + 1 :].any()
