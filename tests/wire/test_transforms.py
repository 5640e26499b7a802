"""Transforms into poses: whole chains, and what is not one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import MalformedMessage, TransformLoop
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.limits import MAX_TRANSFORMS
from fasaco_edge.wire.messages.poses import Transform, TransformTree


def link(frame, child, x=0.0, y=0.0, yaw=0.0, stamp_ns=1):
    turn = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return Transform(frame, child, stamp_ns, (x, y, 0.0, *turn))


def matrix(pose):
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([[cos, -sin, pose.x], [sin, cos, pose.y], [0.0, 0.0, 1.0]])


@pytest.fixture
def tree():
    return TransformTree("map", "base_link")


def told(tree, *transforms, is_static=False):
    return tree.take(transforms, is_static=is_static)


metres, turns = st.floats(-100.0, 100.0), st.floats(-math.pi, math.pi)


@given(st.lists(st.builds(Pose2D, metres, metres, turns), min_size=1, max_size=6))
def test_a_chain_is_the_product_of_its_matrices(places):
    frames = ["map", *map(str, range(len(places) - 1)), "base_link"]
    chain = [
        link(frame, child, place.x, place.y, place.yaw)
        for frame, child, place in zip(frames, frames[1:], places, strict=False)
    ]
    stamped = told(TransformTree("map", "base_link"), *reversed(chain))
    expected = np.linalg.multi_dot([np.eye(3), np.eye(3), *map(matrix, places)])
    assert stamped.frame == "map"
    np.testing.assert_allclose(matrix(stamped.pose), expected, atol=1e-9)


def test_there_is_no_pose_until_the_last_link_is_there(tree):
    assert told(tree) is None
    assert told(tree, link("odom", "base_link", 1.0)) is None
    assert told(tree, link("base_link", "laser", 9.0)) is None
    stamped = told(tree, link("map", "odom", 2.0))
    assert stamped.pose == Pose2D(3.0, 0.0, 0.0)


def test_the_stamp_is_that_of_odometry(tree):
    told(tree, link("base_footprint", "base_link", stamp_ns=3), is_static=True)
    told(tree, link("odom", "base_footprint", stamp_ns=20))
    # A localiser may date its link ahead.
    assert told(tree, link("map", "odom", stamp_ns=1000)).stamp_ns == 20
    assert told(tree, link("odom", "base_footprint", stamp_ns=30)).stamp_ns == 30
    still = TransformTree("map", "base_link")
    assert told(still, link("map", "base_link", stamp_ns=7), is_static=True).stamp_ns == 7


def test_transforms_without_news_give_no_pose(tree):
    told(tree, link("map", "odom"), link("odom", "base_link", stamp_ns=1))
    assert told(tree, link("map", "odom", stamp_ns=5)) is None
    assert told(tree, link("base_link", "wheel", yaw=1.0)) is None
    assert told(tree, link("map", "odom", 0.5)).pose.x == 0.5
    assert told(tree, link("odom", "base_link", stamp_ns=2)).stamp_ns == 2


def test_the_oldest_link_that_moves_is_known(tree):
    """What comes again with its stamp is not new, and what is static is never old."""

    def oldest(came_at, *transforms, is_static=False):
        tree.take(transforms, is_static=is_static, came_at=came_at)
        return (tree.oldest.transform.child, tree.oldest.came_at) if tree.oldest else None

    assert oldest(1.0, link("base_footprint", "base_link"), is_static=True) is None
    assert oldest(2.0, link("map", "odom", stamp_ns=1)) is None
    assert oldest(3.0, link("odom", "base_footprint", stamp_ns=1)) == ("odom", 2.0)
    assert oldest(4.0, link("odom", "base_footprint", stamp_ns=2)) == ("odom", 2.0)
    assert oldest(5.0, link("map", "odom", stamp_ns=1)) == ("odom", 2.0)
    assert oldest(6.0, link("map", "odom", stamp_ns=2)) == ("base_footprint", 4.0)
    # No stamp is none that stays.
    assert oldest(7.0, link("odom", "base_footprint", stamp_ns=0)) == ("odom", 6.0)
    assert oldest(8.0, link("map", "odom", stamp_ns=3)) == ("base_footprint", 7.0)
    assert oldest(9.0, link("odom", "base_footprint", stamp_ns=0)) == ("odom", 8.0)


def test_transforms_beside_the_chain_may_be_invalid(tree):
    wheel = Transform("base_link", "wheel", 1, (math.nan,) * 7)
    camera = Transform("base_link", "camera", 1, (0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5))
    assert told(tree, wheel, link("map", "base_link", 1.0), camera).pose.x == 1.0


@pytest.mark.parametrize(
    ("place", "at"),
    [
        (math.nan, 0),
        (math.inf, 1),
        (2.1e7, 2),
        (math.nan, 3),
        (0.3, 4),  # with a norm of 1.04
        (math.inf, 6),
        (0.0, 6),
    ],
)
def test_a_link_with_an_invalid_place_is_refused_and_dropped(tree, place, at):
    told(tree, link("odom", "base_link", 1.0))
    floats = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    floats[at] = place
    with pytest.raises(MalformedMessage, match="of 'odom' in 'map' must be"):
        told(tree, Transform("map", "odom", 1, tuple(floats)))
    assert told(tree, link("odom", "base_link", 2.0)) is None
    assert told(tree, link("map", "odom")).pose.x == 2.0


@pytest.mark.parametrize(("degrees", "is_planar"), [(0, True), (10, True), (22, True), (25, False)])
def test_a_ramp_is_planar_and_a_wall_is_not(tree, degrees, is_planar):
    half = math.radians(degrees) / 2
    ramp = Transform(
        "map", "base_link", 1, (1.0, 2.0, 0.5, 0.0, math.sin(half), 0.0, math.cos(half))
    )
    if is_planar:
        pose = told(tree, ramp).pose
        assert (pose.x, pose.y) == (1.0, 2.0)
        assert pose.yaw == pytest.approx(0.0, abs=1e-12)
    else:
        with pytest.raises(MalformedMessage, match=r"a turn about z \(x and y within 0.2\)"):
            told(tree, ramp)


@pytest.mark.parametrize(
    "links",
    [
        [("base_link", "base_link")],
        [("odom", "base_link"), ("base_link", "odom")],
        [("odom", "base_link"), ("a", "odom"), ("b", "a"), ("a", "b")],
    ],
)
def test_a_loop_is_refused_and_forgotten(tree, links):
    *before, last = links
    assert told(tree, *(link(*each) for each in before)) is None
    with pytest.raises(TransformLoop, match="the transforms of these frames form a loop"):
        told(tree, link(*last))
    assert told(tree, link("map", "odom"), link("odom", "base_link")) is not None


def test_a_loop_beside_the_chain_is_ignored(tree):
    assert told(tree, link("a", "b"), link("b", "a"), link("map", "base_link")) is not None


def test_frames_without_end_are_refused(tree):
    told(tree, link("map", "base_link"))
    told(tree, *(link("map", str(number)) for number in range(MAX_TRANSFORMS - 1)))
    with pytest.raises(MalformedMessage, match="number of frames must be at most 4096"):
        told(tree, link("map", "one"))
    assert told(tree, link("map", "base_link", 1.0)).pose.x == 1.0
