"""The curve of a robot with a turning radius: drivable, free, worth it; judged by its points."""

import math

import numpy as np
import pytest

from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import MARGIN, STEP_M, curve_along

RADIUS_M, TOOL_M, TURN_M = 0.25, 0.4, 0.5
ROBOT = SweepingRobot(TOOL_M, RADIUS_M, 0.5, 1.0, turn_radius_m=TURN_M)
BOTH = CurveConfig(TURN_M, True, 0.5, 0.5, 1.0, 200.0)
AHEAD = CurveConfig(TURN_M, False, 0.5, 0.5, 1.0, 200.0)


def room(width_m, height_m, walls=(), yaw=0.0):
    """A room with its lower left corner at 0, 0, in a map at an angle, and walls (x0, y0, x1, y1)
    [m] in it."""
    cols, rows = round(width_m / 0.05) + 2, round(height_m / 0.05) + 2
    cells = np.zeros((rows, cols), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for x0, y0, x1, y1 in walls:
        col0, row0, col1, row1 = (round(at / 0.05) + 1 for at in (x0, y0, x1, y1))
        cells[row0:row1, col0:col1] = 100
    cos, sin = math.cos(yaw), math.sin(yaw)
    origin = Pose2D(-0.05 * (cos - sin), -0.05 * (sin + cos), yaw)
    return OccupancyGrid(GridGeometry(rows, cols, 0.05, origin), cells)


def lanes(width_m, height_m):
    """Lanes along x, from wall to wall, at the tool's width less an overlap."""
    left, right = 0.3, width_m - 0.3
    count = math.ceil((height_m - 0.6) / 0.36) + 1
    points = []
    for number, y in enumerate(np.linspace(0.3, height_m - 0.3, count)):
        points += [(left, y), (right, y)] if number % 2 == 0 else [(right, y), (left, y)]
    return np.array(points)


def curve_in(grid, line_xy, config, **more):
    discs = RobotDiscs(RADIUS_M, TOOL_M)
    floor = Floor.around(grid, discs, tuple(line_xy[0]))
    return curve_along(line_xy, floor, floor.reachable, config, **more)


def assert_drivable(curve, *, reverses):
    """Headings follow the ways, backward ones from behind, and turn no tighter than the radius."""
    ways = np.diff(curve.xy, axis=0)
    lengths = np.hypot(*ways.T)
    assert (lengths > 0.0).all()
    along = np.arctan2(ways[:, 1], ways[:, 0]) + np.pi * curve.is_backward
    turned = np.remainder(np.diff(curve.poses[:, 2]) + np.pi, 2.0 * np.pi) - np.pi
    middle = curve.poses[:-1, 2] + turned / 2
    # A bend up to a hundredth of a radian or two is steered.
    assert np.abs(np.remainder(along - middle + np.pi, 2.0 * np.pi) - np.pi).max() < 0.011
    # Of a chord; an arc is a little longer.
    assert (np.abs(turned) <= lengths / (MARGIN * TURN_M) * 1.001 + 1e-5).all()
    assert (lengths[np.abs(turned) > 1e-5] <= STEP_M + 1e-5).all()
    assert reverses or not curve.is_backward.any()


@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize(("config", "least_share"), [(BOTH, 0.95), (AHEAD, 0.75)])
def test_lanes_of_a_room_are_joined_by_arcs(config, least_share, yaw):
    grid, line_xy = room(6.0, 4.0, yaw=yaw), lanes(6.0, 4.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    line_xy = line_xy @ np.array([[cos, sin], [-sin, cos]])
    curve = curve_in(grid, line_xy, config)
    assert_drivable(curve, reverses=config.reverses)
    figures = judge_floor(grid, curve.xy, ROBOT).figures
    assert figures.illegal_share == 0.0
    assert figures.swept_share > least_share, figures
    assert (curve.spots, figures.spot_turns) == (0, 0)
    assert figures.reversals == curve.reversals
    assert (curve.reversals > 0) == config.reverses
    assert curve.xy[0] == pytest.approx(line_xy[0], abs=1e-6)


def test_it_drives_out_of_a_dead_end_backward():
    """A corridor 0.7 m wide: no room to turn about."""
    grid = room(6.0, 4.0, walls=[(3.0, 0.0, 6.0, 1.6), (3.0, 2.3, 6.0, 4.0)])
    line_xy = np.array([(1.5, 1.95), (5.7, 1.95), (1.5, 1.95), (1.5, 3.5)])
    curve = curve_in(grid, line_xy, BOTH)
    assert_drivable(curve, reverses=True)
    figures = judge_floor(grid, curve.xy, ROBOT).figures
    assert (figures.spot_turns, figures.illegal_share) == (0, 0.0)
    assert curve.poses[:, 0].max() > 5.6
    assert curve.backward_m > 2.0


def test_a_turn_that_does_not_fit_is_a_counted_spot_turn():
    """It stands in a dead end, and looks at its wall: only backward can it come out."""
    grid = room(6.0, 4.0, walls=[(3.0, 0.0, 6.0, 1.6), (3.0, 2.3, 6.0, 4.0)])
    line_xy = np.array([(5.7, 1.95), (1.5, 1.95), (1.5, 3.5)])
    curve = curve_in(grid, line_xy, AHEAD, start_yaw=0.0)
    assert (curve.spots, curve.backward_m) == (1, 0.0)
    curve = curve_in(grid, line_xy, BOTH, start_yaw=0.0)
    assert curve.spots == 0
    assert curve.backward_m > 2.0


def test_it_begins_with_the_heading_of_the_robot():
    grid, line_xy = room(6.0, 4.0), lanes(6.0, 4.0)
    line_xy[0] = 1.0, 0.3
    for yaw in (0.0, 2.0, math.pi):
        curve = curve_in(grid, line_xy, BOTH, start_yaw=yaw)
        assert_drivable(curve, reverses=True)
        assert math.remainder(curve.poses[0, 2] - yaw, math.tau) == pytest.approx(0.0, abs=1e-5)


def test_floor_that_is_worth_nothing_is_not_swept_by_detours():
    """With no price, corners are cut wherever that is quicker."""
    grid, line_xy = room(6.0, 4.0), lanes(6.0, 4.0)
    cheap = curve_in(grid, line_xy, CurveConfig(TURN_M, True, 0.5, 0.5, 1.0, 0.0))
    dear = curve_in(grid, line_xy, BOTH)
    shares = [judge_floor(grid, curve.xy, ROBOT).figures.swept_share for curve in (cheap, dear)]
    assert shares[0] < shares[1] - 0.02


@pytest.mark.parametrize("line_xy", [[(1.0, 1.0)], [(1.0, 1.0), (1.0, 1.0)]])
def test_a_line_of_one_point_is_a_curve_of_one_pose(line_xy):
    curve = curve_in(room(3.0, 3.0), np.array(line_xy), BOTH)
    assert curve.poses.shape == (1, 3)
    assert (curve.spots, curve.reversals, curve.backward_m) == (0, 0, 0.0)


def test_poses_on_the_line_name_its_points():
    """Points within a straight count, too: a piece of a longer line goes on behind them."""
    line_xy = np.array(
        [(0.5, 0.5), (1.5, 0.5), (1.5, 0.5), (3.0, 0.5), (5.0, 0.5), (5.0, 2.0), (5.0, 3.5)]
    )
    curve = curve_in(room(6.0, 4.0), line_xy, BOTH)
    on_line = np.flatnonzero(curve.legs >= 0)
    assert len(on_line) > 2
    for number in on_line.tolist():
        leg = int(curve.legs[number])
        (ax, ay), (bx, by) = line_xy[leg : leg + 2]
        x, y, _ = curve.poses[number]
        apart = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        assert apart == pytest.approx(0.0, abs=1e-4)
    # The next point of the line lies behind the pose.
    first = line_xy[curve.legs[on_line] + 1]
    assert (first.sum(axis=1) >= curve.xy[on_line].sum(axis=1) - 1e-6).all()
    assert set(curve.legs[on_line].tolist()) <= {3, 5}
