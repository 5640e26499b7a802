"""Docking: what the docking server is asked for, and when."""

import itertools

import pytest

from fasaco_edge.follow.actions import AskResult, CancelGoal, SendGoal
from fasaco_edge.follow.docking import GIVE_UP_S, RESULT_EVERY_S, RETRY_S, Docking, Move
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.nav2_goals import ABORTED, CANCELED, SUCCEEDED, UNKNOWN, DockEnding

DOCK, BEFORE, AWAY = Pose2D(2.0, 0.0), Pose2D(1.5, 0.0), Pose2D(-3.0, 0.0)
DONE = DockEnding(SUCCEEDED, success=True)


class Robot:
    """A robot, its daemon's state, and time."""

    def __init__(self, here=AWAY):
        numbers = itertools.count()
        self.docking = Docking(DOCK, 0.5, lambda: next(numbers).to_bytes(16))
        self.now, self.here, self.state, self.drives = 0.0, here, "covering", True

    def step(self, seconds=1.0):
        self.now += seconds
        return self.docking.step(self.now, self.state, self.here, drives=self.drives)

    def arrive(self, here=BEFORE):
        self.here, self.state, self.drives = here, "charging", False

    def sent(self):
        """Return motion and id of the goal that is sent now."""
        ((move, goal),) = self.step()
        assert isinstance(goal, SendGoal)
        return move, goal.id

    def started(self):
        """Return motion and id of the goal that is sent now, which the server accepts."""
        move, goal_id = self.sent()
        self.docking.take_accepted(goal_id, accepted=True, why="", now=self.now)
        assert self.step() == [(move, AskResult(goal_id))]
        return move, goal_id

    def ends(self, goal, ending=DONE):
        self.docking.take_ending(goal[1], ending, "", self.now)

    def sends_after(self, seconds):
        return any(isinstance(request, SendGoal) for _, request in self.step(seconds))


def cancel(goal):
    return goal[0], CancelGoal(goal[1])


@pytest.fixture
def robot():
    robot = Robot()
    assert robot.step() == []
    assert robot.docking.holds == ""
    return robot


def test_it_docks_from_the_approach_and_undocks_before_driving(robot):
    robot.arrive()
    goal = robot.started()
    assert (goal[0], robot.docking.holds) == (Move.DOCK, "docking")
    robot.here = DOCK
    robot.ends(goal)
    assert robot.step(600.0) == []
    # A path alone does not lead it out: it comes before the status that the robot goes on.
    robot.drives = True
    assert robot.step() == []
    assert robot.docking.holds == "in its dock"
    robot.state = "covering"
    goal = robot.started()
    assert (goal[0], robot.docking.holds) == (Move.UNDOCK, "undocking")
    robot.here = BEFORE
    robot.ends(goal)
    assert robot.step() == []
    assert robot.docking.holds == ""


def test_a_degraded_robot_undocks_only_if_it_may_drive(robot):
    robot.arrive(DOCK)
    goal = robot.started()
    robot.state = "degraded"
    assert robot.step() == []
    robot.ends(goal)
    robot.drives = True
    assert robot.started()[0] is Move.UNDOCK


def test_only_a_robot_started_in_its_dock_undocks_first(robot):
    assert Robot(here=DOCK).sent()[0] is Move.UNDOCK
    for x in (1.9, 2.0, 2.1):
        robot.here = Pose2D(x, 0.0)
        assert robot.step() == []
        assert robot.docking.holds == ""
    # Whoever put it there: the server knows, and says so where it is.
    robot.arrive(Pose2D(DOCK.x + 0.05, DOCK.y, 1.5))
    robot.ends(robot.started(), DockEnding(ABORTED, success=True))
    assert robot.step(600.0) == []


@pytest.mark.parametrize(
    ("ending", "why"),
    [
        (DockEnding(ABORTED, success=False, code=904, message="none"), "904 failed to detect"),
        (DockEnding(UNKNOWN, success=True), "restarted"),
        (None, ""),
    ],
)
def test_an_error_is_reported_and_retried_after_a_pause(robot, ending, why):
    robot.arrive()
    pause_s = RETRY_S
    for _ in range(4):
        robot.ends(robot.started(), ending)
        assert why in robot.docking.trouble
        assert not robot.sends_after(0.9 * pause_s)
        robot.now += 0.2 * pause_s - 1.0
        pause_s *= 2.0
    robot.ends(robot.started())
    assert robot.docking.trouble == ""


def test_a_goal_without_an_answer_is_cancelled_and_sent_again(robot):
    robot.arrive()
    goal = robot.sent()
    robot.docking.take_accepted(goal[1], accepted=None, why="no answer", now=robot.now)
    assert robot.step() == [cancel(goal)]
    assert ("no answer" in robot.docking.trouble, robot.docking.holds) == (True, "")
    assert robot.step() == []
    assert robot.sends_after(RETRY_S)


def test_undocking_that_fails_keeps_the_robot_in_its_dock():
    robot = Robot(here=DOCK)
    robot.ends(robot.started(), DockEnding(ABORTED, success=False, code=905))
    assert robot.step() == []
    assert robot.docking.holds == "in its dock"


@pytest.mark.parametrize("state", ["paused", "covering", "idle"])
def test_docking_that_is_not_wanted_any_more_is_cancelled(robot, state):
    robot.arrive()
    goal = robot.started()
    robot.state = state
    assert robot.step() == [cancel(goal)]
    # Until Nav2 says so, the robot is its.
    assert robot.docking.holds == "docking"
    robot.ends(goal, DockEnding(CANCELED, success=False))
    assert robot.step() == []
    assert (robot.docking.holds, robot.docking.trouble) == ("", "")


def test_a_lost_result_is_requested_again_then_the_goal_given_up(robot):
    robot.arrive()
    goal = robot.started()
    robot.docking.take_silence(goal[1], 1.0, robot.now)
    assert robot.step(RESULT_EVERY_S + 1.0) == [(Move.DOCK, AskResult(goal[1]))]
    assert cancel(goal) in robot.step(GIVE_UP_S)
    assert "did not end" in robot.docking.trouble


def test_at_the_exit_goals_end(robot):
    robot.arrive()
    goal = robot.started()
    assert robot.docking.end() == [cancel(goal)]
    assert robot.docking.end() == []
