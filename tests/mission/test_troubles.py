"""What is not as it should be is a state with a reason: lost poses, jumps, stale maps."""

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.standing import PATIENCE_S
from fasaco_edge.mission.events import CommandReceived, MapReceived, State
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.mission.work.order_state import OrderState
from tests.mission.world import (
    CONFIG,
    Drive,
    answer,
    building,
    patch,
    placed,
    pose_at,
    rectangle,
    started,
    with_policy,
)
from tests.support.examples import examples

ROOM = ("............",) * 4
# A little longer than the mission is patient.
A_WHILE_S = PATIENCE_S + 0.01
WATCHFUL = with_policy(CONFIG, lost_pose_s=2.0, stale_map_s=60.0)


def driving(*rows, steps=4, config=WATCHFUL):
    drive = started(*rows, config=config)
    drive.go(times=steps)
    return drive


def test_a_lost_pose_is_reported_and_the_path_kept():
    drive = driving(*ROOM)
    walk = drive.walk
    assert drive.tell(after=1.9).path is None
    assert drive.mission.state is State.COVERING
    assert drive.tell(after=0.2).path is None
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason == (
        "no pose for 2 s: the path is kept, but nothing counts as covered until one comes"
    )
    drive.tell(pose_at(*drive.cell))
    assert drive.mission.state is State.COVERING
    assert drive.walk == walk
    drive.finish()


def test_cells_between_poses_far_apart_in_time_are_not_claimed():
    for after, claimed in ((1.0, True), (3.0, False)):
        drive = driving("......", steps=1)
        drive.cell = (0, 3)
        drive.tell(pose_at(0, 3), after=after)
        assert ((0, 2) in drive.visited) is claimed
        assert (0, 3) in drive.visited
        drive.walk = [(0, 4), (0, 5)]
        drive.tick(times=40)
        assert drive.visited == {(0, col) for col in range(6)}
        assert drive.mission.state is State.DONE


def test_a_pose_that_comes_back_elsewhere_leads_to_a_new_plan():
    drive = driving(*ROOM)
    drive.tell(after=5.0)
    drive.cell = (3, 11)
    assert drive.tell(pose_at(3, 11), after=5.0).plan is None
    assert drive.mission.state is State.DEGRADED
    decision = drive.tell(pose_at(3, 11), after=A_WHILE_S)
    assert decision.plan.reason == "the pose came back 1.90 m from where it was lost"
    assert decision.plan.problem.start == (3, 11)
    assert drive.mission.state is State.DEGRADED
    drive.plan()
    assert drive.mission.state is State.COVERING
    drive.finish()


def test_after_a_lost_pose_the_robot_may_be_in_another_room():
    drive = driving("...#...", "...#...", steps=1)
    drive.tell(after=5.0)
    drive.cell = (0, 6)
    drive.tell(pose_at(0, 6))
    assert np.count_nonzero(drive.mission.map.area.reachable) == 6
    drive.finish()
    assert {(row, col) for row in (0, 1) for col in (4, 5, 6)} <= drive.visited


def test_a_resting_robot_with_a_silent_localiser_gets_a_plan():
    """Some publish poses only while the robot moves."""
    drive = Drive((0, 0), pose_at(0, 0), config=WATCHFUL)
    drive.tell(MapReceived(building(*ROOM)), after=60.0)
    assert drive.plan().path is not None
    assert drive.mission.state is State.DEGRADED
    drive.finish()


def test_a_jump_of_the_pose_is_reported_and_replanned():
    drive = driving(*ROOM)
    before = drive.visited
    drive.cell = (3, 9)
    drive.tell(pose_at(3, 9))
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason.startswith("the pose jumped 1.")
    assert drive.visited == before | {(3, 9)}, "nobody drove there"
    decision = drive.tell(pose_at(3, 9), after=A_WHILE_S)
    assert decision.plan.reason == drive.mission.reason
    assert decision.plan.problem.start == (3, 9)
    drive.plan()
    assert drive.mission.state is State.COVERING
    drive.finish()


def test_a_flickering_pose_requests_no_plan():
    drive = driving(*ROOM)
    here = drive.cell
    for _ in range(20):
        far = (3, 11) if here[1] < 6 else (3, 0)
        assert drive.tell(pose_at(*far)).plan is None
        assert drive.mission.state is State.DEGRADED
        assert drive.tell(pose_at(*here)).plan is None
        drive.go()
        here = drive.cell
        assert drive.mission.state is State.COVERING


def test_a_pose_that_jumps_while_a_plan_is_made_gets_another():
    drive = driving(*ROOM)
    drive.tell(patch("#", at=(3, 0)), after=A_WHILE_S)
    assert drive.request is not None
    drive.cell = (3, 11)
    drive.tell(pose_at(3, 11))
    drive.plan()
    assert drive.mission.state is State.DEGRADED
    decision = drive.tell(after=A_WHILE_S)
    assert decision.plan.reason.startswith("the pose jumped")
    assert decision.plan.problem.start == (3, 11)
    drive.plan()
    assert drive.mission.state is State.COVERING
    drive.finish()


def test_a_robot_that_does_not_follow_its_path_gets_it_again():
    # A base may refuse a path for good: such a robot was covering, it said, for ever.
    drive = driving(*ROOM, config=CONFIG)
    got = [drive.tell(pose_at(*drive.cell), after=1.0).path for _ in range(65)]
    again = [path for path in got if path is not None]
    assert [path.reason for path in again] == ["robot stands"] * 2
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason == "the robot stands: it got a path 3 times"
    drive.go()
    assert drive.mission.state is State.COVERING
    drive.finish()


def test_a_standing_robot_is_reported_though_its_path_changes():
    """As with furniture that flickers far from it: no path makes it drive."""
    drive, far = driving(*ROOM, config=CONFIG), (3, 11)
    for tick in range(70):
        flickering = patch("#."[tick % 2], at=far)
        drive.tell(flickering, pose_at(*drive.cell), after=1.0)
        if drive.request is not None:
            drive.plan()
    assert len(drive.updates) > 30
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason.startswith("the robot stands")
    drive.go()
    assert drive.mission.state is State.COVERING


def test_a_standing_robot_is_reported_though_the_map_flickers():
    """Each time the path ends in its own cell, and another one begins there."""
    drive = driving(*ROOM, config=CONFIG)
    empty = 0
    for tick in range(100):
        events = [pose_at(*drive.cell)]
        if tick % 8 == 4:
            ahead = drive.walk[0]
        if tick % 8 in (4, 6):
            events.insert(0, patch("#."[tick % 8 == 6], at=ahead))
        drive.tell(*events, after=1.0)
        empty += len(drive.mission.route.path.ahead) < 2
        if drive.request is not None:
            drive.plan()
    assert empty > 10
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason.startswith("the robot stands")


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((2, 3), "robot is in an occupied cell, or too close to one: waits for"),
        ((4, 3), "robot is on unknown ground: waits for"),
        ((40, 3), "robot is outside of the map: waits for"),
    ],
)
def test_a_robot_where_it_cannot_be_waits_and_says_for_what(place, said):
    drive = driving("??????????", *["##########"] * 3, "..........")
    drive.tell(pose_at(*place))
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.startswith(said)
    drive.tell(pose_at(*drive.cell), after=A_WHILE_S)
    drive.finish()


ORDERS = (
    None,
    {"zones": [{"name": "a", "polygon": rectangle(0, 0, 3, 3), "passes": 2}]},
    {"keep_out": [rectangle(1, 4, 3, 6)], "return_home": True},
    {
        "zones": [
            {"name": "a", "polygon": rectangle(0, 5, 4, 9)},
            {"name": "b", "polygon": rectangle(2, 0, 4, 4)},
        ],
        "keep_out": [rectangle(0, 4, 2, 5)],
        "return_home": True,
        "keep_covered": True,
    },
)


@examples(60)
@given(st.integers(0, 2**32))
def test_all_events_give_a_repeatable_state_with_a_reason(seed):
    """Commands, maps, jumps and silence in any order; and all of it once more."""
    random = np.random.default_rng(seed)
    truth = np.zeros((8, 20), np.int8)
    config = with_policy(WATCHFUL, retries=1, retry_s=5.0)
    drive = Drive((0, 0), config=config, order_state=OrderState.idle("no order"))
    heard = [((), drive.now)]
    again = Mission(config, OrderState.idle("no order"))

    def tell(*events, after=0.1):
        drive.tell(*events, after=after)
        heard.append((events, drive.now))
        assert drive.mission.reason

    tell(MapReceived(placed(truth.copy(), (0, 0))), pose_at(0, 0))
    for number in range(120):
        draw = random.random()
        if draw < 0.1:
            name = random.choice(["start", "start", "pause", "resume", "cancel", "reset"])
            order = read_order(ORDERS[random.integers(len(ORDERS))] if name == "start" else None)
            tell(CommandReceived(number, str(name), order))
        elif draw < 0.2:
            row, col = 2 * random.integers(4), 2 * random.integers(10)
            truth[row : row + 2, col : col + 2] = 100 - truth[row : row + 2, col : col + 2]
            tell(MapReceived(placed(truth.copy(), (0, 0))))
        elif draw < 0.25:
            drive.cell = int(random.integers(4)), int(random.integers(10))
            tell(pose_at(*drive.cell))
        elif draw < 0.3:
            tell(after=float(random.choice([0.5, 3.0, 20.0])))
        elif drive.request is not None and draw < 0.6:
            ready = answer(drive.request)
            drive.request = None
            tell(ready)
        elif drive.walk:
            drive.cell = drive.walk.pop(0)
            tell(pose_at(*drive.cell))
        else:
            tell(after=1.0)
        kept = drive.mission.order_state
        assert OrderState.from_json(kept.to_json()) == kept
    told = [copy.copy(decision) for decision in drive.decisions]
    for (events, now), before in zip(heard, told, strict=True):
        decision = again.step(events, now)
        assert (decision.path is None) == (before.path is None)
        if decision.path is not None:
            assert np.array_equal(decision.path.cells, before.path.cells)
            assert decision.path.reason == before.path.reason
        assert (decision.plan is None) == (before.plan is None)
        assert [str(a.error) for a in decision.answers] == [str(a.error) for a in before.answers]
    assert (again.state, again.reason) == (drive.mission.state, drive.mission.reason)
    assert again.order_state == drive.mission.order_state
