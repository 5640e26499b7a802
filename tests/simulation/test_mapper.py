"""The robot's own map: what it scanned, no more and no less."""

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.simulation.mapper import Mapper
from fasaco_edge.simulation.robot import SimulationConfig
from tests.simulation.rooms import RESOLUTION, building


def placed_in(truth, snapshot):
    """The snapshot's cells in the truth's raster, -1 where it does not reach."""
    origin = snapshot.geometry.origin
    col, row = truth.geometry.to_pixels(origin.x, origin.y)
    col, row = round(col), round(row)
    whole = np.full(truth.cells.shape, -1, np.int8)
    whole[row : row + snapshot.geometry.rows, col : col + snapshot.geometry.cols] = snapshot.cells
    return whole


@pytest.mark.parametrize("yaw", [0.0, 0.3, -2.0])
@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_one_scan_of_a_closed_room_shows_its_floor_and_walls(yaw, turned):
    truth = building(3, 3, origin=Pose2D(1.0, 2.0, turned))
    mapper = Mapper(truth, SimulationConfig())
    assert mapper.snapshot(0) is None
    mapper.scan(Pose2D(*truth.geometry.to_map(1.43 / RESOLUTION, 1.56 / RESOLUTION), yaw))
    known = placed_in(truth, mapper.snapshot(7))
    assert mapper.snapshot(7).stamp_ns == 7
    assert (known[1:-1, 1:-1] == 0).all()
    for face in (known[0, 1:-1], known[-1, 1:-1], known[1:-1, 0], known[1:-1, -1]):
        assert (face == 100).all()


def test_pixels_beyond_walls_or_range_are_unknown():
    truth = building(12, 6, (3.0, 0.0, 3.1, 6.0))
    config = SimulationConfig(range_m=2.0)
    mapper = Mapper(truth, config)
    mapper.scan(Pose2D(2.0, 3.0))
    known = placed_in(truth, mapper.snapshot(0))
    rows, cols = np.nonzero(known != -1)
    assert cols.max() == round(3.0 / RESOLUTION)
    # The nearest point of each known pixel lies within range.
    dx = np.maximum(np.abs((cols + 0.5) * RESOLUTION - 2.0) - RESOLUTION / 2, 0)
    dy = np.maximum(np.abs((rows + 0.5) * RESOLUTION - 3.0) - RESOLUTION / 2, 0)
    assert np.hypot(dx, dy).max() <= config.range_m + 1e-9
    # And every free pixel in sight whose centre is within range is known.
    row, col = np.indices(truth.cells.shape)
    centre = np.hypot((col + 0.5) * RESOLUTION - 2.0, (row + 0.5) * RESOLUTION - 3.0)
    in_sight = (centre <= config.range_m) & (truth.cells == 0) & (col < 60)
    assert (known[in_sight] == 0).all()


def test_the_map_grows_with_the_robot_and_stays_true():
    truth = building(12, 6, (5.0, 1.0, 5.1, 5.0), origin=Pose2D(-3.3, -0.7))
    mapper = Mapper(truth, SimulationConfig(map_chunk_m=0.5))
    origins, sizes, before = set(), set(), None
    for x in np.arange(8.0, -2.5, -0.5):
        mapper.scan(Pose2D(float(x), 0.3))
        snapshot = mapper.snapshot(0)
        origins.add(snapshot.geometry.origin)
        sizes.add(snapshot.cells.shape)
        known = placed_in(truth, snapshot)
        assert (known[known != -1] == truth.cells[known != -1]).all()
        if before is not None:
            assert (known[before != -1] == before[before != -1]).all()
        before = known
    assert len(origins) > 5
    assert len(sizes) > 5


def test_the_ground_under_the_robot_is_known_even_without_sight():
    truth = building(4, 4)
    config = SimulationConfig(range_m=0.01)
    mapper = Mapper(truth, config)
    mapper.scan(Pose2D(2.0, 2.0))
    known = placed_in(truth, mapper.snapshot(0))
    area = np.count_nonzero(known == 0) * RESOLUTION**2
    assert area >= math.pi * config.hull_radius_m**2


def test_a_way_is_clear_only_over_known_free_ground():
    mapper = Mapper(building(8, 4, (3.0, 0.0, 3.1, 2.0)), SimulationConfig(range_m=3.0))
    mapper.scan(Pose2D(2.0, 1.0))
    assert mapper.is_clear((2.0, 1.0), (2.0, 3.0))
    assert not mapper.is_clear((2.0, 1.0), (4.0, 1.0))  # through the wall
    assert not mapper.is_clear((2.0, 1.0), (2.0, 3.9))  # into it
    assert not mapper.is_clear((2.0, 3.0), (6.0, 3.0))  # out of what is known


def test_no_corner_fits_between_checked_places_on_a_coarse_map():
    # A robot joined its path so, beside a wall in pixels of 0.15 m, and stood for good.
    cells = np.zeros((12, 12), np.int8)
    cells[5, 5] = 100
    truth = OccupancyGrid(GridGeometry(12, 12, 0.15, Pose2D(0.0, 0.0)), cells)
    mapper = Mapper(truth, SimulationConfig(robot_radius_m=0.135, padding_m=0.01))
    along, corner = np.array((1.0, -1.0)) / math.sqrt(2.0), np.array((0.75, 0.75))
    for apart_m, is_clear in ((0.124, False), (0.126, True)):
        nearest = corner - apart_m / math.sqrt(2.0)
        begin, end = nearest - 0.0375 * along, nearest + 0.1125 * along
        mapper.scan(Pose2D(*begin))
        assert mapper.is_clear(tuple(begin), tuple(end)) == is_clear
