"""A planner that breaks: the robot stands, it is said, and another map is another chance."""

import numpy as np

from fasaco_edge.errors import PlanFailed
from fasaco_edge.mission.core.events import MapReceived, PlanBroken, State
from fasaco_edge.mission.core.plan_requests import BROKEN_S
from tests.mission.world import building, patch, pose_at, started

ROOM = ("......",) * 4


def breaks(drive):
    """The plan that is asked for breaks the planner."""
    request, drive.request = drive.request, None
    return drive.tell(PlanBroken(request.number, PlanFailed(f"plan {request.number} failed: Oh")))


def test_the_robot_stands_and_the_reason_is_told():
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


def test_a_plan_for_another_order_that_breaks_costs_nothing():
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
