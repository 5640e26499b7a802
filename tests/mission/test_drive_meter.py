"""What a robot's poses show of its driving, beside the limits that it was simulated with."""

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.kernels.floor.turning import limited_turning, turn_seconds
from fasaco_edge.mission.core.drive_meter import DriveMeter, DriveTimes
from fasaco_edge.simulation.robot import ARRIVED_M, DriveState, SimulationConfig, driven

SLOW = SimulationConfig(turn_rad_s=0.5, turn_acceleration_rad_s2=0.6)
LANES = [(x, y) for lane in range(12) for x, y in ((0.0, 0.9 * lane), (3.0, 0.9 * lane))]
LANES = [
    point for i in range(0, 24, 4) for point in (*LANES[i : i + 2], LANES[i + 3], LANES[i + 2])
]
TO_AND_FRO = [(0.0, 0.0), (4.0, 0.0)] * 8


def poses(points, config, *, every=5, stops_at=0, stopped_s=0.0):
    """Yield the seconds and poses of a robot that drives through points; it may stop at one."""
    state, ticks = DriveState(Pose2D(*points[0])), 0
    for number, goal in enumerate(points[1:]):
        for _ in range(round(stopped_s * 10.0) if number == stops_at else 0):
            ticks += every
            yield ticks * config.tick_s, state.pose
        while math.dist((state.pose.x, state.pose.y), goal) > ARRIVED_M or state.speed > 0.0:
            state = driven(state, goal, config)
            ticks += 1
            if ticks % every == 0:
                yield ticks * config.tick_s, state.pose


def measured(told, scatter_m=0.0, scatter_rad=0.0):
    rng, meter = np.random.default_rng(3), DriveMeter()
    for at, pose in told:
        dx, dy, dyaw = rng.normal(0.0, (scatter_m, scatter_m, scatter_rad)).tolist()
        seen = Pose2D(pose.x + dx, pose.y + dy, pose.yaw + dyaw)
        meter.receive_pose(StampedPose(seen, "map", round((1000.0 + at) * 1e9)))
    return meter.times


def expected(config, degrees):
    turning = limited_turning(
        math.degrees(config.turn_rad_s),
        math.degrees(config.turn_acceleration_rad_s2),
        config.speed_m_s,
        config.acceleration_m_s2,
        1.0,
    )
    return turn_seconds(turning, math.radians(degrees))


@pytest.mark.parametrize("config", [SimulationConfig(), SLOW], ids=["quick", "slow"])
@pytest.mark.parametrize("scatter", [(0.0, 0.0), (0.02, 0.01)], ids=["exact", "scattered"])
def test_quarter_turns_take_the_time_of_the_robots_limits(config, scatter):
    times = measured(poses(LANES, config), *scatter)
    assert times.speed_m_s == pytest.approx(config.speed_m_s, rel=0.05)
    assert times.quarter_turn_s == pytest.approx(expected(config, 90.0), rel=0.08, abs=0.1)
    assert times.turns >= 10
    assert times.half_turn_s is None


def test_half_turns_take_less_than_two_quarter_turns():
    times = measured(poses(TO_AND_FRO, SLOW))
    assert times.half_turn_s == pytest.approx(expected(SLOW, 180.0), rel=0.05)
    assert times.half_turn_s < 2.0 * expected(SLOW, 90.0)
    assert (times.quarter_turn_s, times.turns) == (None, 14)


@pytest.mark.parametrize("scatter_m", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("at_point", [0, 8])
def test_waiting_does_not_lower_the_measured_speed(at_point, scatter_m):
    told = poses(LANES, SLOW, stops_at=at_point, stopped_s=300.0)
    times = measured(told, scatter_m, 0.5 * scatter_m)
    assert times.speed_m_s == pytest.approx(SLOW.speed_m_s, rel=0.05)
    assert times.quarter_turn_s == pytest.approx(expected(SLOW, 90.0), rel=0.08)


def test_a_turn_by_270_degrees_is_no_quarter_turn():
    round_and_on = [(0.0, 0.0), (4.0, 0.0)]
    seen = list(poses(round_and_on, SLOW))
    meter, at, yaw = DriveMeter(), 0.0, 0.0
    for _ in range(12):
        for _, pose in seen:
            at += 0.1
            x, y = pose.x * math.cos(yaw), pose.x * math.sin(yaw)
            meter.receive_pose(StampedPose(Pose2D(x, y, yaw), "map", round((1000.0 + at) * 1e9)))
        for step in range(60):
            at += 0.1
            turned = Pose2D(x, y, math.remainder(yaw + math.radians(4.5 * step), math.tau))
            meter.receive_pose(StampedPose(turned, "map", round((1000.0 + at) * 1e9)))
        yaw += math.radians(270.0)
    assert meter.times.speed_m_s is not None
    assert meter.times.turns == 0


@pytest.mark.parametrize("stamp", [lambda _: 0, lambda n: -n, lambda n: n * 5_000_000_000])
def test_poses_without_times_that_fit_show_nothing(stamp):
    meter = DriveMeter()
    for number, (_, pose) in enumerate(poses(LANES, SLOW)):
        meter.receive_pose(StampedPose(pose, "map", stamp(number)))
    assert meter.times == DriveTimes()
