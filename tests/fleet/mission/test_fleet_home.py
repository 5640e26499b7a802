"""Robots of a fleet on their way home: they wait for each other, and make way, as at work."""

import math
from dataclasses import replace

import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.message import path_ahead
from fasaco_edge.fleet.mission.tiles import TILE_BYTES
from fasaco_edge.fleet.mission.traffic import PATIENCE_S
from fasaco_edge.mission.config import Place
from fasaco_edge.mission.events import MapReceived, MemberReceived, State
from fasaco_edge.mission.work.order_state import OrderState, Stage
from tests.fleet.mission.fleets import FleetDrive, FleetRobot
from tests.mission.world import CELL, CONFIG, Drive, building, pose_at, rectangle, with_policy

HALL = ("." * 24,) * 5
# Room for one robot beside the passage.
PASSAGE = ("#####.######", "#####.######", "............")
RADIUS_M = CONFIG.footprint.robot_radius_m


def at(row, col):
    return Place(x_m=(col + 0.5) * CELL, y_m=(row + 0.5) * CELL)


def member(cell, **changes):
    x, y = (cell[1] + 0.5) * CELL, (cell[0] + 0.5) * CELL
    heard = MemberReceived("r2", state="covering", x=x, y=y, epoch=1, radius_m=RADIUS_M)
    return replace(heard, **changes)


@pytest.fixture
def drive():
    config = with_policy(CONFIG, home=at(2, 20))
    drive = Drive((2, 4), config=config, kind=FleetKind("r1"))
    drive.tell(MapReceived(building(*HALL)), pose_at(2, 4))
    drive.plan()
    drive.command("home")
    assert len(drive.walk) == 16
    return drive


def test_a_robot_on_its_way_home_waits_and_continues(drive):
    # It drove on, whoever was in the way: on an errand it neither waited nor made way.
    over = member(drive.walk[1], waits_for="r3")
    drive.tell(pose_at(2, 4), over, after=1.0)
    assert drive.mission.giving_way.waits_for == "r2"
    assert drive.mission.state is State.RETURNING
    assert not drive.walk
    # Where it goes is told to others all the same.
    assert path_ahead(drive.mission)[0].tolist() == pytest.approx([5.5 * CELL, 2.5 * CELL])
    drive.tell(pose_at(2, 4), member((2, 23)), after=1.0)
    assert drive.mission.giving_way.waits_for == ""
    while drive.walk:
        drive.go(member((4, 23)))
    assert drive.cell == (2, 20)


def test_a_robot_delayed_for_a_minute_on_its_way_home_reports_it():
    config = with_policy(CONFIG, home=at(0, 20))
    drive = Drive((0, 4), config=config, kind=FleetKind("r1"))
    drive.tell(MapReceived(building("." * 24)), pose_at(0, 4))
    drive.plan()
    drive.command("home")
    states = []
    for _ in range(150):
        if drive.walk and drive.walk[0][1] < 10:
            drive.cell = drive.walk.pop(0)
        drive.tell(pose_at(*drive.cell), member((0, 11), state="charging"), after=1.0)
        states.append(drive.mission.state)
    # Every 30 s it tries once whether it can pass.
    assert set(states[90:]) == {State.DEGRADED}
    assert drive.mission.reason == "r2 stands in the way for more than a minute"


def test_a_robot_that_returns_home_waits_though_nothing_is_left():
    # Its wait was in vain, it held, as no cell was left: it went on and waited in turn.
    config = with_policy(CONFIG, home=at(2, 20))
    order = {"zones": [{"name": "z", "polygon": rectangle(2, 0, 3, 6)}], "return_home": True}
    drive = Drive(
        (2, 4), config=config, order_state=OrderState.idle("no order yet"), kind=FleetKind("r1")
    )
    drive.tell(MapReceived(building(*HALL)), pose_at(2, 4))
    drive.command("start", order)
    drive.plan()
    drive.tell(pose_at(2, 4), member((4, 23), tiles=(((0, 0), b"\xff" * TILE_BYTES),)), after=2.0)
    drive.tell(pose_at(2, 4), after=2.0)
    assert drive.mission.order_state.stage is Stage.RETURNING
    row, col = drive.cell
    revision, over = drive.revision, member((row, col + 2), waits_for="r3")
    for _ in range(20):
        drive.tell(pose_at(row, col), over)
    assert drive.mission.giving_way.waits_for == "r2"
    assert drive.mission.state is State.RETURNING
    assert drive.revision <= revision + 2


def test_a_way_home_leads_round_a_robot_that_stands_in_it(drive):
    there = member((2, 6))
    for _ in range(3 * int(PATIENCE_S)):
        drive.tell(pose_at(*drive.cell), there, after=1.0)
        if drive.walk:
            drive.cell = drive.walk.pop(0)
    assert drive.mission.reason in ("on the way home", "at home, paused by command")
    for cell in drive.driven:
        assert math.dist(cell, (2, 6)) >= 1.0
    for _ in range(20):
        drive.go(there)
    assert drive.cell == (2, 20)


def test_a_waiting_robot_sent_home_checks_its_way_again(drive):
    drive.command("resume")
    while drive.request is not None:
        drive.plan()
    ahead = drive.walk[1]
    drive.tell(pose_at(2, 4), member(ahead, waits_for="r3"), after=1.0)
    assert drive.mission.giving_way.waits_for == "r2"
    # Away from the other one.
    behind = member((2, 3)) if ahead[1] > 4 else member(ahead, waits_for="r3")
    drive.command("home")
    drive.tell(pose_at(2, 4), behind, after=1.0)
    assert drive.mission.giving_way.waits_for == ""
    assert drive.walk[-1] == (2, 20)


def test_two_that_are_sent_home_past_each_other_both_get_there():
    fleet = FleetDrive(PASSAGE, {})
    for name, begin, home in (("r1", (0, 0), (0, 11)), ("r2", (0, 11), (0, 0))):
        config = with_policy(CONFIG, home=at(*home))
        fleet.robots[name] = FleetRobot(name, begin, PASSAGE, config)
    fleet.run(2)
    for robot in fleet.robots.values():
        robot.command("home")
    for _ in range(200):
        fleet.tick()
        one, other = (robot.cell for robot in fleet.robots.values())
        assert one != other
    assert {name: robot.cell for name, robot in fleet.robots.items()} == {
        "r1": (0, 11),
        "r2": (0, 0),
    }
