"""Docking: what the docking server is asked for, and when."""

import itertools

import pytest

from fasaco_edge.follow.docking import (
    GIVE_UP_S,
    RESULT_EVERY_S,
    RETRY_S,
    Ask,
    Cancel,
    Docking,
    Move,
    Start,
)
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.docking import DockEnding
from fasaco_edge.wire.messages.follow_path import ABORTED, CANCELED, SUCCEEDED, UNKNOWN

DOCK, BEFORE, AWAY = Pose2D(2.0, 0.0), Pose2D(1.5, 0.0), Pose2D(-3.0, 0.0)
DONE = DockEnding(SUCCEEDED, success=True)


class Robot:
    """A robot, its daemon's state, and time."""

    def __init__(self, here=AWAY):
        self.numbers = itertools.count()
        self.docking = Docking(DOCK, 0.5, lambda: next(self.numbers).to_bytes(16))
        self.now, self.here, self.state, self.drives = 0.0, here, "covering", True

    def step(self, seconds=1.0):
        self.now += seconds
        return self.docking.step(self.now, self.state, self.here, drives=self.drives)

    def arrive(self):
        self.here, self.state, self.drives = BEFORE, "charging", False

    def goes_on(self):
        self.state, self.drives = "covering", True

    def started(self):
        """Return the goal that is sent now, which the server accepts."""
        (start,) = self.step()
        assert isinstance(start, Start)
        self.docking.take_accepted(start.id, accepted=True, why="", now=self.now)
        assert self.step() == [Ask(start.move, start.id)]
        return start

    def ends(self, start, ending):
        self.docking.take_ending(start.id, ending, "", self.now)


@pytest.fixture
def robot():
    robot = Robot()
    assert robot.step() == []
    assert robot.docking.holds == ""
    return robot


def test_it_docks_from_the_approach_and_undocks_before_driving(robot):
    robot.arrive()
    start = robot.started()
    assert start.move is Move.DOCK
    assert robot.docking.holds == "docking"
    robot.here = DOCK
    robot.ends(start, DONE)
    assert robot.step(600.0) == []
    robot.goes_on()
    start = robot.started()
    assert start.move is Move.UNDOCK
    assert robot.docking.holds == "undocking"
    robot.here = BEFORE
    robot.ends(start, DONE)
    assert robot.step() == []
    assert robot.docking.holds == ""


def test_a_path_alone_does_not_lead_it_out(robot):
    """It comes before the status that says that the robot goes on."""
    robot.arrive()
    robot.ends(robot.started(), DONE)
    robot.drives = True
    assert robot.step() == []
    assert robot.docking.holds == "in its dock"


def test_a_degraded_robot_that_may_drive_leaves_its_dock(robot):
    robot.arrive()
    robot.here = DOCK
    robot.ends(robot.started(), DONE)
    robot.drives, robot.state = True, "degraded"
    assert robot.started().move is Move.UNDOCK


def test_docking_goes_on_though_something_is_wrong(robot):
    robot.arrive()
    robot.started()
    robot.state = "degraded"
    assert robot.step() == []


def test_a_robot_that_is_switched_on_in_its_dock_undocks_first():
    robot = Robot(here=DOCK)
    (start,) = robot.step()
    assert start.move is Move.UNDOCK


def test_one_that_passes_its_dock_later_does_not():
    robot = Robot()
    robot.step()
    for x in (1.9, 2.0, 2.1):
        robot.here = Pose2D(x, 0.0)
        assert robot.step() == []
        assert robot.docking.holds == ""


def test_a_robot_at_the_docks_place_need_not_be_docked(robot):
    """Whoever put it there: the server knows, and says so where it is."""
    robot.arrive()
    robot.here = Pose2D(DOCK.x + 0.05, DOCK.y, 1.5)
    (start,) = robot.step()
    assert start.move is Move.DOCK


def test_what_was_done_already_is_done(robot):
    robot.arrive()
    robot.ends(robot.started(), DockEnding(ABORTED, success=True))
    assert robot.step(600.0) == []


@pytest.mark.parametrize(
    ("ending", "why"),
    [
        (
            DockEnding(ABORTED, success=False, code=904, message="no markers"),
            "904 failed to detect",
        ),
        (DockEnding(UNKNOWN, success=True), "restarted"),
        (None, ""),
    ],
)
def test_an_error_is_told_and_tried_again_after_a_while(robot, ending, why):
    robot.arrive()
    pause_s = RETRY_S
    for _ in range(4):
        robot.ends(robot.started(), ending)
        assert why in robot.docking.trouble
        assert not any(isinstance(one, Start) for one in robot.step(0.9 * pause_s))
        robot.now += 0.2 * pause_s - 1.0
        robot.docking.take_cancelled((0).to_bytes(16), 0)
        for number in range(8):
            robot.docking.take_cancelled(number.to_bytes(16), 0)
        pause_s *= 2.0
    robot.ends(robot.started(), DONE)
    assert robot.docking.trouble == ""


def test_a_goal_without_an_answer_is_cancelled_and_sent_again(robot):
    robot.arrive()
    (start,) = robot.step()
    robot.docking.take_accepted(start.id, accepted=None, why="no answer", now=robot.now)
    assert Cancel(Move.DOCK, start.id) in robot.step()
    assert "no answer" in robot.docking.trouble
    assert robot.docking.holds == ""
    assert any(isinstance(one, Start) for one in robot.step(RETRY_S))


def test_undocking_that_fails_keeps_the_robot_in_its_dock():
    robot = Robot(here=DOCK)
    robot.ends(robot.started(), DockEnding(ABORTED, success=False, code=905))
    assert robot.step() == []
    assert robot.docking.holds == "in its dock"


@pytest.mark.parametrize("state", ["paused", "covering", "idle"])
def test_docking_that_is_not_wanted_any_more_is_cancelled(robot, state):
    robot.arrive()
    start = robot.started()
    robot.state = state
    assert robot.step() == [Cancel(Move.DOCK, start.id)]
    # Until Nav2 says so, the robot is its.
    assert robot.docking.holds == "docking"
    robot.ends(start, DockEnding(CANCELED, success=False))
    assert robot.step() == []
    assert (robot.docking.holds, robot.docking.trouble) == ("", "")


def test_a_lost_result_is_requested_again_then_the_goal_given_up(robot):
    robot.arrive()
    start = robot.started()
    assert robot.step(RESULT_EVERY_S + 1.0) == [Ask(Move.DOCK, start.id)]
    assert Cancel(Move.DOCK, start.id) in robot.step(GIVE_UP_S)
    assert "did not end" in robot.docking.trouble


def test_at_the_exit_goals_end(robot):
    robot.arrive()
    start = robot.started()
    assert robot.docking.end() == [Cancel(Move.DOCK, start.id)]
    assert robot.docking.end() == []
