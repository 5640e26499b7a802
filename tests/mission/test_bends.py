"""How far a robot may have driven beside the segment between two places."""

from __future__ import annotations

import math

import pytest

from fasaco_edge.mission.coverage.steady_track import SHORT_M, beside_m, corner_between

FAR_M = 100.0


def test_one_that_came_and_went_on_straight_was_on_the_segment():
    assert beside_m((0, 0), (1, 0), (-1, 0), (2, 0), FAR_M) == 0.0
    # It turned at the first place, or at the second.
    assert beside_m((0, 0), (1, 0), (0, 1), (2, 0), FAR_M) == 0.0
    assert beside_m((0, 0), (1, 0), (-1, 0), (1, 1), FAR_M) == 0.0
    assert beside_m((0, 0), (1, 0), None, None, FAR_M) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.5, 0.7])
def test_a_corner_between_two_places_lies_no_farther_beside_them(share):
    """It came along x to the corner at (share, 0), and went on along y."""
    start, end = (0.0, 0.0), (share, 1.0 - share)
    length = math.hypot(*end)
    height = share * (1.0 - share) / length
    away = beside_m(start, end, (-1.0, 0.0), (share, 2.0), FAR_M)
    assert away == pytest.approx(height)
    # Of which one side alone is known, there is no more certainty.
    assert beside_m(start, end, (-1.0, 0.0), None, FAR_M) >= height
    assert beside_m(start, end, None, (share, 2.0), FAR_M) >= height


def test_an_arc_lies_within():
    at = [(math.sin(angle), 1.0 - math.cos(angle)) for angle in (-0.5, 0.0, 0.5, 1.0)]
    before, start, end, after = at
    assert 1.0 - math.cos(0.25) < beside_m(start, end, before, after, FAR_M) < 0.2


def test_it_was_no_farther_away_than_it_can_have_driven():
    there_and_back = (0, 0), (1, 0), (0, 1), (1, 1)
    assert beside_m(*there_and_back, FAR_M) == pytest.approx(0.5 * math.sqrt(FAR_M**2 - 1.0))
    assert beside_m(*there_and_back, 1.25) == pytest.approx(0.375)
    assert beside_m(*there_and_back, 0.5) == math.inf, "faster than it drives"


def test_unknown_speed_or_near_poses_mean_a_straight_drive():
    assert beside_m((0, 0), (1, 0), (0, 1), (1, 1), 0.0) == 0.0
    assert beside_m((0, 0), (SHORT_M, 0), (0, 1), (SHORT_M, 1), FAR_M) == 0.0


def test_headings_tell_where_it_turned_and_that_it_did_not():
    corner = (0.6, 0.0)
    found = corner_between((0.0, 0.0), (0.6, 0.5), (0.0, 0.5 * math.pi), FAR_M)
    assert found == pytest.approx(corner)
    # It cannot have driven round that corner in the time.
    assert corner_between((0.0, 0.0), (0.6, 0.5), (0.0, 0.5 * math.pi), 1.0) is None
    # Headings to one side, or against each other, are no single turn of a base that drives ahead.
    for yaws in ((1.0, 1.0), (0.0, math.pi), (math.pi, 0.0), (math.nan, 0.0)):
        assert corner_between((0.0, 0.0), (0.6, 0.5), yaws, FAR_M) is None
    # Straight on by its headings, though it came and went elsewhere.
    there_and_back = (0, 0), (1, 0), (0, 1), (1, 1)
    assert beside_m(*there_and_back, 1.25, (0.0, 0.0)) == 0.0
    # Headings that contradict the motion say nothing more than the places.
    assert beside_m(*there_and_back, 1.25, (2.0, 2.0)) == pytest.approx(0.375)
