"""The drive: limits held, corners met at rest, lines kept."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.simulation.robot import (
    ARRIVED_M,
    DriveState,
    SimulationConfig,
    corners,
    driven,
    moved_by,
    stopping_point,
)
from tests.support.examples import examples

CONFIG = SimulationConfig()


def drive_to(goal, state, ticks=3000):
    states = [state]
    while len(states) < ticks and math.dist((state.pose.x, state.pose.y), goal) >= ARRIVED_M:
        state = driven(state, goal, CONFIG)
        states.append(state)
    return states


@examples(60)
@given(
    x=st.floats(-3, 3),
    y=st.floats(-3, 3),
    yaw=st.floats(-math.pi, math.pi),
    speed=st.sampled_from([0.0, 0.1, 0.25]),
)
def test_any_goal_is_reached_within_the_limits(x, y, yaw, speed):
    states = drive_to((x, y), DriveState(Pose2D(0.0, 0.0, yaw), speed))
    last = states[-1]
    assert math.dist((last.pose.x, last.pose.y), (x, y)) < ARRIVED_M
    speeds = np.array([state.speed for state in states])
    rates = np.array([state.turn_rate for state in states])
    assert speeds.min() >= 0.0
    assert speeds.max() <= CONFIG.speed_m_s
    assert np.abs(rates).max() <= CONFIG.turn_rad_s
    assert np.abs(np.diff(speeds)).max(initial=0) <= CONFIG.acceleration_m_s2 * 0.02 + 1e-12
    assert np.abs(np.diff(rates)).max(initial=0) <= CONFIG.turn_acceleration_rad_s2 * 0.02 + 1e-12


def test_a_goal_behind_is_turned_to_on_the_spot():
    states = drive_to((-1.0, 0.2), DriveState(Pose2D(0.0, 0.0, 0.0)))
    turning = [state for state in states if abs(state.turn_rate) > 0.01]
    assert len(turning) > 50
    assert all(state.speed == 0.0 for state in turning)


def test_it_arrives_slowly_and_does_not_overshoot():
    states = drive_to((1.0, 0.0), DriveState(Pose2D(0.0, 0.0, 0.0)))
    state = states[-1]
    foretold = stopping_point(state, CONFIG)
    while state.moving:
        state = driven(state, None, CONFIG)
    assert abs(state.pose.x - 1.0) < 2e-3
    assert state.pose.x == pytest.approx(foretold[0], abs=1e-3)
    # Full speed needs 1 m / 0.25 m/s, the ramps v / a on top.
    assert len(states) * CONFIG.tick_s == pytest.approx(1.0 / 0.25 + 0.25 / 0.5, abs=0.2)


def test_corners_keep_ends_turns_and_reversals():
    line = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [2, 1], [2, 1], [2, 0.5]], float)
    assert corners(line).tolist() == [[0, 0], [2, 0], [2, 2], [2, 0.5]]
    assert corners(line[:1]).tolist() == [[0, 0]]
    assert corners(np.empty((0, 2))).shape == (0, 2)
    assert corners(np.ones((4, 2))).tolist() == [[1, 1]]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"speed_m_s": 0.0}, "speed_m_s"),
        ({"map_hz": -1.0}, "map_hz"),
        ({"range_m": math.nan}, "range_m"),
        ({"padding_m": 0.3}, "padding_m"),
    ],
)
def test_an_impossible_value_is_named(change, named):
    with pytest.raises(BadConfiguration, match=named):
        SimulationConfig(**change)


def test_a_base_with_a_turning_radius_keeps_it():
    config = SimulationConfig(turn_radius_m=0.4)
    for told_m_s in (0.25, -0.25):
        state = DriveState(Pose2D(0.0, 0.0))
        for _ in range(200):
            state = moved_by(state, told_m_s, 1.8, config)
            assert abs(state.turn_rate) <= abs(state.speed) / 0.4 + 1e-12
        assert state.speed == pytest.approx(told_m_s)
        # On a circle of that radius: to its left, backward to its right.
        centre_y = math.copysign(0.4, told_m_s)
        far = math.hypot(state.pose.x, state.pose.y - centre_y)
        assert far == pytest.approx(0.4, abs=0.02)
    state = moved_by(DriveState(Pose2D(0.0, 0.0)), 0.0, 1.8, config)
    assert not state.moving
    # A base that turns on the spot does not drive backward.
    assert not moved_by(DriveState(Pose2D(0.0, 0.0)), -0.25, 0.0, SimulationConfig()).moving
