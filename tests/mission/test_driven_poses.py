"""Poses that lie farther away than the robot can have driven: none of them sweeps floor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose, Window
from fasaco_edge.mission.coverage.driven_poses import Driven, DrivenPoses
from fasaco_edge.mission.coverage.segments import SHORT_M, beside_m, corner_between
from fasaco_edge.mission.coverage.steady_track import Position
from fasaco_edge.mission.coverage.swept_floor import SweptFloor
from tests.mission.line_robot import CONFIG, SPEED_M_S, TOOL_M, LineRobot

ROOM = np.pad(np.zeros((56, 56), np.int8), 2, constant_values=100)
AROUND = Window(-40, -40, 180, 180)


class OftenLost(LineRobot):
    """A robot with one pose in ten beside where it is."""

    tick_s = 0.1
    off_m = 0.0

    def _drive(self, way):
        super()._drive(way)
        self.number = getattr(self, "number", 0) + 1
        self.is_off = self.number % 10 == 0

    @property
    def reported(self):
        turn = 2.4 * self.number
        off_m = self.off_m if self.is_off else 0.0
        x, y = self.x + off_m * math.cos(turn), self.y + off_m * math.sin(turn)
        return Pose2D(x, y, self.yaw)


@pytest.mark.parametrize("off_m", [0.3, 0.6, 1.0])
def test_a_pose_in_ten_that_is_off_sweeps_no_floor(off_m):
    robot = OftenLost(ROOM, (1.0, 1.0), replace(CONFIG, speed_m_s=SPEED_M_S))
    robot.off_m = off_m
    robot.wait(60.0, lambda _: False)
    truth = SweptFloor(TOOL_M)
    for x, y in robot.track:
        truth.record(Pose2D(x, y))
    swept, true = (floor.swept_in(AROUND) for floor in (robot.mission.covered.floor, truth))
    assert np.count_nonzero(swept & ~true) == 0
    assert np.count_nonzero(swept) > 0.97 * np.count_nonzero(true)


def poses(*xs, every_s=1.0):
    return [
        StampedPose(Pose2D(x, 0.0), "map", round(1e9 * every_s * index))
        for index, x in enumerate(xs, start=1)
    ]


def taken(*xs, speed_m_s=0.5, every_s=1.0):
    driven = DrivenPoses(speed_m_s, cell_m=0.2)
    return [driven.receive_pose(pose) for pose in poses(*xs, every_s=every_s)]


def test_a_pose_that_comes_back_counts_for_nothing():
    assert taken(0.0, 0.5, 2.0, 1.5) == [
        [Driven(Pose2D(0.0, 0.0))],
        [Driven(Pose2D(0.5, 0.0), pytest.approx(0.6))],
        [],
        [Driven(Pose2D(1.5, 0.0), pytest.approx(1.2))],
    ]


def test_a_held_pose_counts_once_the_next_confirms_it():
    *_, held, last = taken(0.0, 3.0, 3.4)
    assert held == []
    assert last == [
        Driven(Pose2D(3.0, 0.0), is_joined=False),
        Driven(Pose2D(3.4, 0.0), pytest.approx(0.6)),
    ]


def test_a_robot_faster_than_configured_sweeps_where_it_is_alone():
    found = [driven for each in taken(0.0, 1.0, 2.0, 3.0, 4.0) for driven in each]
    assert [driven.pose.x for driven in found] == [0.0, 1.0, 2.0, 3.0]
    assert not any(driven.is_joined for driven in found[1:])


@pytest.mark.parametrize(("speed_m_s", "every_s"), [(0.0, 1.0), (0.5, 0.0), (0.5, 4.0)])
def test_without_speed_or_stamps_all_poses_count(speed_m_s, every_s):
    found = taken(0.0, 3.0, 0.1, speed_m_s=speed_m_s, every_s=every_s)
    assert [len(each) for each in found] == [1, 1, 1]


# How far a robot may have driven beside the segment between two places.


FAR_M = 100.0


def between(end, yaws, farthest_m=FAR_M):
    """The places at the origin and at ``end``, with its headings there."""
    return Position(0.0, 0.0, 0.0, 0.0, yaws[0]), Position(*end, 0.0, farthest_m, yaws[1])


@pytest.mark.parametrize("yaws", [(0.0, 0.0), (0.0, 1.0), (-0.5, 0.0)])
def test_a_turn_beside_a_straight_drive_is_on_the_spot(yaws):
    assert beside_m(*between((1.0, 0.0), yaws)) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.5, 0.7])
def test_a_corner_between_two_places_lies_no_farther_beside_them(share):
    """It came along x to the corner at (share, 0), and went on along y."""
    end = share, 1.0 - share
    height = share * (1.0 - share) / math.hypot(*end)
    assert beside_m(*between(end, (0.0, 0.5 * math.pi))) == pytest.approx(height)


def test_an_arc_lies_within():
    away = beside_m(*between((math.sin(0.5), 1.0 - math.cos(0.5)), (0.0, 0.5)))
    assert 1.0 - math.cos(0.25) < away < 0.2


def test_it_was_no_farther_away_than_it_can_have_driven():
    there_and_back = (1.0, 0.0), (2.0, 2.0)
    far_m = 0.5 * math.sqrt(FAR_M**2 - 1.0)
    for farthest_m, away_m in ((FAR_M, far_m), (1.25, 0.375), (0.5, math.inf)):
        assert beside_m(*between(*there_and_back, farthest_m)) == pytest.approx(away_m)


def test_unknown_speed_or_near_poses_mean_a_straight_drive():
    for end, farthest_m in (((1.0, 0.0), 0.0), ((SHORT_M, 0.0), FAR_M)):
        assert beside_m(*between(end, (1.0, 1.0), farthest_m)) == 0.0


def test_headings_tell_where_it_turned():
    end, right_angle = (0.6, 0.5), (0.0, 0.5 * math.pi)
    assert corner_between(*between(end, right_angle)) == pytest.approx((0.6, 0.0))
    # It cannot have driven round that corner in the time.
    assert corner_between(*between(end, right_angle, 1.0)) is None
    # Headings to one side, or against each other, are no single turn of a base that drives ahead.
    for yaws in ((1.0, 1.0), (0.0, math.pi), (math.pi, 0.0)):
        assert corner_between(*between(end, yaws)) is None
