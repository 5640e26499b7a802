"""Goals that follow from paths, poses and answers; time is what the test says."""

import itertools
import math

import numpy as np
import pytest

from fasaco_edge.follow.nav2 import (
    EARLY_M,
    GIVE_UP_S,
    NO_CODE,
    RETRY_S,
    STANDS_S,
    AskResult,
    CancelGoal,
    Nav2Follower,
    SendPiece,
)
from fasaco_edge.follow.pieces import TIP_M
from fasaco_edge.follow.supervision import FollowerState, Patience
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire.messages.nav2_goals import (
    ABORTED,
    CANCELED,
    ERRORS,
    SUCCEEDED,
    UNKNOWN,
    Ending,
    encode_goal,
)
from fasaco_edge.wire.messages.paths import encode_path

NEAR = 0.225
SPEED = 0.5
LONG = ((0.0, 0.0), (8.0, 0.0))
BACK = ((0.0, 0.0), (3.0, 0.0), (0.0, 0.0))
NO_ANSWER = None


class Drive:
    def __init__(self, *points, is_curved=False):
        ids = itertools.count(1)
        self.follower = Nav2Follower(
            NEAR,
            SPEED,
            lambda: next(ids).to_bytes(16, "big"),
            Patience(status_s=1e9),
            is_curved=is_curved,
        )
        self.now = 0.0
        self.follower.take_planner("a1")
        for _ in range(2):
            self.follower.take_heartbeat(0.0)
        if points:
            self.path(*points)

    def path(self, *points):
        xy = np.array(points, np.float64).reshape(-1, 2)
        self.follower.take_path(encode_path(xy, np.zeros(len(xy)), "map", 1))

    def step(self, x, y=0.0, after=0.1):
        """Put the robot somewhere, after so long [s]; return what is asked of Nav2."""
        self.now += after
        self.follower.take_pose(StampedPose(Pose2D(x, y), "map", int(self.now * 1e9)), self.now)
        return self.follower.step(self.now)

    def accept(self, request, accepted=True):
        self.follower.take_accepted(request.id, accepted, "", self.now)

    def end(self, request, status, code=0):
        self.follower.take_ending(request.id, Ending(status, code), "", self.now)

    def begun(self, x=0.0, y=0.0):
        (goal,) = self.step(x, y)
        assert isinstance(goal, SendPiece)
        self.accept(goal)
        assert self.step(x, y) == [AskResult(goal.id)]
        return goal

    @property
    def state(self):
        return self.follower.state


def test_a_goal_begins_where_the_robot_is():
    drive = Drive((0.0, 0.0), (3.0, 0.0))
    (goal,) = drive.step(0.42, 0.05)
    assert goal.points[0] == (pytest.approx(0.42), 0.0)
    assert goal.points[-1] == (3.0, 0.0)
    assert goal.frame == "map"
    assert max(math.dist(a, b) for a, b in itertools.pairwise(goal.points)) <= 0.0501
    # Until there is an answer, nothing else is sent.
    assert drive.step(0.42, 0.05) == []


def test_the_next_goal_is_sent_ahead_and_leads_on():
    far = ((0.0, 0.0), (30.0, 0.0))
    drive = Drive(*far)
    goal = drive.begun()
    sent = []
    for decimetre in range(1, 195):
        sent += [(decimetre / 10, request) for request in drive.step(decimetre / 10)]
    ((at, ahead),) = sent
    assert goal.points[-1][0] == pytest.approx(20.0)
    # Half a metre and three seconds' way before the end.
    assert 17.8 < at < 18.5
    assert ahead.points[0][0] == pytest.approx(at)
    assert ahead.points[-1] == (30.0, 0.0)
    drive.accept(ahead)
    # What it takes the place of ends as aborted; that is no error.
    drive.end(goal, ABORTED)
    assert drive.state is FollowerState.DRIVING


def test_the_one_before_may_end_before_the_next_is_accepted():
    drive = Drive((0.0, 0.0), (30.0, 0.0))
    goal = drive.begun()
    ahead = next(request for step in range(1, 195) for request in drive.step(step / 10))
    drive.end(goal, ABORTED)
    asked = drive.step(19.5)
    drive.accept(ahead)
    assert asked + drive.step(19.6) == [AskResult(ahead.id)]


def test_at_a_reversal_the_next_goal_starts_just_before_the_turn():
    drive = Drive(*BACK)
    goal = drive.begun()
    assert goal.points[-1] == (3.0, 0.0)
    sent = []
    for centimetre in range(1, 296):
        sent += [(centimetre / 100, request) for request in drive.step(centimetre / 100)]
    ((at, back),) = sent
    # Of the way to the turn a controller that goes on at the way back leaves out no more than that.
    assert back.points[0] == (pytest.approx(3.0 - TIP_M), 0.0)
    assert at == pytest.approx(3.0 - TIP_M - EARLY_M, abs=0.011)
    assert (3.0, 0.0) in back.points
    assert back.points[-1] == (0.0, 0.0)


def test_a_goal_ends_with_the_heading_in_which_the_path_leads_on():
    drive = Drive((0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (3.0, 2.0))
    goal = drive.begun()
    # The robot turns back there, and does while the next goal is under way.
    assert goal.points[-1] == (3.0, 4.0)
    assert goal.end_yaw == pytest.approx(-math.pi / 2)
    for place in ((1.5, 0.0), (3.0, 0.0), (3.0, 1.5), (3.0, 3.0)):
        drive.step(*place)
    (back,) = drive.step(3.0, 3.9)
    assert back.points[-1] == (3.0, 2.0)
    assert back.end_yaw is None


def test_at_a_closing_loop_the_next_goal_starts_earlier():
    # A circle of 1.9 m: the goal ends where it closes; the next one begins on its far side.
    angles = [math.tau * part / 24 for part in range(25)]
    circle = [(3.0 + 0.3 * math.sin(angle), 0.3 - 0.3 * math.cos(angle)) for angle in angles]
    drive = Drive((0.0, 0.0), *circle, (6.0, 0.0))
    goal = drive.begun()
    assert math.dist(goal.points[-1], (3.0, 0.0)) < 0.4
    places = [(x / 20, 0.0) for x in range(1, 60)] + circle
    ((at, ahead),) = [(place, request) for place in places for request in drive.step(*place)]
    assert math.dist(ahead.points[0], at) < 0.05
    assert math.dist(at, (3.0, 0.6)) < 0.3
    assert ahead.points[-1] == (6.0, 0.0)


def test_the_next_goal_is_sent_even_if_the_last_bend_was_cut():
    # Nav2 is done by the distance to the end, wherever along the goal the robot is.
    drive = Drive((0.0, 0.0), (3.0, 0.0), (3.1, 0.1), (3.0, 0.2), (3.0, -3.0))
    assert drive.begun().points[-1] == (3.0, 0.2)
    for x in (1.0, 2.0, 2.8, 2.9):
        assert drive.step(x) == []
    (back,) = drive.step(2.98, 0.06)
    assert back.points[-1] == (3.0, -3.0)


def test_before_a_short_rest_the_next_goal_waits_for_the_end():
    drive = Drive((0.0, 0.0), (3.0, 0.0), (2.8, 0.0))
    goal = drive.begun()
    for step in range(1, 300):
        assert drive.step(step / 100) == []
    drive.end(goal, SUCCEEDED)
    (back,) = drive.step(2.95)
    assert back.points[0] == (3.0, 0.0)
    assert back.points[-1] == (pytest.approx(2.8), 0.0)
    drive.accept(back)
    drive.step(2.8)
    drive.end(back, SUCCEEDED)
    assert drive.step(2.8) == []
    assert drive.state is FollowerState.DRIVEN


def test_a_goal_that_is_done_too_early_is_not_believed():
    drive = Drive(*LONG)
    goal = drive.begun()
    drive.step(0.2)
    drive.end(goal, SUCCEEDED)
    assert drive.step(0.2) == []
    assert drive.state is FollowerState.GIVEN_UP
    assert "reported as done 7.8 m before the end" in drive.follower.detail
    (again,) = drive.step(0.2, after=RETRY_S)
    assert again.points[0][0] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("code", "said"), [*((code, f"{code} {name}") for code, name in ERRORS.items()), (0, NO_CODE)]
)
def test_errors_of_goals_are_named(code, said):
    drive = Drive(*LONG)
    goal = drive.begun()
    drive.end(goal, ABORTED, code)
    assert drive.step(0.0) == []
    assert drive.state is FollowerState.GIVEN_UP
    assert drive.follower.detail == said


@pytest.mark.parametrize("goes_on", ["elsewhere", "withdrawn", "moved"])
def test_a_goal_cancelled_by_others_stays_cancelled(goes_on):
    drive = Drive(*LONG)
    drive.end(drive.begun(), CANCELED)
    assert drive.step(0.0, after=100.0) == []
    for number in range(20):
        drive.path((0.0, 0.0), (8.0, 0.01 * number))
        assert drive.step(0.0) == []
        assert drive.state is FollowerState.CANCELED
    if goes_on == "withdrawn":
        drive.path()
        drive.step(0.0)
        drive.path(*LONG)
    elif goes_on == "elsewhere":
        drive.path((0.0, 0.0), (0.0, 8.0))
    (goal,) = drive.step(0.6 if goes_on == "moved" else 0.0)
    assert isinstance(goal, SendPiece)


def test_a_new_path_the_same_way_does_not_shorten_the_pause():
    """As with a changing map: after four errors the pause is 8 s, whichever path comes."""
    drive, sent = Drive(*LONG), []
    for number in range(300):
        drive.path((0.0, 0.0), (8.0, 0.001 * number))
        for request in drive.step(0.0):
            if isinstance(request, SendPiece):
                sent.append(drive.now)
                drive.accept(request)
                drive.end(request, ABORTED, 105)
    pauses = [after - before for before, after in itertools.pairwise(sent)]
    assert pauses == pytest.approx([1.0, 2.0, 4.0, 8.0], abs=0.15)
    drive.path((0.0, 0.0), (0.0, 8.0))
    (goal,) = drive.step(0.0)
    assert isinstance(goal, SendPiece)


def test_replaced_goals_do_not_extend_a_blocked_robots_tries():
    """Each path differs, so that Nav2 gets it at once and restarts its progress checker."""
    drive, canceled_at = Drive(*LONG), None
    while canceled_at is None and drive.now < 3 * GIVE_UP_S:
        drive.path((0.0, 0.0), (8.0, 0.5 * (round(drive.now / 2.0) % 2)))
        for request in drive.step(0.0):
            if isinstance(request, SendPiece):
                drive.accept(request)
            elif isinstance(request, CancelGoal):
                canceled_at = drive.now
    assert canceled_at == pytest.approx(GIVE_UP_S, abs=1.0)
    drive.step(0.0)
    assert drive.state is FollowerState.GIVEN_UP


def accepted(value, why=""):
    return lambda follower, goal_id: follower.take_accepted(goal_id, value, why, 0.0)


@pytest.mark.parametrize(
    ("answer", "state", "said", "cancels"),
    [
        # Nav2 may have taken it, and drive.
        (accepted(None, "no answer"), FollowerState.NO_NAV2, "no answer", True),
        (accepted(False), FollowerState.REFUSED, "is its controller server active?", False),
        (
            lambda f, goal_id: f.take_unsent(goal_id, "none", 0.0),
            FollowerState.NO_NAV2,
            "none",
            False,
        ),
    ],
)
def test_a_goal_that_is_not_taken_is_another_goal_later(answer, state, said, cancels):
    drive = Drive(*LONG)
    (goal,) = drive.step(0.0)
    answer(drive.follower, goal.id)
    assert drive.step(0.0) == ([CancelGoal(goal.id)] if cancels else [])
    assert (drive.state, drive.follower.detail) == (state, said)
    (again,) = drive.step(0.0, after=RETRY_S)
    assert isinstance(again, SendPiece)
    assert again.id != goal.id


@pytest.mark.parametrize("ending", [Ending(UNKNOWN), NO_ANSWER])
def test_a_restarted_server_gets_the_goal_again(ending):
    drive = Drive(*LONG)
    goal = drive.begun()
    drive.step(1.0)
    drive.follower.take_ending(goal.id, ending, "went away", drive.now)
    # It may be the way to it that is lost: then it drives on.
    assert drive.step(1.0) == ([CancelGoal(goal.id)] if ending is NO_ANSWER else [])
    assert drive.state is FollowerState.NO_NAV2
    again = drive.step(1.0, after=RETRY_S)[0]
    assert isinstance(again, SendPiece)
    assert again.points[0][0] == pytest.approx(1.0)


def test_a_driven_goal_counts_as_accepted_if_the_answer_was_lost():
    drive = Drive(*LONG)
    (goal,) = drive.step(0.0)
    asked = [drive.step(decimetre / 10) for decimetre in range(1, 30)]
    assert [request for requests in asked for request in requests] == [AskResult(goal.id)]
    drive.follower.take_accepted(goal.id, None, "did not answer", drive.now)
    # It is neither canceled nor sent again from where the robot was.
    assert drive.step(3.0) == []
    assert drive.state is FollowerState.DRIVING
    drive.end(goal, ABORTED, 105)
    drive.step(3.0)
    (again,) = drive.step(3.0, after=RETRY_S + 0.1)
    assert again.points[0][0] == pytest.approx(3.0)


def test_a_driven_short_goal_ends_though_its_answer_was_lost():
    drive = Drive((0.0, 0.0), (0.4, 0.0))
    (goal,) = drive.step(0.0)
    asked = [request for x in (0.1, 0.2, 0.3, 0.4) for request in drive.step(x)]
    assert asked == [AskResult(goal.id)]
    drive.end(goal, SUCCEEDED)
    assert drive.step(0.4) == []
    assert drive.state is FollowerState.DRIVEN


def test_a_path_that_is_the_same_ahead_changes_no_goal():
    drive = Drive((0.0, 0.0), (8.0, 0.0), (8.0, 2.0))
    goal = drive.begun()
    drive.step(1.0)
    # From where the robot was a while ago, and with another end.
    drive.path((0.9, 0.01), (8.0, 0.0), (8.0, 2.0), (4.0, 2.0))
    assert drive.step(1.1) == []
    for step in range(11, 80):
        assert drive.step(step / 10) == [], step
    (ahead,) = [r for step in range(1, 19) for r in drive.step(8.0, step / 10)]
    assert ahead.points[-1] == (4.0, 2.0)
    assert goal.id != ahead.id


@pytest.mark.parametrize("turn", [2.0, 7.9])
def test_a_path_that_is_another_one_ahead_replaces_the_goal(turn):
    drive = Drive(*LONG)
    drive.begun()
    drive.step(1.0)
    drive.path((0.9, 0.0), (turn, 0.0), (turn, 3.0))
    (goal,) = drive.step(1.1)
    assert isinstance(goal, SendPiece)
    assert goal.points[0] == (pytest.approx(1.1), 0.0)
    assert goal.points[-1] == (turn, 3.0)


def test_a_path_that_begins_elsewhere_is_not_driven():
    drive = Drive(*LONG)
    goal = drive.begun()
    drive.path((0.0, 5.0), (8.0, 5.0))
    assert drive.step(0.0) == [CancelGoal(goal.id)]
    assert drive.state is FollowerState.PATH_ELSEWHERE


@pytest.mark.parametrize("answered", [True, False])
def test_an_empty_path_cancels_what_there_is_and_so_does_the_end(answered):
    drive = Drive(*LONG)
    goal = drive.begun() if answered else drive.step(0.0)[0]
    drive.path()
    assert drive.step(0.1) == [CancelGoal(goal.id)]
    assert drive.state is FollowerState.EMPTY_PATH
    assert drive.step(0.1, after=1.0) == []
    drive.path(*LONG)
    (again,) = drive.step(0.1)
    assert drive.follower.end() == [CancelGoal(again.id)]


def test_an_old_pose_cancels_the_goal_and_a_new_one_resends_it():
    drive = Drive(*LONG)
    goal = drive.begun()
    drive.now += 1.0
    assert drive.follower.step(drive.now) == [CancelGoal(goal.id)]
    assert drive.state is FollowerState.OLD_POSE
    (again,) = drive.step(0.3)
    assert again.points[0][0] == pytest.approx(0.3)


@pytest.mark.parametrize("noise_m", [0.0, 0.04])
def test_a_controller_that_stands_is_asked_and_then_given_up(noise_m):
    drive, rng = Drive(*LONG), np.random.default_rng(0)
    drive.begun()
    drive.step(0.5)
    requests, said = [], set()
    while drive.now < GIVE_UP_S + 6.0:
        x, y = rng.normal((0.5, 0.0), noise_m)
        requests += [type(request) for request in drive.step(x, y, after=0.05)]
        if drive.now > STANDS_S + 1.0:
            said.add(drive.state)
    # The result may have been lost.
    assert requests.count(AskResult) >= 4
    assert requests.count(CancelGoal) >= 1
    assert {FollowerState.STANDS, FollowerState.GIVEN_UP} <= said
    assert requests.count(SendPiece) == 1


def test_a_piece_ends_at_a_change_of_direction():
    drive = Drive((0.0, 0.0), (3.0, 0.0), (1.0, 0.3), (4.0, 0.6), is_curved=True)
    goal = drive.begun()
    assert (goal.points[-1], goal.is_back, goal.end_yaw) == ((3.0, 0.0), False, None)
    # It waits for the end: Nav2 would switch before the robot is there.
    for x in (1.0, 2.0, 2.6, 2.9, 2.99):
        assert drive.step(x) == []
    drive.end(goal, SUCCEEDED)
    (back,) = drive.step(3.0)
    assert (back.points[0], back.points[-1], back.is_back) == ((3.0, 0.0), (1.0, 0.3), True)
    drive.accept(back)
    drive.step(3.0)
    drive.step(2.0, 0.15)
    drive.step(1.0, 0.3)
    drive.end(back, SUCCEEDED)
    (ahead,) = drive.step(1.0, 0.3)
    assert (ahead.points[0], ahead.points[-1], ahead.is_back) == ((1.0, 0.3), (4.0, 0.6), False)


def test_a_path_may_begin_backward_and_lead_on_so():
    drive = Drive((3.0, 0.0), (-20.0, 0.0), is_curved=True)
    (goal,) = drive.step(3.0)
    assert goal.is_back
    # A piece is at most 20 m long: the next one goes on backward.
    assert goal.points[-1] == (pytest.approx(-17.0), 0.0)
    assert goal.end_yaw == pytest.approx(0.0)


def test_poses_of_a_backward_goal_face_away_from_their_way():
    points = [(1.0, 0.0), (0.0, 0.0)]
    facing = encode_goal(bytes(16), points, "map", 0, ())
    away = encode_goal(bytes(16), points, "map", 0, (), is_back=True)
    turned = encode_goal(bytes(16), points, "map", 0, (), end_yaw=0.0)
    assert facing != away
    # As of poses with yaw 0: both end with the same pose.
    assert away[-56:] == turned[-56:]
