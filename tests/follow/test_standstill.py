"""What a follower says of what keeps the robot from driving: when, how often, in which words."""

import json
import math

import pytest

from fasaco_edge.daemon.loop.inbox import blocked_of
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.standstill import EVERY_S, REASONS, Standstill, Tries, floor_ahead
from fasaco_edge.follow.supervision import FollowerState
from tests.follow.closed_loop import PERIOD_S
from tests.follow.seeing import RADIUS_M, Disc, Seeing
from tests.wire.schemas import check


def reports(seeing, seconds):
    """The reports of so many seconds, with the time since the beginning of each [s]."""
    standstill, found, begun = Standstill(), [], seeing.now
    for _ in range(round(seconds / PERIOD_S)):
        seeing.step()
        if (payload := standstill.report(seeing.follower, "a1", 7, seeing.now)) is not None:
            found.append((seeing.now - begun, payload))
    return found


def test_an_obstacle_ahead_is_reported_each_second_with_place():
    seeing = Seeing([Disc(1.0, 0.0)])
    seeing.send((0.0, 0.0), (4.0, 0.0))
    seeing.run(6.0)
    assert seeing.follower.state is FollowerState.OBSTACLE
    found = reports(seeing, 10.0)
    (first, payload), *more = found
    assert first == pytest.approx(REASONS[FollowerState.OBSTACLE][1], abs=0.2)
    assert len(more) == pytest.approx((10.0 - first) / EVERY_S, abs=1.0)
    check("blocked.json", json.loads(payload))
    event = blocked_of(payload)
    assert (event.revision, event.frame) == (7, "map")
    assert event.detail.startswith("obstacle ahead: something stands 0.0")
    assert event.x == pytest.approx(seeing.pose.x)
    # The near side of the disc, the nearest place first.
    assert event.points[0] == pytest.approx((0.8, 0.0), abs=0.03)
    assert len(event.points) > 5
    assert all(0.75 < x < 1.05 and abs(y) <= 0.2 for x, y in event.points)


def test_a_robot_that_drives_or_is_to_stand_reports_nothing():
    seeing = Seeing()
    seeing.send((0.0, 0.0), (1.0, 0.0))
    assert reports(seeing, 15.0) == []
    seeing.send()
    assert reports(seeing, 10.0) == []
    assert seeing.follower.state is FollowerState.EMPTY_PATH


def test_a_path_that_is_elsewhere_is_reported_without_places():
    seeing = Seeing()
    seeing.send((3.0, 2.0), (4.0, 2.0))
    found = reports(seeing, 5.0)
    assert found[0][0] == pytest.approx(2.0, abs=0.2)
    document = json.loads(found[0][1])
    assert (document["reason"], document["points"]) == ("elsewhere", [])
    check("blocked.json", document)


def test_a_gone_obstacle_ends_the_count():
    seeing = Seeing([Disc(1.0, 0.0)])
    seeing.send((0.0, 0.0), (4.0, 0.0))
    seeing.run(7.0)
    assert seeing.follower.state is FollowerState.OBSTACLE
    person = seeing.discs.pop()
    seeing.run(0.5)
    person.x = seeing.pose.x + 0.9
    seeing.discs.append(person)
    found = reports(seeing, 12.0)
    assert found[0][0] > REASONS[FollowerState.OBSTACLE][1]


def test_the_floor_ahead_of_a_stalled_base_lies_before_its_disc():
    ahead = floor_ahead((1.0, 1.0), 0.0, RADIUS_M)
    assert ahead[0] == pytest.approx((1.0 + RADIUS_M, 1.0))
    assert all(x > 1.0 + 0.7 * RADIUS_M for x, _ in ahead)
    assert floor_ahead((1.0, 1.0), 0.0, 0.0) == ()


@pytest.mark.parametrize(
    "wrong",
    [
        {"reason": "tired"},
        {"points": [[0.0, 0.0]] * 65},
        {"x": 1e9},
        {"held_s": -1.0},
        {"points": [[0.0]]},
        {"detail": "x" * 300},
    ],
    ids=str,
)
def test_reports_beyond_a_limit_are_refused(wrong):
    document = {"daemon": "a1", "revision": 1, "reason": "obstacle", "detail": "", "held_s": 5.0}
    document |= {"frame": "map", "x": 0.0, "y": 0.0, "points": []}
    assert blocked_of(json.dumps(document).encode()).points == ()
    with pytest.raises(MalformedMessage):
        blocked_of(json.dumps(document | wrong).encode())


HERE = (1.0, 2.0)


def tried(times, **limits):
    tries = Tries(**{"far": 0.1, "pause": 2.0, "longest": 30.0} | limits)
    for _ in range(times):
        tries.note_failure(HERE, 0.0, 0.0)
    return tries


@pytest.mark.parametrize(
    ("times", "pause_s"), [(1, 2.0), (2, 4.0), (4, 16.0), (5, 30.0), (5000, 30.0)]
)
def test_each_pause_is_twice_as_long_up_to_the_longest(times, pause_s):
    tries = tried(times)
    assert not tries.may_try(0.0, pause_s - 0.1)
    assert tries.may_try(0.0, pause_s)


def test_the_place_is_that_of_the_first_failure():
    """A robot that creeps on has made progress; one that rocks to and fro has not."""
    tries = tried(0)
    for step in range(10):
        x = 1.0 + 0.09 * (step % 2)
        tries.moved_to((x, 2.0))
        tries.note_failure((x, 2.0), 0.0, 0.0)
    assert tries.tries(0.0) == 10
    tries.moved_to((1.11, 2.0))
    assert tries.tries(0.0) == 0


def test_directions_are_counted_apart_and_bounded():
    tries = tried(3, most=3)
    for turn_deg, is_same in ((-40, True), (10, True), (360, True), (90, False)):
        assert tries.may_try(math.radians(turn_deg), 1e9) is not is_same
    count = 0
    for degree in range(0, 3600, 7):
        while tries.may_try(math.radians(degree), 1e9):
            tries.note_failure(HERE, math.radians(degree), 0.0)
            count += 1
            assert count <= 8 * 3
