"""The line of a mission on maps and with robots that nobody would wish for."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.daemon.loop.loader import mission_config
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.processes import peak_mb
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.kernels.floor.sweeps import NEVER
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import CommandReceived, MapReceived, State
from fasaco_edge.mission.line.laying import lay, lay_blocked
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import NO_EDGES, POLISHED, edges_between
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.grid.test_floor import room
from tests.mission.test_line import (
    CONFIG,
    RADIUS_M,
    ROBOT,
    Robot,
    assert_clear,
    robot_on,
    with_obstacle,
)

PIXEL_M = 0.05


def grid_of(free, origin=(0.0, 0.0)):
    """Return a map of pixels that are free or occupied."""
    pixels = np.where(free, 0, 100).astype(np.int8)
    return OccupancyGrid(GridGeometry(*pixels.shape, PIXEL_M, Pose2D(*origin)), pixels)


def finish(grid, at, config=CONFIG):
    """Let a robot carry a mission out; return its figures and the mission."""
    robot = robot_on(grid, at=at, config=config)
    assert_clear(robot, grid)
    robot.finish()
    return judge_floor(grid, np.array([*robot.trail, robot.at]), ROBOT).figures, robot.mission


@pytest.mark.parametrize("tool_m", [0.17, 0.5])
def test_a_tool_much_narrower_or_wider_than_the_robot(tool_m):
    grid = room(2.4, 1.8)
    cell_m = tool_m * 0.92
    sweeping = Sweeping(tool_m, 1_000_000, CONFIG.sweeping.line)
    config = replace(CONFIG, footprint=Footprint(cell_m, RADIUS_M), sweeping=sweeping)
    robot = robot_on(grid, config=config)
    robot.finish()
    tool = SweepingRobot(tool_m, RADIUS_M, 0.25, 1.5)
    figures = judge_floor(grid, np.array(robot.trail), tool).figures
    assert figures.swept_share > 0.95
    assert figures.illegal_share == 0.0


def test_a_lane_too_narrow_for_the_robot_is_not_driven():
    free = np.zeros((40, 80), np.bool_)
    free[20, 4:76] = True
    robot = robot_on(grid_of(free), at=(2.0, 1.025))
    assert robot.mission.state is State.BLOCKED
    assert "too close" in robot.mission.reason
    assert not robot.line


def lane():
    """A lane that is as wide as the robot."""
    free = np.zeros((40, 80), np.bool_)
    free[16:24, 4:76] = True
    return free


def round_hall():
    """A building with no straight wall."""
    y, x = np.mgrid[:90, :110]
    angle = np.arctan2(y - 45, x - 55)
    free = np.hypot(y - 45, x - 55) < 32 + 6 * np.sin(3 * angle + 1)
    return free & (np.hypot(y - 50, x - 60) > 8)


def thin_walls():
    """Walls of single pixels."""
    free = np.zeros((66, 90), np.bool_)
    free[1:-1, 1:-1] = True
    free[1:50, 30] = free[20:-1, 60] = False
    free[40, 70] = False
    return free


@pytest.mark.parametrize(
    ("free", "at", "swept"),
    [(lane(), (2.0, 1.0), 0.9), (round_hall(), (1.9, 2.2), 0.95), (thin_walls(), (0.8, 0.8), 0.95)],
    ids=["a free lane as wide as the robot", "no straight wall", "walls of single pixels"],
)
def test_an_odd_building_is_swept_and_no_wall_is_touched(free, at, swept):
    figures, mission = finish(grid_of(free), at)
    assert figures.swept_share > swept
    assert figures.illegal_share == 0.0
    assert "every reachable cell" in mission.reason


def test_a_map_that_turns_by_a_degree_with_each_message():
    grid = room(3.0, 2.4)
    robot = robot_on(grid)
    origin, turned = grid.geometry.origin, grid
    for degrees in range(1, 7):
        robot.drive(8)
        yaw = math.radians(degrees % 4)
        geometry = replace(grid.geometry, origin=replace(origin, yaw=yaw))
        turned = OccupancyGrid(geometry, grid.cells)
        robot.tell(MapReceived(turned))
        if robot.line:
            assert_clear(robot, turned)
    robot.tell(MapReceived(grid))
    robot.finish()
    assert_clear(robot, grid)
    assert robot.mission.line.left.areas.left_m2 < 0.5


@pytest.mark.parametrize("far_m", [8_000.0, 900_000.0])
def test_a_map_that_jumps_far_and_back_needs_no_more_memory(far_m):
    """As when SLAM begins anew: no line is sought in all that lies between."""
    near = room(2.4, 1.8)
    geometry = near.geometry
    origin = Pose2D(geometry.origin.x + far_m, geometry.origin.y - far_m)
    far = OccupancyGrid(replace(geometry, origin=origin), near.cells)
    robot = robot_on(near, 5)
    before_mb, (x, y) = peak_mb(os.getpid()), robot.at
    robot.at = (x + far_m, y - far_m)
    robot.tell(MapReceived(far))
    robot.drive(5)
    robot.at = (x, y)
    robot.tell(MapReceived(near))
    assert peak_mb(os.getpid()) < before_mb + 100.0
    robot.finish()


def test_a_robot_beside_a_long_line_gets_a_line_that_leaves_it():
    """Of the line that both walks begin with, only its first point was left, and it is passed."""
    grid = grid_of(np.ones((120, 120), bool))
    footprint = Footprint(0.25, 0.12)
    plain = CoverageLattice.from_map(grid, footprint)
    ahead = LineAhead(FloorMap(grid, plain, footprint, RobotDiscs(0.12, 0.27), 10_000_000))
    straight = [(2, col) for col in range(2, 20)]
    lay(ahead, np.array(straight, np.int32), Pose2D(0.625, 0.625), keeps=False)
    aside = Pose2D(0.9, 3.0)
    ahead.drive(aside)
    turns_off = [*straight[:15], *((row, 16) for row in range(3, 9))]
    lay(ahead, np.array(turns_off, np.int32), aside)
    assert ahead.xy()[0].tolist() == pytest.approx([aside.x, aside.y])
    assert ahead.xy()[-1].tolist() == pytest.approx([16.5 * 0.25, 8.5 * 0.25], abs=0.03)


# Lanes to and fro over rows 2 to 11 of a hall.
LANES = [(row, col) for row in range(2, 12) for col in range(2, 20)[:: 1 - row % 2 * 2]]


def polished_line(grid):
    """A line along the lanes, as if polished, and the floor under it."""
    footprint = Footprint(0.25, 0.12)
    plain = CoverageLattice.from_map(grid, footprint)
    floor = FloorMap(grid, plain, footprint, RobotDiscs(0.12, 0.27), 10_000_000)
    ahead = LineAhead(floor)
    lay(ahead, np.array(LANES, np.int32), Pose2D(0.625, 0.625))
    ahead.mark(0, len(ahead.line), POLISHED)
    return ahead, floor


@pytest.mark.parametrize("until", [4, 26, 60])
def test_the_line_beyond_a_cut_is_kept_for_the_next_plan(until):
    ahead, _ = polished_line(grid_of(np.ones((120, 120), bool)))
    whole, here = ahead.line.points.tolist(), Pose2D(0.625, 0.625)
    lay(ahead, np.array(LANES[:until], np.int32), here, is_cut=True)
    assert ahead.is_cut
    assert len(ahead.line) < len(whole)
    assert ahead.line.cells[-1] < until
    last, behind = LANES[until - 1], LANES[until + 3]
    (row, _), cols = last, range(last[1], behind[1], 1 if behind[1] > last[1] else -1)
    round_it = [(row - 1, col) for col in [*cols, behind[1]]]
    lay(ahead, np.array([*LANES[:until], *round_it, *LANES[until + 3 :]], np.int32), here)
    assert not ahead.is_cut
    kept = [point for point in whole if point in ahead.line.points.tolist()]
    assert len(kept) >= len(whole) - 2
    assert np.count_nonzero(ahead.line.state < POLISHED) <= 10


def test_a_line_ends_at_a_cut_that_stays():
    ahead, _ = polished_line(grid_of(np.ones((120, 120), bool)))
    lay(ahead, np.array(LANES[:40], np.int32), Pose2D(0.625, 0.625), is_cut=True)
    ahead.end_at_cut()
    assert not ahead.is_cut
    counts, line = ahead.tally.sweeps.counts.copy(), ahead.line.points
    ahead.tally.exchange(edges_between(line), NO_EDGES)
    assert set(np.unique(ahead.tally.sweeps.counts)) == {NEVER}
    assert counts.max() > NEVER


def test_lanes_between_two_blocked_lanes_are_kept():
    """It was laid anew, with all the lanes between."""
    free = np.ones((120, 120), bool)
    ahead, floor = polished_line(before := grid_of(free))
    whole = ahead.line.points.tolist()
    for row in (3, 10):
        free[5 * row + 1 : 5 * row + 4, 55:58] = False
    blocked = grid_of(free)
    floor.change((before, blocked), CoverageLattice.from_map(blocked, Footprint(0.25, 0.12)))
    ahead.follow_floor(floor)
    assert lay_blocked(ahead, floor.touched)
    kept = [point for point in whole if point in ahead.line.points.tolist()]
    assert kept == whole
    assert np.count_nonzero(ahead.line.state == POLISHED) >= len(whole) - 6


def test_a_robot_that_does_not_fit_is_led_out_once_for_all_maps():
    """Each map put one more step before the one before, to and fro."""
    free = np.ones((60, 60), bool)
    free[:, :4] = False
    grid, footprint = grid_of(free), Footprint(0.25, 0.12)
    plain = CoverageLattice.from_map(grid, footprint)
    floor = FloorMap(grid, plain, footprint, RobotDiscs(0.12, 0.27), 10_000_000)
    whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
    ahead, beside_wall = LineAhead(floor), Pose2D(0.3, 0.9)
    lay(ahead, np.array([(row, 1) for row in range(3, 9)], np.int32), beside_wall)
    line = ahead.line.points.tolist()
    for off_m in (0.03, 0.0, 0.03, 0.0):
        # Poses scatter while it stands there.
        ahead.drive(Pose2D(beside_wall.x, beside_wall.y + off_m))
        assert not lay_blocked(ahead, whole)
    assert ahead.line.points.tolist() == line


def test_without_its_last_keep_out_the_whole_floor_is_swept():
    """All but the floor of the keep-out counted as swept: cells were covered in passing."""
    grid = room(3.0, 2.4)
    robot = Robot(Mission(CONFIG))
    for _ in range(2):
        robot.tell(MapReceived(grid))
    asked_m2 = robot.mission.line.left.areas.asked_m2
    polygon = ((3.6, 2.2), (3.9, 2.2), (3.9, 2.5), (3.6, 2.5))
    for number, name in enumerate(("keep_out_add", "keep_out_remove")):
        keep_out = KeepOut("vase", polygon if name == "keep_out_add" else ())
        robot.tell(CommandReceived(number, name, keep_out=keep_out))
        is_less = robot.mission.line.left.areas.asked_m2 < asked_m2
        assert is_less == (name == "keep_out_add")
    assert robot.mission.line.left.areas.asked_m2 == asked_m2
    robot.finish()
    figures = judge_floor(grid, np.array([*robot.trail, robot.at]), ROBOT).figures
    assert figures.swept_share > 0.95


# Lines keep a clearance from walls and furniture, but for floor worth it.


CLEARANCE_M = 0.02


def driven(clearance_m):
    """Return the room, and the way that a robot has driven in it until its mission was done."""
    grid = with_obstacle(room(3.0, 2.4), 28, 30, 2)
    sweeping = replace(CONFIG.sweeping, clearance_m=clearance_m)
    robot = robot_on(grid, config=replace(CONFIG, sweeping=sweeping))
    robot.finish()
    return grid, np.array(robot.trail)


def near_share(grid, trail):
    """Return the share of points of a way without clearance, but for a rounding."""
    rows, cols = np.nonzero((grid.cells < 0) | (grid.cells > 25))
    near = 0
    for x, y in trail.tolist():
        col, row = grid.geometry.to_pixels(x, y)
        off = np.maximum(np.abs(np.stack([cols + 0.5 - col, rows + 0.5 - row])) - 0.5, 0.0)
        apart_m = np.hypot(*off).min() * grid.geometry.resolution
        near += apart_m < RADIUS_M + 0.75 * CLEARANCE_M
    return near / len(trail)


def test_a_mission_keeps_its_clearance_and_sweeps_nearly_all():
    (grid, without), (_, kept) = driven(0.0), driven(CLEARANCE_M)
    assert near_share(grid, kept) < 0.3 * near_share(grid, without)
    swept = [judge_floor(grid, trail, ROBOT).figures.swept_share for trail in (without, kept)]
    assert swept[1] > swept[0] - 0.04


def test_the_configured_clearance_is_that_of_the_mission():
    config = DaemonConfig(robot=RobotConfig(clearance_m=0.03))
    assert mission_config(config, NearOptimal()).sweeping.clearance_m == 0.03
