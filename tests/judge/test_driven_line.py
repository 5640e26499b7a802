"""Drive times by limits, beside a robot that is simulated tick by tick."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.judge.driven_line import ArcBends, DriveLimits, drive_seconds
from fasaco_edge.kernels.floor.turning import limited_turning, turn_seconds
from fasaco_edge.simulation.robot import ARRIVED_M, DriveState, SimulationConfig, driven

CONFIG = SimulationConfig(tick_s=0.001)
LIMITS = DriveLimits(
    CONFIG.acceleration_m_s2,
    math.degrees(CONFIG.turn_rad_s),
    math.degrees(CONFIG.turn_acceleration_rad_s2),
)


def simulated_s(points):
    """Drive through points (n, 2), from rest at the first, in the direction of the second."""
    (x, y), (to_x, to_y) = points[:2]
    state = DriveState(Pose2D(x, y, math.atan2(to_y - y, to_x - x)))
    ticks = 0
    for goal in points[1:]:
        while math.dist((state.pose.x, state.pose.y), goal) > ARRIVED_M or state.speed > 0.0:
            state = driven(state, goal, CONFIG)
            ticks += 1
    return ticks * CONFIG.tick_s


def expected_s(points):
    ways = np.diff(points, axis=0)
    headings = np.degrees(np.arctan2(ways[:, 1], ways[:, 0]))
    bends = np.abs((np.diff(headings) + 180.0) % 360.0 - 180.0)
    return drive_seconds(np.hypot(*ways.T), bends, CONFIG.speed_m_s, LIMITS)


@pytest.mark.parametrize("bend_deg", [10.0, 40.0, 90.0, 150.0])
@pytest.mark.parametrize("way_m", [0.05, 1.0])
def test_a_bend_takes_what_a_simulated_robot_takes(bend_deg, way_m):
    bend = math.radians(bend_deg)
    beyond = way_m * (1.0 + math.cos(bend)), way_m * math.sin(bend)
    points = [(0.0, 0.0), (way_m, 0.0), beyond]
    assert expected_s(points) == pytest.approx(simulated_s(points), rel=0.01, abs=0.03)


@pytest.mark.parametrize("bend_deg", [2.0, 30.0, 58.0, 90.0, 180.0])
def test_the_planner_and_the_judge_agree_on_turns(bend_deg):
    """On ways that are long enough to reach the speed; the judge and the planner share no code."""
    turning = limited_turning(
        LIMITS.turn_deg_s,
        LIMITS.turn_deg_s2,
        CONFIG.speed_m_s,
        LIMITS.acceleration_m_s2,
        LIMITS.steered_deg,
    )
    ways = np.array([1.0, 1.0])
    bent = drive_seconds(ways, np.array([bend_deg]), CONFIG.speed_m_s, LIMITS)
    straight = drive_seconds(ways, np.array([0.0]), CONFIG.speed_m_s, LIMITS)
    assert turn_seconds(turning, math.radians(bend_deg)) == pytest.approx(bent - straight)


def driven_along(*pieces, step_m=0.05):
    """Points of a curve from 0, 0: pieces (curvature [1/m], length [m]), below 0 backward."""
    x = y = yaw = 0.0
    points = [(x, y)]
    for curvature, length in pieces:
        parts = math.ceil(abs(length) / step_m)
        half = 0.5 * curvature * length / parts
        chord = length / parts * (math.sin(half) / half if half else 1.0)
        for _ in range(parts):
            x, y = x + chord * math.cos(yaw + half), y + chord * math.sin(yaw + half)
            yaw += 2.0 * half
            points.append((x, y))
    return np.array(points)


def bends_of(points, radius_m=0.5):
    ways = np.diff(points, axis=0)
    bends = np.degrees(np.diff(np.arctan2(ways[:, 1], ways[:, 0])))
    bends = np.abs((bends + 180.0) % 360.0 - 180.0)
    lengths = np.hypot(*ways.T)
    return lengths, bends, ArcBends.of(lengths, bends, radius_m)


@pytest.mark.parametrize(("radius_m", "are_spots"), [(0.5, 0), (0.6, 0), (0.4, 1), (0.2, 1)])
def test_an_arc_turns_on_the_spot_only_if_it_is_too_tight(radius_m, are_spots):
    length_m = 0.5 * math.pi * radius_m
    _, _, bends = bends_of(driven_along((0.0, 1.0), (1.0 / radius_m, length_m), (0.0, 1.0)))
    assert bends.spots.any() == are_spots
    assert not bends.reverses.any()


@pytest.mark.parametrize("curvature", [-2.0, 0.0, 2.0])
def test_a_turn_back_reverses_and_a_corner_is_a_spot_turn(curvature):
    _, _, bends = bends_of(driven_along((2.0, 0.5), (curvature, -0.5)))
    assert (int(bends.reverses.sum()), int(bends.spots.sum())) == (1, 0)
    _, _, bends = bends_of(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]))
    assert (int(bends.reverses.sum()), int(bends.spots.sum())) == (0, 1)


def test_an_arc_takes_as_long_as_its_rate_of_turning_requires():
    half_turn_m = 0.5 * math.pi
    ways, bends, arcs = bends_of(driven_along((0.0, 1.0), (2.0, half_turn_m), (0.0, 1.0)))
    fast, slow = DriveLimits(0.5, 1000.0, 1000.0), DriveLimits(0.5, 20.0, 1000.0)
    straight_s = (2.0 + half_turn_m) / 0.5 + 1.0
    assert drive_seconds(ways, bends, 0.5, fast, arcs) == pytest.approx(straight_s, rel=0.001)
    # At 20 deg/s, in place of its length at 0.5 m/s.
    longer_s = 180.0 / 20.0 - half_turn_m / 0.5
    seconds = drive_seconds(ways, bends, 0.5, slow, arcs)
    assert seconds == pytest.approx(straight_s + longer_s, rel=0.02)


def test_a_reversal_takes_braking_and_starting():
    ways, bends, arcs = bends_of(np.array([(0.0, 0.0), (2.0, 0.0), (1.0, 0.0)]))
    limits = DriveLimits(0.5, 90.0, 180.0)
    assert drive_seconds(ways, bends, 0.5, limits, arcs) == pytest.approx(3.0 / 0.5 + 2.0)
