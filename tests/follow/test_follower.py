"""Why the robot stands: each thing that the follower takes has to be there."""

import math
from dataclasses import replace
from itertools import groupby

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.estimate import STAND, moved
from fasaco_edge.follow.follower import ZEROS_S, Follower
from fasaco_edge.follow.grip import REST_S
from fasaco_edge.follow.supervision import FollowerState, Patience
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from tests.follow.closed_loop import LIMITS, PERIOD_S, path_message

AHEAD = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)]


class Told:
    def __init__(self):
        self.now = 10.0
        self.begin_anew(AHEAD)
        self.drive(1.0)
        assert self.follower.state is FollowerState.DRIVING

    def begin_anew(self, xy, limits=LIMITS):
        self.x = 0.0
        self.follower = Follower(limits)
        self.follower.take_planner("a1")
        self.follower.take_heartbeat(self.now)
        self.follower.take_path(path_message(xy))
        self.pose()

    def pose(self, x=None, y=0.0, yaw=0.0, frame="map", stamp_ns=0):
        where = Pose2D(self.x if x is None else x, y, yaw)
        self.follower.take_pose(StampedPose(where, frame, stamp_ns), self.now)

    def refuse_pose(self, why):
        self.follower.pose_fault = MalformedMessage(why)

    def states_where_it_is(self, seconds):
        states = []
        for _ in range(round(seconds / PERIOD_S)):
            self.pose()
            self.step()
            states.append(self.follower.state)
        return states

    def step(self, *, status=True):
        self.now += PERIOD_S
        if status:
            self.follower.take_heartbeat(self.now)
        return self.follower.step(self.now)

    def speed_after(self, seconds):
        self.drive(seconds)
        self.pose()
        return self.step().speed

    def drive(self, seconds):
        for _ in range(round(seconds / PERIOD_S)):
            self.pose()
            command = self.step()
            self.x += (command or STAND).speed * PERIOD_S


def path_of(payload):
    return lambda told: told.follower.take_path(payload)


@pytest.fixture
def told():
    return Told()


NAN = bytes.fromhex("000000000000f87f")
PATH = path_message(AHEAD)
STOPS = {
    "an empty path": (path_of(path_message([])), FollowerState.EMPTY_PATH, "mission status"),
    "no path": (path_of(b""), FollowerState.BAD_PATH, "encapsulation header"),
    "a short path": (path_of(PATH[:-1]), FollowerState.BAD_PATH, "poses"),
    "a long path": (path_of(PATH + b"junk"), FollowerState.BAD_PATH, "payload"),
    "NaN": (path_of(PATH[:-8] + NAN), FollowerState.BAD_PATH, "orientation"),
    "another frame": (lambda told: told.pose(frame="odom"), FollowerState.WRONG_FRAME, "'odom'"),
    "a jump": (lambda told: told.pose(y=2.0), FollowerState.POSE_JUMPED, "by 2.0 m"),
    "a turn": (lambda told: told.pose(yaw=2.5), FollowerState.POSE_JUMPED, "by 0.0 m and 14"),
    "no pose": (lambda told: told.refuse_pose("got nan"), FollowerState.BAD_POSE, "got nan"),
    "no planner": (lambda told: told.follower.take_planner(""), FollowerState.NO_DAEMON, ""),
}


@pytest.mark.parametrize(("act", "state", "words"), STOPS.values(), ids=STOPS)
def test_it_stands_with_a_reason_and_drives_on_afterwards(told, act, state, words):
    told.drive(1.0)
    command = told.step()
    assert (command.speed, told.follower.state) == (LIMITS.speed, FollowerState.DRIVING)
    assert abs(command.turn_rate) < 1e-6
    act(told)
    assert told.step() == STAND
    assert told.follower.state is state
    assert words in told.follower.detail
    told.follower.take_planner("a1")
    told.follower.take_path(path_message([(told.x, 0.0), (5.0, 0.0)]))
    told.drive(0.5)
    assert told.follower.state is FollowerState.DRIVING


def test_zeros_are_sent_for_a_second_and_then_nothing(told):
    told.follower.take_path(path_message([]))
    zeros = 0
    while told.step() == STAND:
        zeros += 1
    assert zeros * PERIOD_S == pytest.approx(ZEROS_S, abs=1.5 * PERIOD_S)
    assert told.step() is None


@pytest.mark.parametrize("how", ["empty", "refused", "another planner"])
def test_a_path_that_was_withdrawn_is_not_driven_to_the_next_one(told, how):
    """The robot was braking for a path beside it when both were withdrawn."""
    told.drive(2.0)
    told.follower.take_path(path_message([(told.x, 0.3), (told.x, 3.0)]))
    told.drive(0.1)
    assert told.follower.state is FollowerState.DRIVING
    if how == "another planner":
        told.follower.take_planner("b2")
    else:
        told.follower.take_path(path_message([]) if how == "empty" else b"")
    told.drive(3.0)
    x = told.x
    told.follower.take_path(path_message([(x + 1.5, 0.0), (x + 1.5, 3.0)]))
    told.drive(3.0)
    assert told.follower.state is FollowerState.PATH_ELSEWHERE
    assert told.x == x


def test_a_path_may_begin_exactly_where_the_robot_stands(told):
    """And have a corner, 0.25 m away, that the robot was driving to."""
    told.begin_anew([(0.0, 0.0), (3.0, 0.25)])
    told.step()
    told.follower.take_path(path_message([(0.0, 0.0), (0.0, 0.25), (3.0, 0.25)]))
    # So late nothing moves the pose on.
    told.now += 3.0
    told.pose()
    assert told.step() is not None
    assert told.follower.state is FollowerState.DRIVING


@pytest.mark.parametrize(
    ("silent", "limit_s", "state"),
    [
        ("pose", Patience().pose_s, FollowerState.OLD_POSE),
        ("status", Patience().status_s, FollowerState.SILENT_DAEMON),
    ],
)
def test_an_input_that_falls_silent_stops_it_until_the_next(told, silent, limit_s, state):
    since = told.now
    while told.follower.state is FollowerState.DRIVING:
        if silent == "status":
            told.pose()
        command = told.step(status=silent == "pose")
        told.x += (command or STAND).speed * PERIOD_S
    assert told.follower.state is state
    assert told.now - since == pytest.approx(limit_s, abs=2 * PERIOD_S)
    told.pose()
    assert told.step().speed > 0.0


@pytest.mark.parametrize(("x", "y", "yaw"), [(None, 2.0, 0.0), (5.0, 2.0, math.pi / 2)])
def test_a_pose_that_jumps_is_believed_if_it_stays(told, x, y, yaw):
    """Beside the path, where the robot stands; a jump to its second leg does not skip the first."""
    told.pose(x=told.x, y=2.0)
    assert told.step() == STAND
    # Back again: a localiser that erred once.
    told.pose()
    assert told.step().speed > 0.0
    for _ in range(10):
        told.pose(x=x, y=y, yaw=yaw)
        assert told.step() == STAND
    assert told.follower.state is FollowerState.OFF_PATH


def test_after_a_change_of_planner_it_resumes_with_two_statuses_and_its_path(told):
    told.follower.take_planner("")
    told.step()
    told.follower.take_planner("a1")
    told.pose()
    # The first status after that may be a cached one.
    assert told.step() == STAND
    assert told.follower.state is FollowerState.SILENT_DAEMON
    assert told.step().speed > 0.0
    told.follower.take_planner("b2")
    told.drive(0.2)
    assert told.follower.state is FollowerState.NO_PATH
    told.follower.take_path(path_message([(told.x, 0.0), (5.0, 0.0)]))
    told.pose()
    assert told.step().speed > 0.0


def pushed_s(states):
    return states.count(FollowerState.DRIVING) * PERIOD_S


def test_after_a_few_tries_it_stands_until_it_is_moved(told):
    """A localiser that says the same pose for ever must not make it drive blind for ever."""
    states = told.states_where_it_is(60.0)
    assert {*states[-900:]} == {FollowerState.NOT_MOVING}
    assert 2.0 < pushed_s(states) < 8.0
    assert told.follower.detail == "tried 3 times"
    # The pauses between the tries become longer.
    rests = [len(list(run)) for state, run in groupby(states) if state is FollowerState.NOT_MOVING]
    assert rests[0] * PERIOD_S == pytest.approx(REST_S, abs=0.2)
    assert rests[1] * PERIOD_S == pytest.approx(2 * REST_S, abs=0.2)
    told.x += 0.15
    told.drive(5.0)
    assert told.follower.state is FollowerState.DRIVING
    assert told.x > 1.0


@pytest.mark.parametrize("every_s", [0.2, 1.0, 5.0, 30.0])
def test_a_path_that_comes_again_brings_no_more_tries(told, every_s):
    """As with a map that changes, or the daemon's own repeat: it differs a little each time."""
    pushed = 0.0
    for number in range(round(120.0 / every_s)):
        beside = 0.03 * (number % 3 - 1)
        told.follower.take_path(path_message([(told.x, beside), (told.x + 5.0, -beside)]))
        pushed += pushed_s(told.states_where_it_is(every_s))
    # Where each path has it brake first, it takes longer to push as far.
    assert 2.0 < pushed < (8.0 if every_s >= 1.0 else 15.0)
    assert told.follower.state is FollowerState.NOT_MOVING


def test_each_new_direction_gets_exactly_three_tries(told):
    """A stuck robot that gets paths to all sides tries each of them three times."""
    ways, pushed = [(5.0, 0.0), (0.0, 5.0), (-5.0, 0.0), (0.0, -5.0)], 0.0
    told.states_where_it_is(30.0)
    assert told.follower.state is FollowerState.NOT_MOVING
    for round_ in range(3):
        for number, (dx, dy) in enumerate(ways):
            told.follower.take_path(path_message([(told.x, 0.0), (told.x + dx, dy)]))
            states = told.states_where_it_is(30.0)
            is_new = round_ == 0 and number > 0
            assert (FollowerState.DRIVING in states) is is_new
            pushed += pushed_s(states)
    assert pushed < 3 * 8.0
    # A way out of there ends that.
    told.x += 0.15
    told.follower.take_path(path_message([(told.x, 0.0), (told.x + 5.0, 0.0)]))
    told.drive(2.0)
    assert told.follower.state is FollowerState.DRIVING


def test_a_robot_that_is_turned_by_hand_tries_again(told):
    told.states_where_it_is(30.0)
    for step in range(80):
        told.pose(yaw=min(0.02 * step, 0.8))
        told.step()
    assert told.follower.state is FollowerState.DRIVING


@pytest.mark.parametrize(
    ("speed", "turn_deg_s", "xy"),
    [(0.09, 60.0, [(0.0, 0.0), (5.0, 0.0)]), (0.3, 25.0, [(0.0, 0.0), (0.0, 5.0)])],
)
def test_a_slow_robot_that_does_not_move_is_detected(told, speed, turn_deg_s, xy):
    limits = replace(LIMITS, speed=speed, turn_rate=math.radians(turn_deg_s))
    told.begin_anew(xy, limits)
    assert FollowerState.NOT_MOVING in told.states_where_it_is(3.5)


def test_a_delayed_start_after_a_rest_is_not_a_stall(told):
    """A fast robot with delayed poses should have moved far before they can show it."""
    told.begin_anew(AHEAD, replace(LIMITS, speed=2.0, acceleration=4.0))
    told.follower.take_path(path_message([]))
    told.states_where_it_is(30.0)
    told.follower.take_path(path_message(AHEAD))
    assert {*told.states_where_it_is(0.5)} == {FollowerState.DRIVING}


def test_a_pose_with_an_old_stamp_does_not_count_as_new(told):
    for _ in range(round(1.0 / PERIOD_S)):
        told.pose(stamp_ns=7)
        command = told.step()
    assert command in (STAND, None)
    assert told.follower.state is FollowerState.OLD_POSE
    assert "with the same stamp" in told.follower.detail
    told.pose(stamp_ns=8)
    assert told.step().speed > 0.0


def test_it_stands_before_anything_has_come():
    follower = Follower(LIMITS)
    assert follower.step(0.0) is None
    assert follower.state is FollowerState.NO_DAEMON
    follower.take_planner("a1")
    follower.take_heartbeat(0.1)
    assert follower.step(0.1) is None
    assert (follower.state, follower.detail) == (FollowerState.SILENT_DAEMON, "no status yet")
    follower.take_heartbeat(0.1)
    assert follower.step(0.1) is None
    assert follower.state is FollowerState.NO_PATH
    follower.take_path(path_message(AHEAD))
    assert follower.step(0.2) is None
    assert follower.state is FollowerState.NO_POSE


def test_commands_keep_the_limits(told):
    """Through a path of many corners, speeds and their changes are within what the base can do."""
    corners = [(told.x, 0.0), (told.x + 1.0, 0.0), (told.x, 0.3), (told.x + 1.0, 0.6)]
    told.follower.take_path(path_message(corners))
    last, where = told.step(), Pose2D(told.x, 0.0)
    while told.follower.state is FollowerState.DRIVING:
        told.pose(where.x, where.y, where.yaw)
        command = told.step() or STAND
        assert 0.0 <= command.speed <= LIMITS.speed
        assert abs(command.turn_rate) <= LIMITS.turn_rate + 1e-9
        if told.follower.state is FollowerState.DRIVING:
            assert abs(command.speed - last.speed) <= LIMITS.acceleration * PERIOD_S + 1e-9
            change = abs(command.turn_rate - last.turn_rate)
            assert change <= LIMITS.turn_acceleration * PERIOD_S + 1e-9
        last, where = command, moved(where, command, PERIOD_S)
    assert told.follower.state is FollowerState.DRIVEN


def test_a_path_with_a_speed_is_followed_no_faster(told):
    told.follower.take_path(path_message(AHEAD), 0.4 * LIMITS.speed)
    speeds = [told.speed_after(1.0)]
    told.follower.take_path(path_message(AHEAD))
    speeds.append(told.speed_after(1.0))
    assert speeds == pytest.approx([0.4 * LIMITS.speed, LIMITS.speed])
