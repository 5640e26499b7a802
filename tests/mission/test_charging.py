"""A robot with a battery: when it goes to its dock, what it believes, and when it goes on."""

import math

import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.mission.config import BatteryPolicy, Dock
from fasaco_edge.mission.core.charging import FULL_AFTER_S, BatteryGauge
from fasaco_edge.mission.events import BatteryReceived, PoseReceived, State
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState
from fasaco_edge.text import percent
from tests.mission.battery import AT_DOCK, WALLED, Battery
from tests.mission.world import CELL, patch, pose_at

CORRIDOR = ("." * 60,) * 2
# At its near end; and one to drive into westward.
NEAR_DOCK = Dock(x_m=0.5 * CELL, y_m=1.5 * CELL, approach_m=0.0)
WEST_DOCK = Dock(x_m=0.5 * CELL, y_m=5.5 * CELL, yaw_deg=180.0, approach_m=4 * CELL)


def test_a_low_robot_docks_charges_and_continues():
    drive = Battery(0.21)
    drive.run(State.COVERING)
    drive.go(times=20)
    assert drive.mission.state is State.COVERING
    drive.level = 0.2
    drive.go()
    assert (drive.mission.state, drive.mission.reason) == (
        State.RETURNING,
        "on the way to the dock",
    )
    assert drive.updates[-1].reason == "drives to the dock: battery at 20 %"
    drive.run(State.CHARGING)
    assert (drive.cell, drive.walk) == (AT_DOCK, [])
    assert drive.mission.reason == "battery at 20 %, but discharging, goes on at 90 %"
    before = drive.visited
    drive.charge(to=0.87)
    assert drive.mission.state is State.CHARGING
    drive.charge(to=0.95)
    assert drive.mission.state in (State.PLANNING, State.COVERING)
    assert drive.visited == before
    assert len(drive.request.problem.before) > 0, "what is left of the path is kept"
    drive.finish()
    assert len(drive.visited) == 48


def test_the_way_back_counts_and_so_does_what_driving_drains():
    gauge = BatteryGauge()
    for second in range(100):
        level = 0.8 - 0.002 * second
        gauge.receive(BatteryReceived(level), float(second), drives=True)
    assert gauge.drain_per_s == pytest.approx(0.002)
    # Standing and charging show nothing of it, nor does a jump.
    for second in range(100, 200):
        gauge.receive(BatteryReceived(0.2), float(second), drives=second % 2 == 0)
    assert gauge.drain_per_s == pytest.approx(0.002)
    drive = Battery(0.9, drain=0.01)
    drive.run(State.COVERING)
    far = max(drive.mission.charging.turns_back_at for _ in range(20) if drive.go())
    # Ten cells, with some to spare, at a hundredth each, and what is to be left then.
    assert 0.2 < far <= 0.1 + 1.2 * 0.01 * 12


def test_it_continues_at_the_level_that_the_rest_needs():
    drive = Battery(0.19, rows=WALLED, drain=0.001)
    drive.run(State.CHARGING)
    drive.go(times=8)
    assert drive.mission.charging.goes_on_at == pytest.approx(0.3, abs=0.03)
    drive.charge(to=0.4)
    assert drive.level < 0.36
    drive.finish()


def test_floor_beyond_the_map_counts_as_work_left():
    levels = []
    for door in "#", "?":
        drive = Battery(0.19, rows=(*WALLED[:-1], "####" + door + "#####"), drain=0.002)
        drive.run(State.CHARGING)
        drive.go(times=8)
        levels.append(drive.mission.charging.goes_on_at)
    # One cell at the border of the map, and 20 behind it, at 1.2 times 0.002 each.
    assert levels[1] - levels[0] == pytest.approx(0.048, abs=0.01)


@pytest.mark.parametrize(("level", "goes"), [(0.31, True), (0.6, False)])
def test_a_robot_docks_before_its_path_leads_far_from_the_dock(level, goes):
    # A corridor with the dock at its near end; the battery would be due at the far one.
    drive = Battery(level, rows=CORRIDOR, dock=NEAR_DOCK, drain=0.002)
    drive.run(State.COVERING)
    for _ in range(8):
        drive.go()
        drive.level -= 0.002
    assert (drive.mission.state is not State.COVERING) is goes, drive.mission.reason
    assert any(one.reason.endswith("%, the dock is near") for one in drive.updates) is goes


@pytest.mark.parametrize("lie", [0.0, 1.0])
def test_a_charge_that_jumps_and_comes_back_is_not_believed(lie):
    drive = Battery(0.6 if lie == 0.0 else 0.19)
    drive.run(State.COVERING if lie == 0.0 else State.CHARGING)
    drive.go(times=8)
    state, truth = drive.mission.state, drive.level
    for _ in range(5):
        drive.level = lie
        drive.go()
        drive.go()
        drive.level = truth
        drive.go()
        assert drive.mission.state is state
        assert drive.mission.charging.gauge.level == truth
    drive.level = lie
    drive.go(times=8)
    assert drive.mission.charging.gauge.level == lie, "what stays is true"


@pytest.mark.parametrize(("step", "every_s"), [(0.02, 1.0), (0.06, 50.0)])
def test_a_fast_or_coarse_discharge_is_believed(step, every_s):
    gauge = BatteryGauge()
    for number in range(8):
        message = BatteryReceived(0.9 - step * number, "discharging")
        gauge.receive(message, every_s * number, drives=True)
    assert gauge.level < 0.9 - 5 * step


def test_a_full_battery_is_enough_whatever_its_gauge_says():
    drive = Battery(0.15)
    drive.run(State.CHARGING)
    drive.power = "full"
    drive.go()
    assert drive.mission.state is State.CHARGING, "full at 15 % is nothing to set out with"
    drive.charge(to=0.5)
    drive.power = "full"
    drive.go()
    assert drive.mission.order_state.errand == ""


@pytest.mark.parametrize(("low", "full"), [(0.1, 0.25), (0.15, 0.25), (0.2, 0.35)])
def test_a_battery_that_is_full_at_little_does_not_go_to_and_fro(low, full):
    policy = BatteryPolicy(low=low)
    drive = Battery(0.3, rows=CORRIDOR, dock=NEAR_DOCK, battery=policy, drain=0.002)
    begun, covered = [], []
    for _ in range(600):
        if drive.request is not None:
            drive.plan()
        was, docked = drive.cell, drive.mission.state is State.CHARGING
        drive.go()
        if drive.mission.state is State.CHARGING and not docked:
            begun.append(drive.level)
            covered.append(len(drive.visited))
        if drive.cell != was:
            drive.level, drive.power = drive.level - 0.002, "discharging"
        elif docked:
            drive.level, drive.power = min(drive.level + 0.01, max(full, drive.level)), "full"
    assert len(begun) <= 6
    assert covered[1] - covered[0] > 30
    assert min(begun) > 0.1 - 0.002


def test_full_counts_a_tenth_above_where_it_turned_back():
    """Far from its dock it turns back early, and would again."""
    drive = Battery(0.9, rows=CORRIDOR, dock=None, drain=0.01)
    drive.command("start", {"passes": 2})
    charging = drive.mission.charging
    while not drive.mission.order_state.errand:
        if drive.request is not None:
            drive.plan()
        was = drive.cell
        drive.go()
        drive.level -= 0.006 * (drive.cell != was)
    turned_at = charging.turns_back_at
    assert turned_at > 0.25
    drive.run(State.CHARGING)
    for level, goes in ((turned_at + 0.08, False), (turned_at + 0.12, True)):
        drive.level, drive.power = level, "charging"
        drive.go(times=8)
        drive.power = "full"
        drive.go()
        assert (drive.mission.state is not State.CHARGING) is goes
        if not goes:
            shown = f"battery at {percent(level, 0)}, but full, goes on at 90 %"
            assert drive.mission.reason == shown


def test_a_dock_out_of_reach_is_named():
    drive = Battery(0.6)
    drive.run(State.COVERING)
    drive.tell(patch(*["##"] * 2, at=(4, 0)))
    drive.level = 0.1
    for _ in range(8):
        drive.tell(pose_at(*drive.cell))
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason == "no way to the dock: waits for a map that shows one"


def test_without_an_order_it_charges_only_below_its_level():
    for level, state in ((0.25, State.IDLE), (0.15, State.RETURNING)):
        drive = Battery(level, order_state=OrderState.idle(NO_ORDER))
        for _ in range(8):
            drive.tell(pose_at(*drive.cell))
        assert drive.mission.state is state
    drive.run(State.CHARGING)
    drive.charge(to=0.95)
    assert (drive.mission.state, drive.mission.reason) == (State.IDLE, NO_ORDER)


@pytest.mark.parametrize(
    ("power", "state"), [("charging", State.CHARGING), ("discharging", State.RETURNING)]
)
def test_started_again_no_path_leads_it_out_of_its_dock(power, state):
    # It came to stand a little beside the pose that the configuration has.
    dock = Dock(x_m=-0.5 * CELL, y_m=5.5 * CELL, yaw_deg=180.0, approach_m=4 * CELL)
    drive = Battery(0.15, dock=dock)
    drive.run(State.CHARGING)
    note = drive.mission.snapshot().note
    again = Battery(None, AT_DOCK, OrderState.from_json(note), dock=dock)
    for _ in range(5):
        again.tell(pose_at(*AT_DOCK))
    assert again.mission.state is State.BLOCKED
    assert again.mission.reason == "near the dock: waits for the battery to say if it charges"
    assert not len(again.mission.route.path.cells)
    again.level, again.power = 0.15, power
    again.tell(pose_at(*AT_DOCK))
    assert again.mission.state is state


def test_in_its_dock_it_need_not_stand_where_paths_lead():
    drive = Battery(0.15, dock=WEST_DOCK)
    drive.run(State.CHARGING)
    assert drive.cell == (5, 4)
    # Its base takes it in; the scanner sees the dock.
    drive.cell = (5, 0)
    for _ in range(5):
        drive.tell(pose_at(5, 0), patch("###", at=(5, 0)))
    assert drive.mission.state is State.CHARGING


@pytest.mark.parametrize(
    ("off_deg", "state"),
    [(0.0, State.CHARGING), (20.0, State.CHARGING), (-340.0, State.CHARGING),
     (45.0, State.RETURNING), (-90.0, State.RETURNING), (180.0, State.RETURNING)],
)  # fmt: skip
def test_a_robot_is_docked_only_with_the_heading_of_the_dock(off_deg, state):
    drive = Battery(0.15, cell=(5, 7), dock=WEST_DOCK)
    drive.run(State.RETURNING)
    yaw = math.pi + math.radians(off_deg)
    drive.tell(PoseReceived(StampedPose(Pose2D(WEST_DOCK.x_m, WEST_DOCK.y_m, yaw))))
    assert drive.mission.state is state


def test_a_robot_leaving_an_unreachable_dock_starts_before_it():
    dock = Dock(x_m=-1.5 * CELL, y_m=2.5 * CELL, yaw_deg=180.0, approach_m=2 * CELL)
    drive = Battery(0.15, dock=dock)
    drive.run(State.CHARGING)
    docked = PoseReceived(StampedPose(Pose2D(dock.x_m, dock.y_m, math.pi)))
    drive.power = "charging"
    while drive.level < 0.95:
        drive.level += 0.02
        drive.tell(docked)
    for _ in range(10):
        drive.tell(docked)
    if drive.request is not None:
        drive.plan()
    assert drive.mission.state is State.COVERING
    assert tuple(drive.mission.route.path.cells[0].tolist()) == drive.cell


def test_a_battery_that_takes_no_more_is_enough():
    drive = Battery(0.15)
    drive.run(State.CHARGING)
    drive.level, drive.power = 0.88, "not charging"
    drive.go(times=20)
    assert drive.mission.state is State.CHARGING
    drive.tell(pose_at(*drive.cell), after=FULL_AFTER_S + 10.0)
    drive.go()
    assert drive.mission.state is not State.CHARGING


def test_a_battery_reported_full_on_the_way_changes_nothing():
    drive = Battery(0.9)
    drive.run(State.COVERING)
    drive.go(times=10)
    drive.level, drive.power = 0.15, "full"
    states = []
    while drive.mission.state is not State.CHARGING:
        drive.go()
        states.append(drive.mission.order_state.errand)
    assert set(states[states.index("charge") :]) == {"charge"}


def test_without_a_dock_it_charges_where_the_order_began():
    drive = Battery(0.6, (2, 3), dock=None)
    drive.run(State.COVERING)
    drive.go(times=4)
    drive.level = 0.1
    drive.run(State.CHARGING)
    assert drive.cell == (2, 3)


def test_without_the_block_it_only_listens():
    drive = Battery(0.01, battery=None)
    drive.finish()
    assert drive.mission.charging.gauge.level == 0.01
