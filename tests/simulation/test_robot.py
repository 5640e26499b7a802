"""The drive: limits held, corners met at rest, lines kept, and new paths joined under way."""

import math
from itertools import pairwise

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
    corners_to_end,
    driven,
    moved_by,
    passed_waypoints,
    stopping_point,
)
from tests.simulation.rooms import CELL, centres
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


def clear(_start, _end):
    return True


def track(*corners):
    points = [np.asarray(corners[0], float)[np.newaxis]]
    for begin, end in pairwise(corners):
        count = max(1, round(np.hypot(*np.subtract(end, begin)) / 0.02))
        points.append(np.linspace(begin, end, count + 1)[1:])
    return np.vstack(points)


def at(row, col):
    return tuple(centres((row, col))[0])


def points(*cells):
    return np.round(centres(*cells), 6).tolist()


def route(path, came, is_clear=clear):
    found = corners_to_end(path, came, is_clear)
    return None if found is None else np.round(found, 6).tolist()


def test_waypoints_passed_on_the_way_are_left_out():
    path = centres((0, 0), (0, 1), (0, 2), (1, 2))
    x, y = at(0, 1)
    assert route(path, track(at(0, 0), (x + 0.13, y))) == points((0, 2), (1, 2))
    assert route(path, track(at(0, 0), (x, y))) == points((0, 2), (1, 2))
    assert route(path, track(at(0, 0), at(0, 2), at(1, 2))) == []
    assert route(centres((3, 3)), track(at(0, 0))) == points((3, 3))
    assert route(np.empty((0, 2)), track((1.0, 1.0))) == []


def test_a_dead_end_is_not_skipped_because_the_way_back_is_here():
    x, y = at(0, 1)
    into_and_back = centres((0, 1), (0, 0), (0, 1), (0, 2), (1, 2))
    # On the way to the dead end, a little short of the first waypoint.
    assert route(into_and_back, track(at(0, 2), (x + 0.05, y)))[0] == points((0, 0))[0]
    # It had been here some time before, on the way out.
    before = track((x, y), at(0, 2), (x + 0.05, y))
    assert route(into_and_back, before)[0] == points((0, 0))[0]


def test_only_the_latest_visit_to_the_first_waypoint_counts():
    path = centres((0, 0), (0, 1), (0, 2))
    assert passed_waypoints(path, track(at(0, 0), at(0, 2))) == 3
    assert passed_waypoints(path, track(at(0, 0), at(0, 2), at(0, 0))) == 1
    assert passed_waypoints(path, track(at(0, 2), at(0, 1))) == 0
    # In order: the way from the second to the first is not the way there.
    assert passed_waypoints(path, track(at(0, 1), at(0, 0))) == 1


def test_without_a_clear_way_it_drives_back_along_its_track():
    path = centres((0, 0), (0, 1))
    came = track(at(1, 0), at(1, 1), at(1, 2), at(2, 2))

    def only_from_the_corner(start, end):
        return np.allclose(start, at(1, 1)) and np.allclose(end, at(0, 0))

    assert route(path, came, only_from_the_corner) == points((1, 2), (1, 1), (0, 0), (0, 1))
    assert route(path, came, lambda _start, _end: False) is None


def test_as_a_last_resort_waypoints_are_skipped():
    path = centres((0, 0), (0, 1), (0, 2), (0, 3), *[(0, col) for col in range(4, 20)])

    def no_way_to_the_first(_start, end):
        return end[0] > CELL

    assert route(path, track(at(1, 0)), no_way_to_the_first) == points((0, 1), (0, 19))

    def no_way_to_the_first_metres(_start, end):
        return end[0] > 3.0

    assert route(path, track(at(1, 0)), no_way_to_the_first_metres) is None
