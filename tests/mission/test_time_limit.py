"""Orders with a time limit: when the robot turns home, and what it says is left."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.mission.config import MissionPolicy
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import CommandReceived, MapReceived, PoseReceived, State
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.mission.work.order_state import OrderState, Stage
from tests.mission.battery import AT_DOCK, Battery
from tests.mission.line_robot import CONFIG as LINES
from tests.mission.line_robot import LineRobot
from tests.mission.world import CELL, CONFIG, Drive, building, pose_at, with_policy

# A cell takes a second.
CELL_S = 1.0
HALL = ("." * 30,) * 4


class Clocked(Drive):
    """A robot that drives a cell a second, by our clock or by its own."""

    def __init__(self, cell=(0, 0), *, order=None, own_clock=False, rows=HALL, **policy):
        self.own_clock, self.driving_s = own_clock, 0.0
        config = with_policy(CONFIG, autostart=False, **policy)
        super().__init__(
            *(cell, MapReceived(building(*rows)), pose_at(*cell)),
            config=config,
            order_state=OrderState.idle("waits"),
        )
        if order is not None:
            self.command("start", order)
            assert self.refused is None

    def tell(self, *events, after=CELL_S):
        self.driving_s += after
        if self.own_clock:
            row, col = self.cell
            pose = Pose2D((col + 0.5) * CELL, (row + 0.5) * CELL)
            stamped = StampedPose(pose, "map", round(1e9 * self.driving_s))
            events, after = (*events, PoseReceived(stamped)), 0.05
        return super().tell(*events, after=after)


@pytest.mark.parametrize("own_clock", [False, True])
def test_the_robot_is_home_in_time_and_says_what_is_left(own_clock):
    drive = Clocked(order={"until_min": 1.0}, own_clock=own_clock)
    began = drive.driving_s
    drive.run(State.RETURNING)
    assert drive.updates[-1].reason == "returning home: time is up"
    assert drive.mission.time_limit.left_s > 0.0
    drive.finish()
    assert drive.cell == (0, 0)
    assert 40.0 <= drive.driving_s - began <= 66.0, "plans and turns take a tick or two"
    left = 120 - len(drive.visited)
    assert 50 < left < 90
    area = f"{left * CELL**2:.1f} m2"
    assert drive.mission.reason == (
        f"time is up after 1 min: {100 * (120 - left) // 120} % of 7.5 m2 covered; "
        f"{area} not reached: no time left ({area})"
    )
    assert drive.mission.time_limit.left_s is None
    # It stays so, and the rest can be ordered.
    drive.tell(pose_at(0, 0), after=100.0)
    assert drive.mission.state is State.DONE
    drive.command("start", {"keep_covered": True})
    drive.finish()
    assert len(drive.visited) == 120


def test_a_line_leads_straight_home():
    policy = MissionPolicy(retries=0, until_min=2.0)
    robot = LineRobot(np.zeros((60, 160), np.int8), (0.5, 0.5), replace(LINES, policy=policy))
    zones = [
        {"name": name, "polygon": [[x, 0], [x + 4, 0], [x + 4, 3], [x, 3]]}
        for name, x in (("far", 4), ("near", 0))
    ]
    order = read_order({"zones": zones})
    robot.step(CommandReceived(1, "start", order, discard=True))
    began = robot.now
    assert robot.wait(200.0, lambda robot: robot.mission.state is State.DONE)
    # Floor beside its way is left for another time.
    assert 90.0 < robot.now - began <= 122.0
    assert robot.mission.reason.startswith("time is up after 2 min in zone 'far', before 'near': ")


def test_the_configured_limit_applies_to_orders_without_one():
    drive = Clocked(order={}, until_min=0.5)
    drive.finish()
    assert drive.mission.reason.startswith("time is up after 0.5 min: ")
    drive.command("start", {"until_min": 0.0})
    drive.finish()
    assert drive.mission.reason.startswith("every reachable cell is covered")


def test_new_floor_does_not_reopen_an_order_out_of_time():
    drive = Battery(None, rows=HALL, dock=None, until_min=0.5)
    drive.run(State.DONE)
    assert drive.now < 36.0
    assert drive.cell == (0, 0)
    assert drive.mission.reason.startswith("time is up after 0.5 min: ")
    drive.tell(MapReceived(building(*HALL, *HALL)))
    assert (drive.mission.state, drive.request) == (State.DONE, None)


def restart(drive):
    """Let another mission go on from what is kept, with the same clocks."""
    kept = drive.mission.snapshot()
    drive.mission, drive.request = Mission(drive.config), None
    drive.mission.restore(kept, OrderState.from_json(kept.note))
    drive.revision, drive.walk = 0, []


@pytest.mark.parametrize("covered", [3, 20])
def test_the_time_limit_survives_a_restart(covered):
    drive = Clocked(order={"until_min": 1.0})
    drive.run(State.COVERING)
    drive.go(times=covered)
    restart(drive)
    drive.tell(MapReceived(building(*HALL)), pose_at(*drive.cell), after=1000.0)
    left_s = drive.mission.time_limit.left_s
    assert 60.0 - covered - 8.0 <= left_s <= 60.0 - covered + 8.0
    drive.finish()
    assert drive.mission.reason.startswith("time is up after 1 min: ")
    assert OrderState.from_json(drive.mission.snapshot().note).late == "time is up after 1 min"


def test_a_first_pose_and_a_clock_that_is_set_on_take_no_time():
    drive = Clocked(order={"until_min": 1.0})
    drive.run(State.COVERING)
    restart(drive)
    drive.tell(MapReceived(building(*HALL)))
    for stamp_s in (1_700_000_000, 1_700_003_600):
        pose = replace(pose_at(*drive.cell).pose, stamp_ns=stamp_s * 10**9)
        for _ in range(6):
            drive.tell(PoseReceived(pose))
    assert drive.mission.time_limit.left_s > 40.0
    assert drive.mission.order_state.stage is Stage.COVERING


def test_pauses_count_and_a_paused_robot_stands():
    drive = Clocked(order={"until_min": 1.0})
    drive.run(State.COVERING)
    drive.go(times=10)
    drive.command("pause")
    drive.go(times=90)
    assert drive.mission.state is State.PAUSED
    drive.command("resume")
    drive.finish(ticks=20)
    assert drive.cell == (0, 0)


def test_the_order_of_a_robot_that_was_sent_home_ends_there():
    drive = Clocked(order={"until_min": 1.0})
    drive.run(State.COVERING)
    drive.go(times=10)
    drive.command("home")
    drive.run(State.PAUSED)
    drive.go(times=60)
    assert (drive.mission.state, drive.cell) == (State.DONE, (0, 0))
    assert drive.mission.reason.startswith("time is up after 1 min: ")


def test_charging_counts_and_a_robot_in_its_dock_stays_there():
    drive = Battery(0.19, until_min=1.0)
    drive.run(State.CHARGING)
    drive.level = 0.3
    for _ in range(70):
        drive.power = "charging"
        drive.go()
    assert drive.mission.order_state.stage is Stage.OVER
    assert drive.mission.state is State.CHARGING
    drive.charge(to=0.95)
    drive.finish()
    assert drive.cell == AT_DOCK
    assert drive.mission.reason.startswith("time is up after 1 min: ")
