"""Fleets of one and of many, and robots whose frame changes: nobody stops for another's fault."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS
from fasaco_edge.fleet.mission.traffic import OLD_S
from fasaco_edge.mission.events import Part
from tests.fleet.mission.fleets import FleetDrive
from tests.mission.world import Drive as Alone
from tests.mission.world import MapReceived, building, pose_at

HALL = ["." * 16] * 10


def test_a_fleet_of_one_drives_as_a_robot_without_a_fleet():
    fleet = FleetDrive(HALL, {"r1": (0, 0)})
    fleet.finish()
    (member,) = fleet.robots.values()
    alone = Alone((0, 0), kind=FleetKind("r1"))
    alone.tell(MapReceived(building(*HALL)), pose_at(0, 0))
    driven = []
    while alone.mission.state != "done":
        assert len(driven) < 1000
        if alone.request is not None:
            alone.plan()
        if alone.walk:
            alone.cell = alone.walk.pop(0)
            driven.append(alone.cell)
        alone.tell(pose_at(*alone.cell), after=1.0)
    # The walk begins where it stands.
    assert [cell for cell in member.driven if cell != (0, 0)] == driven
    assert fleet.left_out() == set()


class Crowd(FleetDrive):
    def tick(self, copies=1, random=None):
        self.seconds += 1
        for robot in self.robots.values():
            robot.tick()
            self.swept.add(robot.cell)
        reports = {robot.name: robot.report() for robot in self.robots.values()}
        for robot in self.robots.values():
            heard = [report for name, report in reports.items() if name != robot.name]
            robot.tell(*heard, after=0.0)


def test_a_fleet_of_32_in_one_room_sweeps_it():
    starts = {f"r{number:02}": divmod(number, 8) for number in range(32)}
    fleet = Crowd(HALL, starts)
    fleet.finish(most=400)
    assert fleet.left_out() == set()
    # Five cells are left for each; most of the time goes into making room.
    alone = FleetDrive(HALL, {"r1": (0, 0)})
    alone.finish()
    assert fleet.seconds < alone.seconds


@pytest.mark.parametrize("again", [True, False], ids=["comes back", "stays"])
def test_a_robot_with_a_changed_frame_is_left_out_until_it_fits(again):
    fleet = FleetDrive(HALL, {"r1": (0, 0), "r2": (9, 15)})
    fleet.run(15)
    ours, other = fleet.robots.values()
    assert ours.mission.company.parts
    fleet.hears = lambda speaker, listener: False
    for _ in range(5):
        ours.tell(replace(other.report(), frame="elsewhere"))
        fleet.tick()
    member = ours.mission.company.others.known["r2"]
    assert "its frame is 'elsewhere'" in member.absence(fleet.seconds)
    assert not ours.mission.company.parts
    assert ours.mission.state == "covering"
    if again:
        fleet.hears = lambda speaker, listener: True
        fleet.run(4)
        assert ours.mission.company.parts
        fleet.finish()
        assert fleet.left_out() == set()
    else:
        fleet.finish_one(ours)


@pytest.mark.parametrize("dies_at", [20, 60, 100, None])
def test_cells_of_a_robot_in_the_way_are_swept_once_it_is_silent(dies_at):
    fleet = FleetDrive(["." * 9] * 6, {"r1": (0, 0), "r2": (2, 4)})
    ours, other = fleet.robots.values()
    # Its wheels are stuck, and it goes on telling that it will drive.
    other.hangs = True
    if dies_at is None:
        # Its share, while the other may still move; then all cells but those beside that one. It
        # was done after its share, with half of the cells left over.
        fleet.finish_one(ours, most=100)
        assert fleet.left_out() == {(2, 3), (2, 5), (1, 4), (3, 4)}
        return
    fleet.run(dies_at)
    assert ours.mission.company.others.is_avoided("r2")
    del fleet.robots["r2"]
    fleet.run(int(OLD_S) + 2)
    fleet.finish_one(ours)
    assert fleet.left_out() == set()


@pytest.mark.parametrize("pairs", [{("b", "c"), ("c", "b")}, {("c", "b")}], ids=["both", "one"])
def test_a_robot_in_range_of_two_makes_the_division_for_them(pairs):
    # Each divided without the other, the third with it again: 103 times, and 80.
    fleet = FleetDrive(["." * 40] * 16, {"a": (0, 0), "b": (0, 39), "c": (15, 20)})
    fleet.hears = lambda speaker, listener: (speaker, listener) not in pairs
    fleet.finish()
    assert not fleet.left_out()
    assert max(robot.mission.company.numbers.number for robot in fleet.robots.values()) < 30


def test_a_lost_robot_is_missed_though_another_divided():
    fleet = FleetDrive(["." * 40] * 16, {"a": (0, 0), "b": (0, 39), "c": (15, 20)})
    fleet.run(6)
    made_by = fleet.robots["a"].mission.company.numbers.by
    (dead, *_) = sorted({"a", "b", "c"} - {made_by})
    del fleet.robots[dead]
    fleet.run(7)
    for robot in fleet.robots.values():
        assert dead not in {part.robot for part in robot.mission.company.parts}
    fleet.finish()
    assert not fleet.left_out()


def test_a_division_names_no_more_robots_than_others_read():
    fleet = FleetDrive(["." * 24] * 6, {"a": (0, 0), "b": (5, 23), "c": (0, 23)})
    ghosts = tuple(Part(f"g{number:02}", (0, number % 24), 0.0, 1.0) for number in range(31))
    mine = (Part("a", (0, 0), 0.0, 1.0), Part("z", (5, 0), 0.0, 1.0))
    robot = fleet.robots["a"]
    said = replace(
        fleet.robots["b"].report(), robot="z", division=9, by="z", parts=(*mine, *ghosts)
    )
    for _ in range(4):
        robot.tick()
        others = [fleet.robots[name].report() for name in "bc"]
        robot.tell(said, *others, after=0.0)
    assert 2 < len(robot.mission.company.parts) <= MOST_ROBOTS + 1
