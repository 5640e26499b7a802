"""The line of a mission that sweeps floor: driven to its end, through maps that change."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import PASSED as PASSED_BY
from fasaco_edge.daemon.loop.mission_reports import floor_report, unswept
from fasaco_edge.grid import floor_map
from fasaco_edge.grid.fine_raster import raster_to_map
from fasaco_edge.grid.geometry import Pose2D, StampedPose, Window
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.kernels.floor.open_floor import CAUSE, CAUSE_SHIFT, OPEN, PASSED, SWEPT, WANTED
from fasaco_edge.kernels.floor.sweeps import NEVER
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.events import CommandReceived, MapReceived, PlanReady, PoseReceived, State
from fasaco_edge.mission.line.polisher import AHEAD_M
from fasaco_edge.mission.line.polyline import POLISHED
from fasaco_edge.mission.line.tally import SweepTally
from fasaco_edge.mission.line.unswept import OUT_OF_REACH, Unswept
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.wire.documents.replies import FloorReport
from tests.grid.test_floor import room
from tests.support.grids import cropped

TOOL_M, RADIUS_M, CELL_M = 0.3, 0.18, 0.276
ROBOT = SweepingRobot(TOOL_M, RADIUS_M, 0.25, 1.5)
CONFIG = MissionConfig(
    Footprint(CELL_M, RADIUS_M),
    cost=CoverageCost.for_robot(CELL_M, 0.25, 1.5),
    sweeping=Sweeping(TOOL_M, 1_000_000, LINES["thorough"]),
)
START = (2.6, 1.6)
STEP_M = 0.08


@dataclass
class Robot:
    """A robot that drives exactly along its line, a step at a time."""

    mission: Mission
    at: tuple[float, float] = START
    now: float = 0.0
    clock_speed: float = 0.0
    line: list[tuple[float, float]] = field(default_factory=list)
    trail: list[tuple[float, float]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)

    def tell(self, *events, times=1):
        for _ in range(times - 1):
            self.tell()
        pose = StampedPose(Pose2D(*self.at), "map", round(1e9 * self.clock_speed * self.now))
        decision = self.mission.step([*events, PoseReceived(pose)], self.now)
        for _ in range(4):
            assert not decision.faults
            if decision.path is not None:
                self.reasons.append(decision.path.reason)
                assert decision.path.xy is not None
                self.line = [tuple(point) for point in decision.path.xy.tolist()]
            if decision.plan is None:
                break
            limit = WorkLimit(SearchWork(proposals=20_000))
            path = NearOptimal().plan(decision.plan.problem, limit)
            decision = self.mission.step([PlanReady(decision.plan.number, path, 0.0)], self.now)

    def drive(self, steps=1, *, is_checked=True):
        for _ in range(steps):
            left = STEP_M
            self.trail.append(self.at)
            while self.line and left > 0.0:
                ahead = math.dist(self.at, self.line[0])
                if ahead <= left:
                    self.at, left = self.line.pop(0), left - ahead
                    self.trail.append(self.at)
                else:
                    (x, y), (to_x, to_y), share = self.at, self.line[0], left / ahead
                    self.at, left = (x + share * (to_x - x), y + share * (to_y - y)), 0.0
            self.now += 0.3
            self.tell()
            if is_checked:
                check_tally(self.mission)

    def finish(self, most=4000):
        for number in range(most):
            if self.mission.state is State.DONE:
                return
            # What is counted wrong stays so: to count it takes half of the time of a drive.
            self.drive(is_checked=number % 8 == 0)
        raise AssertionError(f"still {self.mission.state}: {self.mission.reason}")


def robot_on(grid, steps=0, *, at=START, config=CONFIG):
    """A robot that has got its first line over a map, and has driven so many steps."""
    robot = Robot(Mission(config), at=at)
    robot.tell(MapReceived(grid))
    robot.drive(steps)
    return robot


def check_tally(mission):
    """What is counted is what a fresh count of the line ahead gives."""
    ahead = mission.line._ahead
    if ahead is None:
        return
    fresh = SweepTally(ahead.floor)
    swept = mission.covered.floor.swept_on(ahead.floor.geometry)
    whole = Window(0, 0, *swept.shape)
    state, points = ahead.tally._state, ahead.whole.points  # beyond a cut, too
    # Without a reachable area no floor is asked for, and all is looked at once there is one.
    assert mission.line.left._asked is None or (((state & SWEPT) > 0) == swept).all()
    fresh._state |= state & PASSED
    fresh.set_open(whole, (state & WANTED) > 0, swept)
    edges = np.concatenate([points[:-1], points[1:]], axis=1)
    fresh.exchange(edges[:0], edges)
    counts = ahead.tally.sweeps.counts
    # Of what is done with, how often is of no interest.
    assert ((counts >= NEVER // 2) == (fresh.sweeps.counts >= NEVER // 2)).all()
    still_open = counts < NEVER // 2
    assert (counts[still_open] == fresh.sweeps.counts[still_open]).all()
    left = (counts == 0).astype(int)
    padded = np.zeros([size * 8 for size in ahead.tally.sweeps.left.shape], int)
    padded[: left.shape[0], : left.shape[1]] = left
    high, wide = ahead.tally.sweeps.left.shape
    tally = ahead.tally
    assert tally._wanted_pixels == np.count_nonzero(state & WANTED)
    assert tally._open_pixels == np.count_nonzero(state & OPEN)
    for cause in OUT_OF_REACH:
        pixels = np.count_nonzero((state & np.uint8(CAUSE)) >> CAUSE_SHIFT == cause)
        assert tally._beyond_pixels[cause] == pixels
    blocks = padded.reshape(high, 8, wide, 8).sum(axis=(1, 3))
    assert (blocks == ahead.tally.sweeps.left).all()


def with_obstacle(grid, row, col, size=6, value=100):
    cells = grid.cells.copy()
    cells[row : row + size, col : col + size] = value
    return OccupancyGrid(grid.geometry, cells)


def shifted(grid, by_m):
    origin = replace(grid.geometry.origin, x=grid.geometry.origin.x + by_m)
    return OccupancyGrid(replace(grid.geometry, origin=origin), grid.cells)


def test_a_pose_that_jumps_within_reach_searches_nothing():
    """Each of a burst searched the whole lattice, and compared it with itself."""
    robot = robot_on(room(3.0, 2.4))
    area, robot.at = robot.mission.map.area, (START[0] + 1.5, START[1])
    robot.tell()
    assert area is not None
    assert robot.mission.map.area is area
    assert not area.change_since(area)


def test_a_room_is_swept_to_its_rim():
    grid = room(3.0, 2.4)
    robot = robot_on(grid)
    robot.finish()
    judged = judge_floor(grid, np.array(robot.trail), ROBOT)
    centres = 1.0 - (2 * 0.15 * (3.0 + 2.4)) / (3.0 * 2.4)
    assert judged.figures.swept_share > max(0.97, centres)
    assert judged.figures.illegal_share == 0.0
    assert robot.mission.covered.floor.swept_m2 <= judged.swept.sum() * 0.025**2 * 1.005
    told = floor_report(robot.mission)
    assert told.reachable_m2 == pytest.approx(judged.figures.reachable_m2, rel=0.01)
    assert told.reached_m2 == pytest.approx(judged.figures.swept_m2, rel=0.01)
    assert {left.reason for left in told.left} == {
        PASSED_BY,
        "beside the path, and not worth the way",
    }
    # Of walls a pixel thinner the tool would reach a rim of a pixel more, but in free pixels only.
    rim_m2 = told.possible_m2 - told.reachable_m2
    assert 0.02 * 2 * (3.0 + 2.4) < rim_m2 < 0.05 * 2 * (3.0 + 2.4)
    swept = f"{told.reached_m2:.1f} of {told.reachable_m2:.1f} m2 of floor swept"
    thinner = f"or of {told.possible_m2:.1f} m2 if walls are a pixel thinner than on the map"
    assert f"{swept}, {thinner}" in robot.mission.reason


def test_the_line_ahead_is_timed_and_bounded_from_below():
    grid, robot = room(3.0, 2.4), Robot(Mission(CONFIG))
    assert robot.mission.line.ahead() is None
    robot.tell(MapReceived(grid))
    robot.drive(3)
    line = robot.mission.line.ahead()
    # What is farther ahead than the published changes counts, too.
    ahead = robot.mission.line._ahead.xy()
    judged = judge_floor(grid, np.array([robot.at, *ahead]), ROBOT).figures
    assert line.seconds == pytest.approx(judged.seconds, rel=0.02)
    assert 0.8 * judged.least_s < line.least_s < judged.least_s
    assert line.gap == pytest.approx(line.seconds / line.least_s - 1.0)
    robot.finish()
    assert robot.mission.line.ahead().gap is None


def test_the_time_of_a_long_segment_runs_down():
    robot = robot_on(room(4.8, 2.4))
    while math.dist(robot.at, START) < 1.5:
        robot.drive(is_checked=False)
    robot.tell(CommandReceived(1, "home"))
    times = [robot.mission.line.ahead().seconds]
    while robot.mission.state is not State.PAUSED:
        robot.drive(is_checked=False)
        times.append(robot.mission.line.ahead().seconds)
    assert times[0] > 1.5 / 0.25
    drives_s = STEP_M / 0.25
    assert np.diff(times)[2:15] == pytest.approx(-drives_s, abs=0.1 * drives_s)
    assert times[-1] < drives_s


def test_the_status_says_what_of_the_floor_is_left_and_why():
    robot = Robot(Mission(CONFIG))
    assert floor_report(robot.mission) == FloorReport(0.0)
    robot.tell(MapReceived(room(3.0, 2.4)))
    robot.drive(10)
    told = floor_report(robot.mission)
    assert told.possible_m2 is None, "the order is not over"
    left = {left.reason: left.m2 for left in told.left}
    assert "beside the path, and not worth the way" in left
    assert left["on the path"] > 10 * left["beside the path, and not worth the way"]
    assert told.reached_m2 == pytest.approx(told.swept_m2, abs=0.02)
    assert told.reachable_m2 == pytest.approx(told.reached_m2 + sum(left.values()), abs=0.002)


def test_after_a_restart_floor_left_by_a_finished_order_has_its_reasons():
    grid = room(3.0, 2.4)
    robot = robot_on(grid)
    robot.finish()
    before = {left.reason for left in floor_report(robot.mission).left}
    again = Robot(Mission(CONFIG), at=robot.at)
    again.mission.restore(robot.mission.snapshot(), robot.mission.order_state)
    again.tell(MapReceived(grid))
    assert {left.reason for left in floor_report(again.mission).left} == before


def test_no_floor_is_not_worth_the_way_before_the_first_path():
    mission = Mission(CONFIG)
    pose = PoseReceived(StampedPose(Pose2D(*START), "map"))
    mission.step([MapReceived(room(3.0, 2.4)), pose], 0.0)
    assert [left.reason for left in floor_report(mission).left] == ["not planned yet"]


def test_the_rest_of_an_order_is_pending_while_the_robot_is_home():
    robot = robot_on(room(3.0, 2.4), 10)
    robot.tell(CommandReceived(1, "home"))
    reasons = []
    while robot.mission.state is not State.PAUSED:
        robot.drive(is_checked=False)
        reasons += [left.reason for left in floor_report(robot.mission).left]
    assert [left.reason for left in floor_report(robot.mission).left] == ["to come", PASSED_BY]
    assert "beside the path, and not worth the way" not in reasons


def why_unswept(mission, x, y):
    """Return why the floor at x, y [m] is not swept; all areas are those of the status."""
    grid, told = unswept(mission), floor_report(mission)
    pixels = np.bincount(grid.cells.ravel(), minlength=len(Unswept) + 1) * 0.025**2
    assert sum(left.m2 for left in told.left) == pytest.approx(pixels[4:].sum(), abs=0.002)
    beyond = sum(left.m2 for left in told.out_of_reach)
    assert beyond == pytest.approx(pixels[1:4].sum(), abs=0.002)
    col, row = (int(at) for at in grid.geometry.to_pixels(x, y))
    return Unswept(grid.cells[row, col])


def test_the_status_says_what_floor_is_out_of_reach_and_why():
    # A closet without a door and a gap between two shelves, and a zone in the far corner.
    grid = room(4.8, 2.4)
    cells = grid.cells.copy()
    cells[:, 80] = 100
    cells[2:30, 20], cells[2:30, 25] = 100, 100
    grid = OccupancyGrid(grid.geometry, cells)
    robot = robot_on(grid, at=(4.6, 2.6))
    zone = [[5.0, 1.0], [5.9, 1.0], [5.9, 1.9], [5.0, 1.9]]
    robot.tell()
    told = floor_report(robot.mission)
    judged = judge_floor(grid, np.array([robot.at]), ROBOT)
    free_m2 = float((cells == 0).sum()) * 0.05**2
    beyond = {left.reason.split(",")[0].split(":")[0]: left.m2 for left in told.out_of_reach}
    assert sum(beyond.values()) == pytest.approx(free_m2 - judged.figures.reachable_m2, rel=0.01)
    closet = judge_floor(grid, np.array([(6.4, 2.2)]), ROBOT).figures.reachable_m2
    assert why_unswept(robot.mission, 6.4, 2.2) is Unswept.CLOSED
    assert why_unswept(robot.mission, *grid.geometry.to_map(23.5, 16.0)) is Unswept.NARROW
    assert why_unswept(robot.mission, 5.4, 1.4) is Unswept.AHEAD
    assert beyond["closed off"] == pytest.approx(closet, rel=0.01)
    assert beyond["too narrow for the robot"] > 28 * 4 * 0.05**2
    robot.tell(CommandReceived(1, "start", read_order({"keep_out": [zone]})))
    robot.tell()
    kept = floor_report(robot.mission)
    more = {left.reason.split(",")[0].split(":")[0]: left.m2 for left in kept.out_of_reach}
    assert more["too narrow for the robot"] == beyond["too narrow for the robot"]
    assert more["closed off"] == beyond["closed off"]
    # The zone lies in the corner; what is too near to it counts, too.
    assert 0.75 < more["in a keep-out zone"] < 1.05
    assert why_unswept(robot.mission, 5.4, 1.4) is Unswept.KEPT_OUT
    # Each is told in whole thousandths.
    left_m2 = told.reachable_m2 - more["in a keep-out zone"]
    assert kept.reachable_m2 == pytest.approx(left_m2, abs=0.0015)


def test_the_line_avoids_a_new_keep_out_at_once():
    robot = robot_on(room(4.8, 2.4), 20)
    covered, swept_m2 = robot.mission.coverage().covered, robot.mission.covered.floor.swept_m2
    assert covered > 3
    corners = ((4.2, 2.0), (4.7, 2.0), (4.7, 2.5), (4.2, 2.5))
    robot.tell(CommandReceived(1, "keep_out_add", keep_out=KeepOut("column", corners)))
    began = len(robot.trail)
    assert robot.mission.coverage().covered >= covered
    assert robot.mission.covered.floor.swept_m2 >= swept_m2
    robot.finish()
    for x, y in robot.trail[began:]:
        assert not (4.2 < x < 4.7 and 2.0 < y < 2.5)
    assert robot.mission.coverage().remaining == 0


def test_floor_behind_a_new_keep_out_is_not_hidden_by_thick_walls():
    robot = robot_on(room(4.8, 2.4), 5)
    fence = KeepOut("fence", ((4.4, 0.0), (4.5, 0.0), (4.5, 9.0), (4.4, 9.0)))
    robot.tell(CommandReceived(1, "keep_out_add", keep_out=fence))
    robot.finish()
    told = floor_report(robot.mission)
    assert sum(left.m2 for left in told.out_of_reach) > 2.0
    assert told.possible_m2 - told.reachable_m2 < 1.0
    assert "not reached: closed off by a keep-out zone" in robot.mission.reason


def test_unreachable_floor_follows_map_growth_and_zone_orders():
    whole = room(4.8, 2.4)
    cells = whole.cells.copy()
    cells[:, 80] = 100
    cells[20:30, 80] = 0  # a door
    shut = cells.copy()
    shut[:, 80] = 100
    hidden = shut.copy()
    hidden[:, 60:] = -1
    last = robot_on(OccupancyGrid(whole.geometry, shut), at=(3.0, 2.0))
    last.tell()
    robot = Robot(Mission(CONFIG), at=(3.0, 2.0))
    zone = {"name": "left", "polygon": [[2.0, 1.0], [4.0, 1.0], [4.0, 3.4], [2.0, 3.4]]}
    robot.tell(
        MapReceived(OccupancyGrid(whole.geometry, hidden)),
        CommandReceived(1, "start", read_order({"zones": [zone]})),
    )
    robot.drive(3)
    for seen in (cells, shut):
        robot.tell(MapReceived(OccupancyGrid(whole.geometry, seen)))
        robot.drive(3)
    assert floor_report(robot.mission).out_of_reach == floor_report(last.mission).out_of_reach


@pytest.mark.parametrize("chunk", [64, 1])
def test_maps_that_grow_and_change_on_the_way(chunk, monkeypatch):
    """In small chunks of pixels the floor's raster moves with most of them."""
    monkeypatch.setattr(floor_map, "CHUNK", chunk)
    whole = with_obstacle(room(3.6, 3.0), 24, 30)
    rng = np.random.default_rng(3)
    robot = robot_on(cropped(whole, 0, 0, 36, 40))
    (rows, cols), truth = whole.cells.shape, whole
    for number in range(14):
        robot.drive(int(rng.integers(2, 9)))
        if number % 3 == 2:
            place = truth.geometry.to_pixels(*robot.at)
            row, col = rng.integers(4, rows - 6), rng.integers(4, cols - 6)
            if abs(row - place[1]) + abs(col - place[0]) > 16:
                truth = with_obstacle(truth, row, col, 3, int(rng.choice([0, 100])))
        low, high = rng.integers(0, 6, 2), (rows - rng.integers(0, 5), cols - rng.integers(0, 5))
        robot.tell(MapReceived(cropped(truth, *low.tolist(), *(int(each) for each in high))))
        check_tally(robot.mission)
        assert_clear(robot, truth)
    robot.tell(MapReceived(truth))
    robot.finish()
    assert judge_floor(truth, np.array(robot.trail), ROBOT).figures.swept_share > 0.95


def test_lines_begin_at_a_robot_slightly_off_its_line():
    """Its disc may touch a wall then, by a pixel; the line begins beside it all the same."""
    whole, off_m = with_obstacle(room(3.6, 3.0), 24, 30), 0.02
    rng = np.random.default_rng(3)
    seen = np.array((36, 40))
    robot = robot_on(cropped(whole, 0, 0, *seen.tolist()))
    for _ in range(60):
        robot.drive(2)
        on_line, turn = robot.at, rng.uniform(0.0, math.tau)
        robot.at = (on_line[0] + off_m * math.cos(turn), on_line[1] + off_m * math.sin(turn))
        seen = np.minimum(seen + rng.integers(0, 3, 2), whole.cells.shape)
        told = len(robot.reasons)
        robot.tell(MapReceived(cropped(whole, 0, 0, *seen.tolist())))
        if len(robot.reasons) > told and robot.line:
            assert math.dist(robot.line[0], robot.at) < 2 * off_m
        robot.at = on_line
    assert len(robot.reasons) > 5


def assert_clear(robot, grid, most_m=2.4):
    """No point of the next metres comes nearer to what is not free than the robot's radius."""
    blocked = np.argwhere(grid.cells != 0) + 0.5
    geometry = grid.geometry
    points = np.array([robot.at, *robot.line])
    for a, b in pairwise(points):
        length_m = math.dist(a, b)
        most = min(most_m / max(length_m, 1e-9), 1.0)
        for share in np.linspace(0.0, most, max(int(most * length_m / 0.02), 1)):
            col, row = geometry.to_pixels(*(a + share * (b - a)))
            off = np.abs(blocked - (row, col)) - 0.5
            nearest = np.hypot(*np.clip(off, 0.0, None).T).min() * geometry.resolution
            assert nearest > RADIUS_M - 1e-3
        most_m -= length_m
        if most_m <= 0.0:
            return


def test_a_new_obstacle_is_driven_round_at_once():
    grid = room(3.0, 2.4)
    robot = robot_on(grid, 12)
    x, y = robot.line[min(6, len(robot.line) - 1)]
    col, row = (int(each) for each in grid.geometry.to_pixels(x, y))
    if math.dist((x, y), robot.at) < 0.4:
        row, col = (row + 14) % 36 + 6, (col + 14) % 48 + 6
    blocked = with_obstacle(grid, row, col, 2)
    robot.tell(MapReceived(blocked))
    # The next metre at once, and what is further on within a second or so.
    assert_clear(robot, blocked, 1.2)
    for _ in range(4):
        robot.now += 0.3
        robot.tell()
    assert_clear(robot, blocked)
    robot.finish()


def test_a_plan_continues_from_the_cell_nearest_to_the_robot():
    # Behind the robot it would turn back.
    sweeping = replace(CONFIG.sweeping, line=replace(LINES["thorough"], price_s_m2=0.0))
    robot = robot_on(room(3.6, 3.0), config=replace(CONFIG, sweeping=sweeping))
    for _ in range(60):
        robot.drive()
        path = robot.mission.route.path
        stand = robot.mission.map.ground.place_of(tuple(path.cells[path.index].tolist()))
        assert math.dist(stand, robot.at) < 0.65 * CELL_M


def test_the_current_cell_stays_near_a_robot_on_a_polished_line():
    """It was up to 12 m away: points took the cells of those that they replaced."""
    robot = robot_on(room(6.0, 4.8))
    robot.tell(times=200)
    apart = []
    for _ in range(600):
        robot.drive(is_checked=False)
        path = robot.mission.route.path
        stand = robot.mission.map.ground.place_of(tuple(path.cells[path.index].tolist()))
        apart.append(math.dist(stand, robot.at))
    assert np.median(apart) < 0.5 * CELL_M
    assert max(apart) < 4.0 * CELL_M


def test_a_path_that_ends_where_it_was_cut_off_is_whole_again():
    """Its line waited for a plan that had come, was not polished, and could be of one point."""
    grid = room(6.0, 0.4)
    robot = robot_on(grid, 12, at=(2.3, 1.2))
    cells = len(robot.mission.route.path.cells)
    wall = grid.cells.copy()
    wall[:, -30:] = 100
    robot.tell(MapReceived(OccupancyGrid(grid.geometry, wall)))
    assert len(robot.mission.route.path.cells) < cells
    assert not robot.mission.route.requests.wanted
    robot.finish()


def under_way():
    robot = robot_on(room(6.0, 3.0))
    robot.tell(times=20)
    robot.drive(20)
    return robot


def wait_for_line(robot, tick_s=0.3):
    """Let a robot stand until it gets a line; return how long it has stood [s]."""
    stood_since = robot.now
    while not robot.line and robot.now < stood_since + 45.0:
        robot.now += tick_s
        robot.tell()
    return robot.now - stood_since


def test_a_robot_that_stands_gets_its_line_again():
    robot = under_way()
    told, line = len(robot.reasons), robot.line
    robot.line = []  # it ran into something, and gave up
    wait_for_line(robot)
    assert robot.reasons[told:] == ["robot stands"]
    assert math.dist(robot.line[0], robot.at) < 0.05
    assert robot.line[-1] == line[-1]
    robot.finish()


def test_standstills_are_timed_by_the_robots_clock():
    robot = under_way()
    told = len(robot.reasons)
    robot.line, robot.clock_speed = [], 20.0  # it is simulated, at twenty times the real speed
    assert wait_for_line(robot, 0.1) < 2.0
    assert robot.reasons[told:] == ["robot stands"]
    robot.finish()


def test_a_robot_beside_its_path_is_led_to_it_at_once():
    robot = under_way()
    robot.line = []  # it lost its path, and swerved
    (x, y), inward = robot.at, math.copysign(0.05, 1.5 - robot.at[1])
    for step in range(1, 15):
        robot.at, robot.now = (x, y + step * inward), robot.now + 0.3
        robot.tell()
    told = len(robot.reasons)
    assert wait_for_line(robot) < 3.0
    assert robot.reasons[told:] == ["robot left the path"]
    assert math.dist(robot.line[0], robot.at) < 0.15
    robot.finish()


def test_a_pause_leaves_the_line_as_it_was():
    robot = robot_on(room(4.5, 3.5), 20)
    # As it is polished by now: of what lies further on the robot was not told yet.
    before = robot.mission.line._ahead.xy()[1:]
    robot.tell(CommandReceived(1, "pause"))
    assert robot.line == []
    # A robot that brakes comes a little further.
    (x, y), (to_x, to_y) = robot.at, before[0]
    share = STEP_M / math.dist(robot.at, before[0])
    robot.at = x + share * (to_x - x), y + share * (to_y - y)
    robot.tell()
    robot.tell(CommandReceived(2, "resume"))
    assert robot.reasons[-1] == "resumed"
    np.testing.assert_allclose(robot.line[-len(before) :], before, atol=1e-9)
    robot.finish()


def test_on_its_way_home_it_sweeps_nothing_beside_it():
    robot = robot_on(room(4.5, 3.5), 60)
    robot.tell(CommandReceived(1, "home"))
    assert robot.reasons[-1] == "drives home"
    way_m = sum(math.dist(*leg) for leg in pairwise([robot.at, *robot.line]))
    told = len(robot.reasons)
    while robot.mission.state is not State.PAUSED and robot.now < 200.0:
        robot.drive()
    assert robot.reasons[told:] == ["at home, paused by command"]
    assert math.dist(robot.at, START) < CELL_M
    assert way_m < 2 * math.dist((0.0, 0.0), (4.5, 3.5))
    robot.tell(CommandReceived(2, "resume"))
    robot.finish()


@pytest.mark.parametrize(
    "other",
    [lambda grid: shifted(grid, 0.012), lambda grid: cropped(grid, 0, 0, 40, 50)],
    ids=["on another raster", "of another size"],
)
def test_a_map_received_before_a_pose_is_swept_afterwards(other):
    grid = room(3.0, 2.4)
    robot = robot_on(grid, 10)
    here, robot.at = robot.at, (50.0, 50.0)
    robot.now += 2.0
    robot.tell()
    robot.tell(MapReceived(other(grid)))
    robot.tell(MapReceived(grid))
    robot.at = here
    robot.now += 2.0
    robot.tell()
    check_tally(robot.mission)
    robot.finish()
    assert judge_floor(grid, np.array(robot.trail), ROBOT).figures.swept_share > 0.95


def test_a_map_shifted_by_part_of_a_pixel_keeps_most_of_the_line():
    grid = room(3.6, 3.0)
    robot = robot_on(grid, 10)
    ahead = robot.mission.line._ahead
    before = raster_to_map(ahead._geometry, ahead.line.points)
    robot.tell(MapReceived(shifted(grid, 0.012)))
    check_tally(robot.mission)
    after = raster_to_map(ahead._geometry, ahead.line.points)
    apart = np.abs(before[:, None] - after[None]).max(axis=2).min(axis=1)
    assert np.mean(apart < 1e-6) > 0.5
    robot.finish()


def test_a_robot_that_jumped_ahead_is_not_led_through_a_new_wall():
    grid = room(6.0, 0.5)
    robot = robot_on(grid, at=(4.0, 1.25))
    turned = False
    while not (turned and robot.at[0] > 2.5):
        robot.drive()  # to the nearer end of the corridor, and back over cells that are covered
        turned |= robot.at[0] < 2.3
    robot.at = (robot.at[0] + 1.3, robot.at[1])
    robot.tell()
    col, row = grid.geometry.to_pixels(robot.at[0] - 0.65, 1.25)
    blocked = with_obstacle(grid, int(row) - 6, int(col), 4)
    robot.tell(MapReceived(blocked))
    assert_clear(robot, blocked)


def cost_s(ahead, line):
    """Return what the line ahead takes, and what of the floor it leaves is worth [s]."""
    edges = np.diff(ahead.line.points, axis=0) * ahead.tally.unit_m
    angles = np.diff(np.unwrap(np.arctan2(*edges.T)))
    quarters = np.abs(angles).sum() / (math.pi / 2)
    driving_s = np.hypot(*edges.T).sum() / line.speed_m_s
    return driving_s + 1.5 * quarters + line.price_s_m2 * ahead.tally.left_m2


def test_a_line_on_a_growing_map_never_becomes_worse():
    grid = with_obstacle(with_obstacle(room(6.0, 3.0), 22, 30), 0, 82, 62, UNKNOWN)
    robot = robot_on(grid)
    assert robot.mission.orders.cells.is_exploring
    ahead, line = robot.mission.line._ahead, CONFIG.sweeping.line
    while (first := ahead.line.first_below(POLISHED)) < len(ahead.line) and (
        ahead.lengths()[first] <= AHEAD_M
    ):
        robot.tell()
    # What descends is done; the rest is moves at random.
    costs = [cost_s(ahead, line)]
    for _ in range(50):
        robot.tell()
        costs.append(cost_s(ahead, line))
    assert np.all(np.diff(costs) <= 1e-6)
    assert costs[-1] < costs[0] - 1.0


def test_a_changed_line_is_published_when_the_robot_is_near():
    robot = robot_on(room(4.5, 2.4))
    robot.tell(times=100)
    told, ahead = len(robot.reasons), robot.mission.line._ahead
    robot.tell(times=100)
    # It stands: random moves go on further ahead, and are not its concern yet.
    assert len(robot.reasons) == told
    assert not np.isin(ahead.xy()[1:], robot.line).all()
    driven_m = 0.0
    while robot.mission.state is not State.DONE:
        robot.drive()
        driven_m += STEP_M
        if len(ahead.line) > 1:
            near = ahead.xy()[1:][ahead.lengths()[1:] < 1.0]
            assert np.isin(near, np.array([robot.at, *robot.line])).all()
    assert robot.reasons.count("line polished") < driven_m / 3.0


@pytest.mark.parametrize("poses_a_step", [1, 32])
def test_forgotten_floor_is_swept_again(poses_a_step):
    """However many poses come with the news, as after a slow step."""
    robot = robot_on(room(3.0, 2.4), 10)
    mission, (x, y) = robot.mission, robot.trail[2]

    def around(window):
        ys = (np.arange(window.row0, window.row1) + 0.5) * PIXEL_M - y
        xs = (np.arange(window.col0, window.col1) + 0.5) * PIXEL_M - x
        return (np.abs(ys) < 0.1)[:, None] & (np.abs(xs) < 0.1)

    before = mission.covered.floor.pixels
    mission.covered.floor.forget(around)
    assert mission.covered.floor.pixels <= before - 50
    ways = np.array([robot.at, *robot.line])[:40:3]
    poses = np.concatenate([np.linspace(a, b, 8) for a, b in pairwise(ways)])[:32]
    events = [PoseReceived(StampedPose(Pose2D(*pose), "map")) for pose in poses.tolist()]
    for first in range(0, 32, poses_a_step):
        robot.now += 0.1
        mission.step(events[first : first + poses_a_step], robot.now)
    tally, floor = mission.line._ahead.tally, mission.map.ground.floor
    whole = Window(0, 0, *tally.shape)
    is_left = (tally._state & WANTED > 0) & ~mission.covered.floor.swept_on(floor.geometry, whole)
    # The two rasters differ along the rims of what was driven, by a few pixels.
    assert np.count_nonzero(is_left & (tally._state & OPEN == 0)) < 25
