"""The end of a fleet's mission: who has no part left stands until others have swept it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.members import HANGING_S
from fasaco_edge.fleet.mission.message import waits_for
from fasaco_edge.fleet.mission.shared_ground import GroundQueue
from fasaco_edge.fleet.mission.shared_work import STUCK_S, WAITING_S, Remainder
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import (
    CommandReceived,
    MapReceived,
    MemberReceived,
    Part,
    PriorityReceived,
)
from fasaco_edge.mission.orders.order import MissionOrder, Zone
from fasaco_edge.mission.work.order_state import OrderState
from tests.fleet.mission.fleets import FleetDrive, FleetRobot
from tests.fleet.mission.test_fleet import tiles_of
from tests.mission.world import (
    CELL,
    CONFIG,
    Drive,
    building,
    patch,
    pose_at,
    rectangle,
    with_policy,
)

HALL = ["." * 24] * 12
CELLS = [(row, col) for row in range(12) for col in range(24)]
ALL_TO_R1 = (Part("r1", (0, 0), 0.0, 1.0), Part("r2", (6, 12), 1e6, 1.0))
ALL_TO_R2 = (Part("r1", (0, 0), 1e6, 1.0), Part("r2", (6, 12), 0.0, 1.0))


class Shared:
    """A robot, r1, in a hall whose cells another one, r2, gives itself and sweeps one by one."""

    def __init__(self, config=CONFIG):
        fleet = FleetDrive(HALL, {"r1": (0, 0), "r2": (6, 12)}, config)
        self.ours, other = fleet.robots.values()
        self._report, self.swept, self._number = other.report(), 0, 0

    def run(self, seconds, sweeps=1):
        for _ in range(seconds):
            self._number += 1
            self.swept += sweeps
            report = replace(
                self._report,
                division=self._number,
                by="r2",
                parts=ALL_TO_R2,
                tiles=tiles_of(CELLS[len(CELLS) - self.swept :]) if self.swept else (),
                x=3.0 + 0.2 * (self._number % 2),
            )
            self.ours.tell(report, after=0.0)
            self.ours.tick()


def test_a_robot_without_a_part_stands_while_another_sweeps():
    shared = Shared()
    shared.run(40)
    ours = shared.ours
    plans = ours.mission.route.requests.plans
    shared.run(60)
    assert (ours.mission.state, ours.mission.reason) == ("covering", "others sweep what is left")
    assert not ours.walk
    assert ours.mission.route.requests.plans == plans
    # By that others know that it does not hang.
    assert waits_for(ours.mission) == "r2"
    ours.command("pause", after=1.0)
    assert (ours.mission.state, waits_for(ours.mission)) == ("paused", "")
    ours.command("resume", after=1.0)
    shared.run(len(CELLS) - shared.swept)
    assert ours.mission.state == "done"


def test_a_robot_without_a_part_sweeps_what_another_leaves():
    shared = Shared()
    shared.run(40)
    assert not shared.ours.walk
    shared.run(int(STUCK_S) + 2, sweeps=0)
    assert shared.ours.walk


def test_cells_tried_in_vain_stay_the_others_despite_new_maps():
    # With each map it was tried anew, while the others were at work.
    niche = ["#####.##################", *HALL]
    fleet = FleetDrive(niche, {"r1": (0, 0), "r2": (0, 1)})
    ours, other = fleet.robots.values()
    ours.cannot = other.cannot = {(12, 5)}

    def untried():
        lattice = ours.mission.map.area.lattice
        return ours.mission.orders.cells.untried(lattice.window)[lattice.local((12, 5))]

    while untried():
        fleet.tick()
        assert fleet.seconds < 300
    ours.tell(patch("#", at=(0, 23)))
    assert not untried()
    assert ours.mission.company.parts
    fleet.run(2)
    ours.tell(patch(".", at=(0, 23)))
    assert not untried()


def test_robots_do_not_stand_for_one_another():
    remainder = Remainder()
    for now in range(int(WAITING_S) + 4):
        remainder.note_others(now, wait=now > 0)
        remainder.note(100 - now, 0, now, now)
        assert remainder.others_go_on == (now <= WAITING_S + 1)
    remainder.note_others(now, wait=False)
    remainder.note(50, 0, 50, now)
    assert remainder.others_go_on


def test_robots_that_explore_still_make_progress():
    # One was done with 160 cells left, and out of the fleet, for the last 390 s of 950.
    remainder = Remainder()
    for second in range(3 * int(STUCK_S)):
        remainder.note(160 + second, 0, second, float(second))
        assert remainder.others_go_on


@pytest.mark.parametrize(
    "swept", [[50] * 50, [51, 50] * 25, range(51, 100)], ids=["none", "up and down", "later"]
)
def test_a_robot_does_not_wait_again_for_others_that_stood(swept):
    remainder = Remainder()
    for second in range(int(STUCK_S) + 2):
        remainder.note(59 + second % 2, 0, 50 - second % 2, float(second))
    assert not remainder.others_go_on
    for second, cells in enumerate(swept):
        remainder.note(40, 0, cells, STUCK_S + 2 + second)
        assert not remainder.others_go_on
    remainder.note(40, 3, 100, 100.0)
    remainder.note(40, 0, 100, 101.0)
    assert remainder.others_go_on


def test_a_standing_robot_in_trouble_sends_which_it_waits_for():
    # Else the others took it for one that hangs, and left it out of the next division.
    shared = Shared(with_policy(CONFIG, stale_map_s=20.0))
    shared.run(40)
    mission = shared.ours.mission
    assert [trouble.code for trouble in mission.troubles] == ["no_map"]
    assert (mission.state, waits_for(mission)) == ("degraded", "r2")


def test_a_robot_whose_part_only_others_see_sweeps_what_it_sees():
    # The east half is still unknown to it, and its part lies there.
    ours = FleetRobot("r1", (0, 0), [row[:12] for row in HALL])
    other = FleetRobot("r2", (6, 12), HALL)
    report = replace(other.report(), ground=GroundQueue().next(other.mission.map.area, 100))
    parts = (Part("r1", (6, 22), 0.0, 1.0), Part("r2", (6, 4), 0.0, 1.0))
    for second in range(20):
        place = 3.0 + 0.2 * (second % 2)
        ours.tell(replace(report, division=second + 1, by="r2", parts=parts, x=place), after=0.0)
        ours.tick()
    assert ours.mission.reason != "others sweep what is left"
    assert len(set(ours.driven)) > 10


def test_a_robot_standing_without_a_part_stays_in_the_fleet():
    shared, other = Shared(), FleetRobot("r2", (6, 12), HALL)
    shared.run(40)
    for _ in range(int(HANGING_S) + 4):
        shared.run(1)
        assert not shared.ours.walk
        other.tell(shared.ours.report(), after=1.0)
    (ours,) = other.mission.company.others.known.values()
    assert ours.absence(other.now) == ""


def heard_from_the_east(other, number, to_r1):
    seed = (6, 22) if to_r1 else (0, 0)
    return replace(
        other.report(),
        ground=GroundQueue().next(other.mission.map.area, 100),
        tiles=tiles_of([cell for cell in CELLS if cell[1] < 12]),
        parts=(Part("r1", seed, 0.0 if to_r1 else 1e6, 1.0), Part("r2", (6, 14), 0.0, 1.0)),
        division=number,
        by="r2",
        x=4.0 + 0.2 * (number % 2),
    )


@pytest.mark.parametrize("to_r1", [True, False], ids=["a part", "no part"])
def test_a_robot_that_sees_nothing_left_drives_to_its_part(to_r1):
    ours = FleetRobot("r1", (6, 0), [row[:12] for row in HALL])
    other = FleetRobot("r2", (6, 16), HALL)
    for second in range(25):
        ours.tell(heard_from_the_east(other, second + 1, to_r1), after=0.0)
        ours.tick()
    if to_r1:
        # At the edge of what its map shows, on the way there; it has looked, and saw nothing new.
        assert ours.cell[1] == 11
        assert ours.mission.state == "done"
    else:
        assert ours.mission.reason == "others sweep what is left"
        assert not ours.walk


@pytest.mark.parametrize("late_s", [1, 4])
def test_a_robot_waits_a_moment_for_the_map_that_shows_its_part(late_s):
    ours = FleetRobot("r1", (6, 0), [row[:12] for row in HALL])
    whole = Zone("hall", ((0.0, 0.0), (24.0, 0.0), (24.0, 12.0), (0.0, 12.0)))
    ours.tell(CommandReceived(1, "start", MissionOrder((whole,))), after=0.0)
    other = FleetRobot("r2", (6, 16), HALL)
    there = 0
    for second in range(40):
        there += ours.cell[1] == 11
        if there == late_s:
            ours.tell(MapReceived(building(*HALL)), after=0.0)
        ours.tell(heard_from_the_east(other, second + 1, True), after=0.0)
        ours.tick()
    assert max(col for _, col in ours.driven) > 11


def between(first, second):
    for _ in range(60):
        for robot in (first, second):
            robot.tick()
        reports = first.report(), second.report()
        first.tell(reports[1], after=0.0)
        second.tell(reports[0], after=0.0)
    return max(robot.mission.company.numbers.number for robot in (first, second))


def test_robots_share_by_one_division_if_one_sees_no_way():
    # Each left the other out that it saw no way to, and was left out in turn: every other second
    # all cells changed hands.
    hall = HALL * 2
    wall = [row[:10] + "#" + row[11:] for row in hall]
    first, second = FleetRobot("r1", (0, 0), wall), FleetRobot("r2", (6, 20), hall)
    assert between(first, second) < 5
    assert {part.robot for part in first.mission.company.parts} == {"r1", "r2"}
    assert len(first.mission.company.parts) == 2


def test_a_robot_replans_once_others_swept_its_first_floor():
    east = range(22, 24)
    cells = np.full((12, 24), -1, np.int8)
    cells[:, east] = 90
    geometry = GridGeometry(12, 24, CELL, Pose2D(0.0, 0.0))
    fleet = FleetDrive(HALL, {"r1": (0, 0), "r2": (6, 6)})
    ours, other = fleet.robots.values()
    report = replace(other.report(), division=1, by="r2", parts=ALL_TO_R1)
    ours.tell(PriorityReceived(OccupancyGrid(geometry, cells)), report)
    ours.command("start", {"until_min": 2.0})
    for _ in range(5):
        ours.tick()
    assert ours.mission.orders.scope.worth.least == 90
    swept = tiles_of([(row, col) for row in range(12) for col in east])
    ours.tell(replace(report, tiles=swept))
    for _ in range(3):
        ours.tick()
    assert "others have swept the floor ahead" in [each.reason for each in ours.updates]
    assert ours.mission.orders.scope.worth.least == 0


def test_a_zone_behind_a_robot_that_stands_is_waited_for():
    """Cells seen past it alone were tried in one step, and the order was over, it said."""
    there = MemberReceived("r2", state="paused", x=8.5 * CELL, y=0.5 * CELL, epoch=1, radius_m=0.1)
    config = with_policy(CONFIG, retries=2, retry_s=30.0)
    drive = Drive(
        (0, 0), config=config, order_state=OrderState.idle("no order yet"), kind=FleetKind("r1")
    )
    rows = ["." * 16 + " " * 14]
    drive.tell(MapReceived(building(*rows)), pose_at(0, 0), there)
    drive.command("start", {"zones": [{"name": "z", "polygon": rectangle(0, 20, 1, 24)}]})
    for _ in range(40):
        if drive.request is not None:
            drive.plan()
        if drive.walk and drive.walk[0][1] < 7:
            drive.cell = drive.walk.pop(0)
        drive.tell(pose_at(*drive.cell), there, after=1.0)
    assert drive.mission.state == "covering"
    assert drive.mission.reason == "others stand in the way to zone 'z'"
    away = replace(there, x=100.0)
    drive.tell(MapReceived(building("." * 30)), away, after=1.0)
    for _ in range(80):
        if drive.request is not None:
            drive.plan()
        drive.go(away)
    assert drive.mission.reason == "every reachable cell of the zones is covered"
    assert {(0, col) for col in range(20, 24)} <= drive.visited
