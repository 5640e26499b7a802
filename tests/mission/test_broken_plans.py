"""A planner that breaks: the robot stands, it is said, and another map is another chance."""

from dataclasses import replace

import numpy as np

from fasaco_edge.errors import PlanFailed
from fasaco_edge.mission.events import MapReceived, PlanBroken, State
from fasaco_edge.mission.path.plan_requests import BROKEN_S
from tests.fleet.mission.test_standing_robots import member, planned
from tests.mission.world import CELL, building, patch, pose_at, started

ROOM = ("......",) * 4


def breaks(drive):
    """The plan that is asked for breaks the planner."""
    request, drive.request = drive.request, None
    return drive.tell(PlanBroken(request.number, PlanFailed(f"plan {request.number} failed: Oh")))


def test_the_robot_stands_with_the_reason():
    drive = started(*ROOM)
    drive.go()
    drive.tell(patch("#", at=(2, 2)))
    decision = breaks(drive)
    assert [type(fault) for fault in decision.faults] == [PlanFailed]
    assert decision.path.cells.shape == (0, 2)
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason == (
        "plan 2 failed: Oh; tried again with the next map, or after 30 s"
    )
    assert drive.mission.route.outdated == 1
    for _ in range(20):
        assert drive.tell(pose_at(*drive.cell)).plan is None


def test_another_map_is_another_chance():
    drive = started(*ROOM)
    drive.tell(patch("#", at=(2, 2)))
    breaks(drive)
    assert drive.tell(MapReceived(building(*ROOM)), after=2.0).plan is not None
    drive.plan()
    drive.finish()


def test_it_is_tried_again_after_a_while_and_when_asked_for():
    drive = started(*ROOM)
    drive.tell(patch("#", at=(2, 2)))
    breaks(drive)
    assert drive.tell(pose_at(*drive.cell), after=BROKEN_S + 1.0).plan is not None
    breaks(drive)
    assert drive.command("replan", after=2.0).plan is not None
    drive.plan()
    drive.finish()


def test_a_failed_plan_for_another_order_changes_nothing():
    drive = started(*ROOM)
    drive.tell(patch("#", at=(2, 2)))
    drive.command("reset")
    breaks(drive)
    assert drive.mission.state is State.IDLE
    drive.command("start", after=2.0)
    assert drive.request is not None
    drive.plan()
    drive.finish()
    assert np.array_equal(drive.mission.route.path.ahead, drive.mission.route.path.cells[-1:])


def breaks_with_each_map(drive, seconds):
    """A map each second, over all of which the planner breaks; return how often."""
    broken = 0
    for _ in range(seconds):
        drive.tell(MapReceived(building(*ROOM)), pose_at(*drive.cell), after=1.0)
        if drive.request is not None:
            breaks(drive)
            broken += 1
    return broken


def test_a_planner_that_fails_on_each_map_runs_less_often():
    drive = started(*ROOM)
    drive.tell(patch("#", at=(2, 2)))
    breaks(drive)
    assert breaks_with_each_map(drive, 60) == 6
    assert breaks_with_each_map(drive, 300) == 10
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.endswith("failed: Oh; tried again after 30 s")
    # Who asks for one gets it, and one that succeeds is progress.
    assert drive.command("replan", after=1.0).plan is not None
    drive.plan()
    drive.tell(patch("#", at=(2, 3)))
    breaks(drive)
    assert drive.mission.reason.endswith("tried again with the next map, or after 30 s")


def test_a_wait_for_another_robot_gives_no_new_try():
    drive = planned()
    drive.tell(patch("#", at=(1, 10)))
    breaks(drive)
    x, y = 5.5 * CELL, 2.5 * CELL
    over = replace(member(x, y), ahead=((x - CELL, y),))
    drive.tell(pose_at(2, 4), over, after=1.0)
    assert drive.mission.giving_way.waits_for == "r2"
    gone = member(20 * CELL, y)
    for _ in range(3):
        assert drive.tell(pose_at(2, 4), gone, after=1.0).plan is None
    assert drive.mission.state is State.BLOCKED
    # A command is one.
    drive.command("pause")
    assert drive.command("resume", after=2.0).plan is not None
