"""The follower drives paths as they are meant, whatever delays, noise and slip there are."""

import math

import numpy as np
import pytest

from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.geometry import Pose2D
from tests.follow.closed_loop import ClosedLoop, ideal_seconds
from tests.simulation.rooms import building, distances_to, serpentine

ROOM = building(6.0, 5.0)
LANES = serpentine(range(2, 9), range(2, 12))
START = Pose2D(*LANES[0])


@pytest.mark.parametrize(
    ("conditions", "off_m"),
    [
        ({"delay_s": 0.0}, 0.02),
        ({"delay_s": 0.05, "jitter_s": 0.02}, 0.02),
        ({"delay_s": 0.1, "jitter_s": 0.05}, 0.025),
        ({"noise": 0.01}, 0.025),
        ({"turn_gain": 0.93}, 0.02),
        ({"pose_hz": 50.0}, 0.02),
        ({"pose_hz": 5.0}, 0.02),
    ],
    ids=str,
)
def test_it_stays_on_the_path_and_beats_stopping_at_corners(conditions, off_m):
    loop = ClosedLoop(ROOM, START, **conditions)
    loop.send(LANES)
    seconds = loop.drive()
    assert loop.world.collisions == 0
    assert distances_to(LANES, loop.trail).max() < off_m
    # And all of it was driven.
    assert distances_to(loop.trail[::5], LANES).max() < off_m + 0.01
    assert seconds < ideal_seconds(ROOM, START, LANES)


@pytest.mark.parametrize("seed", range(3))
def test_cycles_that_come_late_do_not_carry_it_past_its_stops(seed):
    """It braked by a twentieth of a second's worth each cycle, whatever time had passed."""
    loop = ClosedLoop(ROOM, START, late_s=0.12, seed=seed)
    loop.send(LANES)
    seconds = loop.drive()
    assert distances_to(LANES, loop.trail).max() < 0.04
    assert loop.world.collisions == 0
    assert seconds < 1.15 * ideal_seconds(ROOM, START, LANES)


@pytest.mark.parametrize("conditions", [{"delay_s": 0.05}, {"noise": 0.01}], ids=str)
@pytest.mark.parametrize("turn_deg", [10, 30, 60, 90, 120])
def test_a_corner_is_rounded_in_motion_and_hardly_cut(turn_deg, conditions):
    """At each corner of more than a degree it came to rest: a third of a mission went with that."""
    turn = math.radians(turn_deg)
    corner = np.array([2.5, 2.0])
    path = np.stack([(1.0, 2.0), corner, corner + 1.5 * np.array([math.cos(turn), math.sin(turn)])])
    loop = ClosedLoop(ROOM, Pose2D(1.0, 2.0), **conditions)
    loop.send(path)
    slowest = math.inf

    def near_end():
        nonlocal slowest
        if np.hypot(loop.world.pose.x - 1.0, loop.world.pose.y - 2.0) > 0.5:
            slowest = min(slowest, loop.follower._estimate.speed)
        return np.hypot(*(path[-1] - (loop.world.pose.x, loop.world.pose.y))) < 0.3

    loop.run(near_end)
    loop.drive()
    assert slowest > 0.02
    assert distances_to(path, loop.trail).max() < 0.025
    assert distances_to(loop.trail, corner[None]).max() < 0.03
    stops_s = 0.25 / 0.5
    assert loop.now < ideal_seconds(ROOM, Pose2D(1.0, 2.0), path) - 0.8 * stops_s


def test_a_same_path_received_in_a_corner_does_not_stop_it():
    path = [(1, 1), (3, 1), (4, 2), (4, 3)]
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.05)
    loop.send(path)
    loop.run(lambda: loop.world.pose.x > 2.97)
    pose = loop.world.pose
    assert 0.2 < pose.yaw < 0.6
    loop.send([(pose.x, 1), (3, 1), (4, 2), (4, 2.5)])
    before = loop.world.distance_m
    loop.wait(2.0)
    assert loop.world.distance_m - before > 0.9 * 0.25 * 2.0


def test_a_self_crossing_path_is_driven_in_its_order():
    """Each stretch is driven once, in the order of the path: nowhere is it left for another."""
    path = np.array(
        [(1, 1), (4, 1), (4, 3), (2, 3), (2, 0.6), (2.05, 0.6), (2.05, 3), (4, 3.02), (4, 1.02),
         (1, 1.02), (1, 1)]
    )  # fmt: skip
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.05, jitter_s=0.02)
    loop.send(path)
    loop.drive()
    assert loop.world.distance_m == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum(), abs=0.3)
    # Each corner is reached after the one before it, although others lie beside it.
    way, at = loop.trail, 0
    for corner in path:
        near = np.flatnonzero(np.hypot(*(way[at:] - corner).T) < 0.03)
        assert len(near), corner
        at += int(near[0])


def test_a_path_with_the_same_beginning_is_joined_without_a_stop():
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.05)
    loop.send([(1, 1), (5, 1), (5, 4)])
    loop.run(lambda: loop.world.pose.x > 2.0)
    for further in (2.0, 3.0, 4.0):
        pose = loop.world.pose
        loop.send([(pose.x - 0.05, 1), (5, 1), (5, further)])
        before = len(loop.truth_at)
        loop.run(lambda until=before + 100: len(loop.truth_at) > until)
        x = [pose.x for pose in loop.truth_at[before:]]
        assert min(np.diff(x)) > 0.95 * 0.25 * 0.02
    loop.drive()
    assert np.hypot(*(loop.trail[-1] - (5.0, 4.0))) < 0.01


def test_a_corner_that_was_missed_is_driven_back_to():
    """A computer that was busy for half a second: the base drives on meanwhile."""
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.02)
    loop.send([(1, 1), (3, 1), (3, 3)])
    loop.run(lambda: loop.world.pose.x > 2.87)
    step, loop.follower.step = loop.follower.step, lambda now: None
    loop.wait(0.6)
    loop.follower.step = step
    loop.drive()
    way = loop.trail
    assert way[:, 0].max() > 3.04
    # Beside the overshoot nothing is left of the path by more than that.
    assert distances_to(np.array([(1, 1), (3.2, 1), (3, 1), (3, 3)]), way).max() < 0.02


def test_an_unreachable_corner_is_given_up():
    """A path began where the robot turns about: its pose went round that point for minutes."""
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), left_m=0.1, pose_hz=5.0)
    loop.send([(1, 1), (1.02, 1.05), (1, 3), (3, 3)])
    loop.run(lambda: loop.world.pose.y > 1.5, most_s=20.0)
    loop.drive()
    assert loop.now < 60.0


def test_a_path_that_goes_elsewhere_is_joined_from_rest():
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.05)
    loop.send([(1, 1), (5, 1)])
    loop.run(lambda: loop.world.pose.x > 2.0)
    here = loop.world.pose
    path = np.array([(here.x, 1.0), (here.x, 4.0)])
    loop.send(path)
    loop.drive()
    # It comes to rest beside the new path, and drives to it on the shortest way.
    assert loop.trail[:, 0].max() < here.x + 0.1
    assert distances_to(np.vstack(([(1, 1)], [(here.x + 0.1, 1.0)], path)), loop.trail).max() < 0.02
    assert np.hypot(*(loop.trail[-1] - path[-1])) < 0.01


def test_a_path_that_starts_ahead_on_the_old_one_is_joined_there():
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0), delay_s=0.05)
    loop.send([(1, 1), (5, 1), (5, 4)])
    loop.run(lambda: loop.world.pose.x > 4.0)
    path = np.array([(5, 1.5), (5, 3), (2, 3)])
    loop.send(path)
    loop.drive()
    way = np.vstack(([(1, 1), (5, 1)], path))
    assert distances_to(way, loop.trail).max() < 0.02
    assert distances_to(loop.trail, way).max() < 0.03


def test_a_path_that_begins_far_away_is_not_driven_to():
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0))
    loop.send([(3, 3), (4, 3)])
    loop.run(lambda: loop.now > 2.0)
    assert loop.follower.state is FollowerState.PATH_ELSEWHERE
    assert loop.world.distance_m == 0.0
    loop.send([(1.3, 1), (4, 1)])
    loop.drive()


def carry(loop, left_m):
    at = loop.world.pose
    loop.world.drive = type(loop.world.drive)(Pose2D(at.x, at.y + left_m, at.yaw))


def test_a_robot_off_its_path_joins_a_path_that_starts_ahead():
    """It once followed the path it had left, and then stood for good."""
    loop = ClosedLoop(ROOM, Pose2D(1.0, 1.0))
    loop.send([(1, 1), (5, 1)])
    loop.run(lambda: loop.world.pose.x > 2.0)
    while loop.follower.state is not FollowerState.OFF_PATH:
        carry(loop, 0.06)
        loop.wait(0.2)
        assert loop.now < 20.0
    loop.wait(1.0)
    assert loop.world.activity.value == "idle"
    here = loop.world.pose
    loop.send([(here.x + 0.4, 1.0), (5, 1)])
    loop.drive()
