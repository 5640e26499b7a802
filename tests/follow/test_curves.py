"""A base that cannot turn on the spot drives curves, forward and backward, as they are meant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.follow.route import CurveRoute
from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import curve_along
from tests.follow.closed_loop import CONFIG, LIMITS, ClosedLoop
from tests.simulation.rooms import building, distances_to

TURN_M, TOOL_M = 0.4, 0.3
ROOM = building(4.5, 3.5)


def lanes():
    points = []
    for number, y in enumerate(np.arange(0.35, 3.2, 0.27)):
        points += [(0.35, y), (4.15, y)] if number % 2 == 0 else [(4.15, y), (0.35, y)]
    return np.array(points)


def curve_of(line_xy, *, reverses, clearance_m=0.05):
    discs = RobotDiscs(CONFIG.robot_radius_m + clearance_m, TOOL_M)
    floor = Floor.around(ROOM, discs, tuple(line_xy[0]))
    config = CurveConfig(TURN_M, reverses, CONFIG.speed_m_s, CONFIG.speed_m_s, 0.5, 200.0)
    return curve_along(line_xy, floor, floor.reachable, config)


def loop_on(curve, **conditions):
    loop = ClosedLoop(ROOM, Pose2D(*curve.poses[0]), turn_m=TURN_M, **conditions)
    loop.send(curve.xy, curve.poses[:, 2])
    return loop


@pytest.mark.parametrize(
    ("conditions", "off_m"),
    [({}, 0.03), ({"delay_s": 0.1, "jitter_s": 0.05}, 0.05), ({"noise": 0.01}, 0.05)],
    ids=str,
)
@pytest.mark.parametrize("reverses", [False, True])
def test_it_sweeps_a_room_without_a_touch(reverses, conditions, off_m):
    curve = curve_of(lanes(), reverses=reverses)
    assert curve.spots == 0
    assert (curve.reversals > 0) == reverses
    loop = loop_on(curve, **conditions)
    loop.drive(most_s=3000.0)
    assert loop.world.collisions == 0
    assert distances_to(curve.xy, loop.trail).max() < off_m
    assert distances_to(loop.trail[::10], curve.xy).max() < off_m + 0.015
    tool = SweepingRobot(TOOL_M, CONFIG.hull_radius_m)
    planned, driven = (judge_floor(ROOM, xy, tool).figures for xy in (curve.xy, loop.trail))
    assert driven.illegal_share == 0.0
    assert driven.swept_share > planned.swept_share - 0.005


def test_a_leg_is_driven_backward_where_the_heading_is_opposite():
    poses = [Pose2D(x, 1.0) for x in (1.0, 2.0, 1.5, 1.5, 1.2)]
    route = CurveRoute(poses, replace(LIMITS, turn_radius=0.4))
    legs = []
    while route.leg is not None:
        legs.append((route.leg.is_back, route.leg.stops))
        route.next_leg()
    assert legs == [(False, True), (True, False), (True, True)]


def test_no_command_asks_for_a_tighter_arc():
    """Not even while it brakes, and its rate of turning goes down more slowly."""
    curve = curve_of(lanes()[:8], reverses=True)
    loop = loop_on(curve, noise=0.02, limits=replace(LIMITS, turn_acceleration=0.8))
    sent, move = [], loop.world.move
    loop.world.move = lambda speed, rate: (sent.append((speed, rate)), move(speed, rate))
    loop.drive(most_s=1000.0)
    speeds, rates = np.array(sent).T
    assert (np.abs(rates) <= np.abs(speeds) / TURN_M + 1e-9).all()
    assert (speeds < 0.0).any()
    assert (speeds > 0.0).any()


def test_a_new_path_is_joined_on_an_arc_without_a_stop():
    curve = curve_of(lanes()[:6], reverses=False)
    loop = loop_on(curve, delay_s=0.05)
    loop.run(lambda: abs(loop.world.pose.yaw) > 1.0)
    pose = loop.world.pose
    near = int(np.argmin(np.hypot(*(curve.xy - (pose.x, pose.y)).T)))
    loop.send(curve.xy[near:], curve.poses[near:, 2])
    before = loop.world.distance_m
    loop.wait(1.0)
    assert loop.world.distance_m - before > 0.9 * CONFIG.speed_m_s
    loop.drive()


def test_it_stands_before_a_path_that_leads_back():
    """It neither turns on the spot nor drives an arc to where the path does not lead."""
    loop = loop_on(curve_of(lanes()[:2], reverses=False))
    loop.run(lambda: loop.world.pose.x > 2.0)
    x = loop.world.pose.x
    loop.send([(x + 0.05, 0.35), (x - 1.0, 0.35)], np.full(2, math.pi))
    loop.run(lambda: loop.follower.state is FollowerState.OFF_PATH)
    loop.wait(5.0)
    assert loop.follower.state is FollowerState.OFF_PATH
    assert "cannot steer" in loop.follower.detail
    assert loop.world.pose.x < x + 0.2
    assert abs(loop.world.pose.yaw) < 0.1
