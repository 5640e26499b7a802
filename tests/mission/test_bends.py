"""How far a robot may have driven beside the segment between two places."""

from __future__ import annotations

import math

import pytest

from fasaco_edge.mission.coverage.segments import SHORT_M, beside_m, corner_between
from fasaco_edge.mission.coverage.steady_track import Position

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
