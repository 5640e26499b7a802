"""Robots of a fleet on their way home: they wait for each other, and make way, as at work."""

import math
from dataclasses import replace

import pytest

from fasaco_edge.mission.config import Place
from fasaco_edge.mission.core.events import MapReceived, MemberHeard, State
from fasaco_edge.mission.fleet.traffic import PATIENCE_S
from tests.mission.fleets import FleetDrive, FleetRobot
from tests.mission.world import CELL, CONFIG, Drive, building, pose_at, with_policy

HALL = ("." * 24,) * 5
# Room for one robot beside the passage.
PASSAGE = ("#####.######", "#####.######", "............")
RADIUS_M = CONFIG.footprint.robot_radius_m


def at(row, col):
    return Place(x_m=(col + 0.5) * CELL, y_m=(row + 0.5) * CELL)


def member(cell, **changes):
    x, y = (cell[1] + 0.5) * CELL, (cell[0] + 0.5) * CELL
    heard = MemberHeard("r2", state="covering", x=x, y=y, epoch=1, radius_m=RADIUS_M)
    return replace(heard, **changes)


@pytest.fixture
def drive():
    """A robot, r1, that drives home along a hall."""
    config = with_policy(replace(CONFIG, robot="r1"), home=at(2, 20))
    drive = Drive((2, 4), config=config)
    drive.tell(MapReceived(building(*HALL)), pose_at(2, 4))
    drive.plan()
    drive.command("home")
    assert len(drive.walk) == 16
    return drive


def test_a_robot_on_its_way_home_waits_and_goes_on(drive):
    # It drove on, whoever was in the way: on an errand it neither waited nor made way.
    over = member(drive.walk[1], waits_for="r3")
    drive.tell(pose_at(2, 4), over, after=1.0)
    assert drive.mission.giving_way.waits_for == "r2"
    assert drive.mission.state is State.RETURNING
    assert not drive.walk
    # Where it goes is told to others all the same.
    assert drive.mission.next_metres()[0].tolist() == pytest.approx([5.5 * CELL, 2.5 * CELL])
    drive.tell(pose_at(2, 4), member((2, 23)), after=1.0)
    assert drive.mission.giving_way.waits_for == ""
    while drive.walk:
        drive.go(member((4, 23)))
    assert drive.cell == (2, 20)


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


def test_a_robot_that_is_sent_home_while_it_waits_looks_anew(drive):
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
