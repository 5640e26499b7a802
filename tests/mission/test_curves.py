"""Missions of a base that cannot turn on the spot: its paths are curves just ahead of it."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.fine_raster import map_to_raster, raster_to_map
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.judge.driven_line import ArcBends
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.mission.core.lattice_rotation import LatticeRotation
from fasaco_edge.mission.core.path_exit import PublishedPath
from fasaco_edge.mission.events import MapReceived, State
from fasaco_edge.mission.line.curver import Curver
from fasaco_edge.mission.line.polyline import CURVED, POLISHED, Polyline, edges_between
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import STEP_M
from tests.mission.curve_base import CONFIG, RADIUS_M, TOOL_M, TURN_M, CurvedMission, configured
from tests.simulation.rooms import building

ROOM, SWEPT_ROOM = building(4.5, 3.5), building(3.6, 2.8)
START = Pose2D(1.0, 1.0)
# What a robot has of its path at least before the next one comes [m].
AHEAD_M = 2.0


@pytest.fixture(scope="module")
def driven():
    """A mission with reversing, until it is done."""
    run = CurvedMission(SWEPT_ROOM, START)
    run.run(600.0)
    return run


def judged(run):
    """The floor that the planner holds for reachable, and what was swept of it."""
    robot = SweepingRobot(TOOL_M, RADIUS_M)
    return judge_floor(SWEPT_ROOM, run.loop.trail, robot, stands_at=(1.0, 1.0))


def test_a_mission_sweeps_a_room_without_a_turn_on_the_spot(driven):
    assert driven.mission.state is State.DONE
    assert driven.loop.world.collisions == 0
    assert set(driven.standing_s) <= {FollowerState.EMPTY_PATH}
    assert judged(driven).figures.swept_share > 0.94
    hull = SweepingRobot(TOOL_M, CONFIG.hull_radius_m)
    assert judge_floor(SWEPT_ROOM, driven.loop.trail, hull).figures.illegal_share == 0.0


def test_a_path_is_a_curve_at_its_beginning(driven):
    for now, path in driven.paths[:-1]:
        ways = np.diff(path.xy, axis=0)
        lengths = np.hypot(*ways.T)
        near = np.cumsum(lengths) <= AHEAD_M
        lengths[0] = max(lengths[0], STEP_M)  # the rest of a chord
        along = np.arctan2(ways[near, 1], ways[near, 0])
        bends = np.degrees(np.abs((np.diff(along) + np.pi) % (2.0 * np.pi) - np.pi))
        arcs = ArcBends.of(lengths[near], bends, TURN_M)
        assert not arcs.spots.any(), (now, path.reason)
        # Headings are those of the robot, also where it drives backward.
        pose = driven.loop.truth_at[max(round(now / CONFIG.tick_s) - 1, 0)]
        assert abs(math.remainder(path.yaw[0] - pose.yaw, math.tau)) < 0.2, (now, path.reason)
        off = np.cos(path.yaw[:-1][near] - along)
        assert (np.abs(off) > 0.99).all()
    assert len(driven.paths) > 5


def test_it_drives_backward_but_not_forward_only(driven):
    def backward_m(run):
        poses = run.loop.truth_at
        ways = ((a.x, a.y, a.yaw, b.x - a.x, b.y - a.y) for a, b in pairwise(poses))
        along = (dx * math.cos(yaw) + dy * math.sin(yaw) for _, _, yaw, dx, dy in ways)
        return -sum(way for way in along if way < 0.0)

    assert backward_m(driven) > 1.0
    ahead = CurvedMission(SWEPT_ROOM, START, reverses=False)
    ahead.run(140.0)
    assert backward_m(ahead) == 0.0
    assert ahead.loop.world.collisions == 0
    assert judged(ahead).figures.swept_share > 0.8


def test_without_a_radius_a_path_has_no_headings_of_its_own():
    run = CurvedMission(ROOM, START, turn_m=0.0)
    run._step([MapReceived(ROOM)])
    run._step([])
    (_, path), *_ = run.paths
    assert path.xy is not None
    assert path.yaw is None


def test_headings_turn_round_at_a_change_of_direction():
    xy = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 0.0), (0.4, 0.1), (1.4, 0.1)])
    both, ahead = (
        Curver(CurveConfig(TURN_M, reverses, 0.25, 0.25, 0.5, 200.0)) for reverses in (True, False)
    )
    back = math.remainder(math.atan2(0.1, -0.1) + math.pi, math.tau)
    told = both.yaw(xy, Pose2D(0.0, 0.0, 0.3))
    assert np.cos(told - [0.0, 0.0, back, 0.0, 0.0]) == pytest.approx(np.ones(5))
    # It stands the other way round.
    told = both.yaw(xy, Pose2D(0.0, 0.0, 3.0))
    assert np.cos(told - [math.pi, math.pi, back + math.pi, math.pi, math.pi]) == pytest.approx(
        np.ones(5)
    )
    told = ahead.yaw(xy, Pose2D(0.0, 0.0, 3.0))
    assert np.cos(told[[0, 1, 3, 4]] - [0.0, math.pi, 0.0, 0.0]) == pytest.approx(np.ones(4))
    assert both.yaw(xy[:1], Pose2D(0.0, 0.0, 0.3)).tolist() == [0.3]


def laid(line_xy):
    """A line ahead over the room, as of a robot at its beginning, and the floor."""
    run = CurvedMission(ROOM, START)
    run._step([MapReceived(ROOM)])
    run._step([])
    ahead, floor = run.mission.line._ahead, run.mission.map.ground.floor
    points = np.array([map_to_raster(floor.geometry, x, y) for x, y in line_xy])
    numbers, state = np.zeros(len(points), np.int64), np.full(len(points), POLISHED, np.uint8)
    ahead.tally.exchange(edges_between(ahead.line.points), edges_between(points))
    ahead.whole = Polyline(points, numbers, state)
    ahead.see(Pose2D(*line_xy[0]))
    return ahead, floor


def bends_of(xy):
    ways = np.diff(xy, axis=0)
    along = np.arctan2(ways[:, 1], ways[:, 0])
    bends = np.degrees(np.abs((np.diff(along) + np.pi) % (2.0 * np.pi) - np.pi))
    return ArcBends.of(np.hypot(*ways.T), bends, TURN_M)


# Lanes with points within them, one of them twice.
LANES = [(0.6, 0.6), (2.0, 0.6), (3.9, 0.6), (3.9, 0.9), (2.5, 0.9), (2.5, 0.9), (0.6, 0.9)]
LANES += [(0.6, 1.2), (3.9, 1.2), (3.9, 1.5), (0.6, 1.5), (0.6, 1.8), (3.9, 1.8), (3.9, 2.9)]


def test_piece_by_piece_a_line_becomes_a_curve():
    ahead, floor = laid(LANES)
    curver = Curver(configured().sweeping.curves)
    pose, pieces, end = Pose2D(0.6, 0.6), 0, ahead.line.points[-1]
    assert curver.curve(ahead, floor, pose)
    assert ahead.line.first_below(CURVED) < len(ahead.line)
    assert curver.curve(ahead, floor, pose)
    assert not curver.curve(ahead, floor, pose)  # that is far enough
    assert ahead.line.first_below(CURVED) < len(ahead.line)
    for _ in range(400):
        # The robot drives along it.
        xy = raster_to_map(floor.geometry, ahead.line.points)
        number = 1 if math.dist(xy[1], (pose.x, pose.y)) > 1e-6 else 2
        yaw = float(curver.yaw(xy[: number + 1], pose)[-1])
        way = xy[number] - (pose.x, pose.y)
        way *= min(0.3 / math.hypot(*way), 1.0)
        pose = Pose2D(pose.x + way[0], pose.y + way[1], yaw)
        ahead.drive(pose)
        pieces += curver.curve(ahead, floor, pose)
        if len(ahead.line) < 3:
            break
        near = int(np.searchsorted(ahead.lengths(), 2.0))
        xy = raster_to_map(floor.geometry, ahead.line.points[1 : near + 1])
        assert not bends_of(xy).spots.any() if len(xy) > 2 else True
        assert (np.hypot(*np.diff(ahead.line.points, axis=0).T) > 1e-3).all()
    assert pieces >= 1
    assert len(ahead.line) < 3
    assert ahead.line.points[-1] == pytest.approx(end, abs=1e-3)


def test_a_curve_starts_again_at_a_robot_that_has_left_it():
    ahead, floor = laid(LANES)
    curver = Curver(configured().sweeping.curves)
    while curver.curve(ahead, floor, Pose2D(0.6, 0.6)):
        pass
    astray = Pose2D(0.75, 0.62, 0.8)
    ahead.drive(astray)
    assert curver.curve(ahead, floor, astray)
    xy = raster_to_map(floor.geometry, ahead.line.points[:3])
    assert xy[0] == pytest.approx((0.75, 0.62), abs=1e-5)
    assert abs(math.remainder(curver.yaw(xy, astray)[0] - 0.8, math.tau)) < 0.1
    # Once, until it has moved: what is made then begins further ahead.
    before = ahead.line.points[:20]
    curver.curve(ahead, floor, replace(astray, yaw=0.2))
    assert np.array_equal(before, ahead.line.points[:20])


def test_a_robot_whose_disc_does_not_fit_may_leave_its_place():
    """Its pose is 7 cm too near to the wall that it faces."""
    line_xy = [(4.33, 0.6), (4.0, 2.0), (0.6, 2.0)]
    ahead, floor = laid(line_xy)
    curver = Curver(configured().sweeping.curves)
    assert curver.curve(ahead, floor, Pose2D(4.33, 0.6))
    xy = raster_to_map(floor.geometry, ahead.line.points)
    assert math.cos(curver.yaw(xy, Pose2D(4.33, 0.6))[0]) > 0.99
    assert xy[1, 0] < 4.33
    assert not bends_of(xy).spots.any()


def test_headings_are_published_in_the_map_frame(driven):
    _, update = driven.paths[0]
    told = LatticeRotation(30.0).path(update, driven.mission.lattice)
    ways, turned = np.diff(update.xy[:2], axis=0)[0], np.diff(told.xy[:2], axis=0)[0]
    by = math.atan2(turned[1], turned[0]) - math.atan2(ways[1], ways[0])
    assert math.remainder(by - math.radians(30.0), math.tau) == pytest.approx(0.0, abs=1e-6)
    assert told.yaw == pytest.approx(update.yaw + math.radians(30.0))
    path = PublishedPath.of(driven.mission, update)
    assert np.array_equal(path.yaw, update.yaw)
    assert path.withdrawn("paused").yaw is None
