"""A way that only leads somewhere: with few corners, and priced as it is driven."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.grid.fine_raster import RobotDiscs, raster_to_map
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.core.charging import LINE_FACTOR
from fasaco_edge.mission.line.laying import lay
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.way import corners_between, is_clear_between, way_s
from fasaco_edge.planners.line import LineConfig
from tests.follow.closed_loop import CONFIG, ClosedLoop

ROBOT = RobotConfig(
    radius_m=CONFIG.robot_radius_m,
    speed_m_s=CONFIG.speed_m_s,
    turn_deg_s=math.degrees(CONFIG.turn_rad_s),
    turn_deg_s2=math.degrees(CONFIG.turn_acceleration_rad_s2),
    acceleration_m_s2=CONFIG.acceleration_m_s2,
)
HOME = Pose2D(2.0, -2.4)


@pytest.fixture(scope="module")
def flat():
    truth = read_map(find_map("flat"))
    cell_m = ROBOT.tool_width_m * (1.0 - ROBOT.overlap)
    footprint = Footprint(cell_m, ROBOT.radius_m)
    plain = CoverageLattice.from_map(truth, footprint)
    discs = RobotDiscs(ROBOT.radius_m, ROBOT.tool_width_m)
    floor = FloorMap(truth, plain, footprint, discs, 10_000_000)
    lattice = floor.stands.lattice
    area = ReachableArea.around(lattice, anchor_cell(lattice, HOME))
    first = np.array((lattice.window.row0, lattice.window.col0))
    cells = np.argwhere(area.reachable) + first
    return truth, floor, area, [tuple(cell) for cell in cells.tolist()]


def laid(floor, area, cell):
    """The walk home from a cell, the line along it, and the pose where it begins."""
    walk = area.shortest_path(cell, anchor_cell(area.lattice, HOME))
    stand = floor.stands.stand(walk[0])
    pose = Pose2D(*raster_to_map(floor.geometry, stand[None])[0].tolist(), 0.5)
    ahead = LineAhead(floor)
    lay(ahead, walk, pose, keeps=False)
    return walk, ahead, pose


def test_a_way_has_few_corners_and_its_straight_parts_are_clear(flat):
    _, floor, area, cells = flat
    counts = []
    for cell in cells[::7]:
        walk, ahead, _ = laid(floor, area, cell)
        points, numbers = ahead.line.points, ahead.line.cells
        assert all(is_clear_between(floor, *edge) for edge in pairwise(points))
        assert (np.diff(numbers) >= 0).all()
        assert np.array_equal(points[-1], floor.stands.stand(walk[-1]))
        counts.append((len(points), len(floor.stands.line(walk)[0])))
    few, raw = np.mean(counts, axis=0)
    assert few < 0.6 * raw


@pytest.mark.parametrize("number", [40, 150, 290, -1])
def test_the_follower_drives_it_in_the_time_that_it_is_priced_at(flat, number):
    truth, floor, area, cells = flat
    walk, ahead, pose = laid(floor, area, cells[number])
    priced_s = way_s(
        walk, pose, floor, Sweeping(0.3, 10_000_000, LineConfig(turning=ROBOT.turning()))
    )
    loop = ClosedLoop(truth, pose)
    loop.send(ahead.xy())
    home = ahead.xy()[-1]
    took_s = loop.run(lambda: math.dist((loop.world.pose.x, loop.world.pose.y), home) < 0.05)
    assert took_s < LINE_FACTOR * priced_s
    assert took_s > 0.7 * priced_s - 5.0


def test_a_way_leads_round_what_is_between_two_places(flat):
    _, floor, area, cells = flat
    rng = np.random.default_rng(4)
    found = 0
    for number in rng.permutation(len(cells))[:200].tolist():
        row, col = cells[number]
        other = row + 2, col + 3
        a, b = (floor.stands.stands_of(np.array([cell]))[0] for cell in (cells[number], other))
        if not area.contains(other) or is_clear_between(floor, a, b):
            continue
        corners = corners_between(floor, a, b)
        points = np.stack([a, *corners, b])
        if len(corners):
            assert all(is_clear_between(floor, *edge) for edge in pairwise(points))
            found += 1
    assert found > 5


def test_there_is_no_way_to_nowhere_nor_far_away(flat):
    _, floor, _, cells = flat
    here = floor.stands.stand(np.array(cells[0]))
    assert not len(corners_between(floor, here, np.array([np.nan, np.nan])))
    assert not len(corners_between(floor, here, here + 1000.0))
