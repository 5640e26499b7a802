"""Trouble has a name in every state: lost poses, stale maps, silent batteries, dead docks."""

import pytest

from fasaco_edge.mission.core.in_dock import FLAT_S
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.standing import STANDING_S
from fasaco_edge.mission.core.trouble import RULES
from fasaco_edge.mission.events import BatteryReceived, MapReceived, State
from fasaco_edge.wire.documents.replies import TROUBLES
from tests.mission.battery import AT_DOCK, Battery
from tests.mission.world import CONFIG, Drive, building, patch, pose_at, robot_in, with_policy

ROOM = (*["??????????"] * 2, *["##########"] * 3, *["........??"] * 6)
PATIENT = {"lost_pose_s": 3.0, "stale_map_s": 40.0}
A_MINUTE_S = 60
# Shorter than any limit.
PERIOD_S = 10


def codes(drive):
    return [trouble.code for trouble in drive.mission.troubles]


def live(drive, seconds, without="", **battery):
    """Let a robot stand; all its inputs come once a second, but one."""
    for _ in range(round(seconds)):
        heard = [] if without == "pose" else [pose_at(*drive.cell)]
        heard += [] if without == "map" else [patch(".", at=(0, 0))]
        if without == "battery":
            drive.level = None
        elif "fall" in battery:
            drive.level = max(drive.level - battery["fall"], 0.0)
        elif "rise" in battery:
            drive.level = min(drive.level + battery["rise"], 1.0)
        drive.tell(*heard)


def succeed(drive):
    """Let another mission go on, as the daemon does after a reload."""
    before, after = drive.mission, Mission(drive.config)
    after.restore(before.snapshot(), before.order_state)
    after.continue_from(before)
    drive.mission, drive.request, drive.walk, drive.revision = after, None, [], 0
    drive.tell(*before.newest_inputs())


def live_through(drive, seconds, without="", **battery):
    """Let a robot stand while its mission is replaced again and again: no limit begins anew."""
    for _ in range(seconds // PERIOD_S):
        live(drive, PERIOD_S, without, **battery)
        succeed(drive)


def robot_at(state):
    """A robot that has begun to sweep, and is in a state now."""
    if state is State.CHARGING:
        return charging()
    drive = Battery(0.8, rows=ROOM, **PATIENT)
    drive.run(State.COVERING)
    drive.go(times=6)
    if state is State.BLOCKED:
        drive.cell = (7, 3)
    elif state is State.DONE:
        drive.finish()
    elif state in COMMANDS:
        drive.command(COMMANDS[state])
    return drive


def charging(power="charging", level=0.15):
    drive = Battery(level, rows=ROOM, **PATIENT)
    drive.run(State.CHARGING)
    drive.power = power
    return drive


COMMANDS = {State.PAUSED: "pause", State.RETURNING: "home", State.IDLE: "cancel"}
AT_REST = State.PAUSED, State.BLOCKED, State.CHARGING
DRIVING = State.COVERING, State.RETURNING
OVER = State.DONE, State.IDLE
SILENT = {"pose": "no_pose", "map": "no_map", "battery": "no_battery"}


@pytest.mark.parametrize("lives", [live, live_through])
@pytest.mark.parametrize("kind", SILENT)
@pytest.mark.parametrize("state", AT_REST)
def test_each_resting_state_reports_silence_within_a_minute(state, kind, lives):
    drive = robot_at(state)
    lives(drive, PERIOD_S, rise=0.001)
    assert (drive.mission.state, codes(drive)) == (state, [])
    lives(drive, A_MINUTE_S, without=kind, rise=0.001)
    assert drive.mission.state is state, "what it does stays in sight"
    # The blocked one stands on a pixel that the map shows as occupied.
    inside = ["shut_in"] if state is State.BLOCKED and lives is live else []
    assert codes(drive) == [SILENT[kind], *inside]
    since = drive.mission.troubles[0].since
    assert drive.now - since > PERIOD_S, "it is one trouble all the time"
    assert not drive.walk
    if kind != "battery":
        live(drive, 1, rise=0.001)
        assert codes(drive) == inside


@pytest.mark.parametrize("kind", SILENT)
@pytest.mark.parametrize("state", DRIVING)
def test_a_driving_robot_is_degraded_and_lists_the_trouble(state, kind):
    drive = robot_at(state)
    # It moves to and fro, so that nobody takes it for one that is stuck.
    for second in range(A_MINUTE_S):
        row, col = drive.cell
        heard = [] if kind == "pose" else [pose_at(row, col + 0.45 * (second % 2))]
        heard += [] if kind == "map" else [patch(".", at=(0, 0))]
        drive.level = None if kind == "battery" else drive.level
        drive.tell(*heard)
    assert drive.mission.state is State.DEGRADED
    assert codes(drive) == [SILENT[kind]]
    assert drive.mission.reason == drive.mission.troubles[0].text


@pytest.mark.parametrize("kind", SILENT)
@pytest.mark.parametrize("state", OVER)
def test_a_robot_without_work_may_be_switched_off(state, kind):
    drive = robot_at(state)
    live(drive, 200, without=kind)
    assert (drive.mission.state, codes(drive)) == (state, [])


def test_a_first_map_and_pose_are_reported_missing():
    drive = Drive((0, 0), config=with_policy(CONFIG, **PATIENT))
    drive.tell(after=31.0)
    assert (drive.mission.state, codes(drive)) == (State.WAITING_FOR_MAP, ["no_pose", "no_map"])
    drive.tell(MapReceived(building("....")))
    assert (drive.mission.state, codes(drive)) == (State.WAITING_FOR_POSE, ["no_pose"])
    drive.command("pause")
    assert (drive.mission.state, codes(drive)) == (State.PAUSED, ["no_pose"])
    drive.tell(pose_at(0, 0))
    assert codes(drive) == []


def test_a_robot_at_rest_may_publish_its_pose_less_often():
    drive = robot_at(State.PAUSED)
    for _ in range(5):
        live(drive, 20, without="pose")
        live(drive, 1)
        assert codes(drive) == []


def test_poses_in_another_frame_are_missing_while_paused_too():
    drive = robot_at(State.PAUSED)
    for _ in range(A_MINUTE_S):
        drive.tell(pose_at(*drive.cell, frame="odom"), patch(".", at=(0, 0)))
    assert codes(drive) == ["no_pose"]
    assert "poses arrive in frame 'odom', the map is in 'map'" in drive.mission.troubles[0].text


@pytest.mark.parametrize("kind", ["nan", "to and fro"])
def test_battery_messages_that_say_nothing_are_a_silence(kind):
    drive = charging()
    for second in range(A_MINUTE_S):
        level = None if kind == "nan" else 0.9 if second % 2 else 0.05
        drive.level = None
        message = BatteryReceived(level, "charging")
        drive.tell(pose_at(*drive.cell), patch(".", at=(0, 0)), message)
    assert (drive.mission.state, codes(drive)) == (State.CHARGING, ["no_battery"])
    why = {"nan": "its messages give none", "to and fro": "it jumps to and fro"}[kind]
    assert why in drive.mission.troubles[0].text


@pytest.mark.parametrize("power", ["discharging", "not charging", "unknown"])
def test_a_dock_without_current_is_reported_within_a_minute(power):
    drive = charging(power)
    live(drive, A_MINUTE_S)
    assert (drive.mission.state, codes(drive)) == (State.CHARGING, ["no_current"])
    assert f"reports '{power}', and its level does not rise" in drive.mission.troubles[0].text


@pytest.mark.parametrize("power", ["discharging", "not charging", "unknown", "charging", "full"])
def test_a_falling_level_in_the_dock_outweighs_reported_states(power):
    drive = charging(power)
    live(drive, A_MINUTE_S, fall=0.0005)
    assert (drive.mission.state, codes(drive)) == (State.CHARGING, ["no_current"])
    while drive.level > 0.0:
        live(drive, 1, fall=0.0005)
        assert codes(drive) == ["no_current"]
    drive.power = "charging"
    live(drive, A_MINUTE_S, rise=0.0005)
    assert codes(drive) == [], "the current is back"


@pytest.mark.parametrize("power", ["unknown", "discharging"])
def test_a_battery_that_rises_charges_whatever_it_reports(power):
    drive = charging(power)
    for _ in range(1200):
        live(drive, 1, rise=0.0003)
        assert codes(drive) == []


def test_a_coarse_gauge_may_charge_for_minutes_per_step():
    drive = charging()
    live(drive, FLAT_S - 30)
    assert codes(drive) == []
    live(drive, 60)
    assert codes(drive) == ["no_current"]
    assert "has not risen for 10 minutes" in drive.mission.troubles[0].text


@pytest.mark.parametrize("state", OVER)
def test_a_robot_without_work_stands_in_a_dead_dock(state):
    drive = charging(level=0.15)
    live(drive, 400, rise=0.001)
    if state is State.IDLE:
        drive.command("cancel")
    else:
        drive.power = "charging"
        while drive.mission.state is State.CHARGING:
            live(drive, 1, rise=0.002)
        drive.finish()
        drive.cell, drive.level = AT_DOCK, 0.6
        live(drive, 6)
    assert (drive.mission.state, drive.cell) == (state, AT_DOCK)
    drive.power = "discharging"
    live(drive, A_MINUTE_S)
    assert codes(drive) == ["no_current"]


def test_a_loose_contact_does_not_undock_a_resting_robot():
    # Its base has moved it into the dock, some way from the dock's place.
    drive = robot_at(State.PAUSED)
    drive.cell = (AT_DOCK[0], AT_DOCK[1] + 1)
    for second in range(round(FLAT_S) + 30):
        drive.power = "charging" if second % 2 else "discharging"
        live(drive, 1)
    assert (drive.mission.state, codes(drive)) == (State.PAUSED, ["no_current"])


def test_a_full_battery_in_its_dock_may_discharge():
    drive = robot_at(State.DONE)
    drive.cell, drive.level, drive.power = AT_DOCK, 0.95, "discharging"
    live(drive, 300)
    assert (drive.mission.state, codes(drive)) == (State.DONE, [])


def test_a_trouble_keeps_the_time_when_it_began():
    drive = robot_at(State.PAUSED)
    live(drive, 32, without="pose")
    (first,) = drive.mission.troubles
    live(drive, 100, without="pose")
    (later,) = drive.mission.troubles
    assert (later.since, later.do) == (first.since, first.do)
    assert later.do


def test_an_unused_battery_and_limits_of_0_are_no_trouble():
    drive = robot_in("....")
    drive.command("pause")
    drive.tell(after=1000.0)
    assert (drive.mission.state, codes(drive)) == (State.PAUSED, [])


def test_the_contract_names_each_trouble():
    assert {rule.code for rule in RULES} | {"not_begun", "two_publishers", "no_effect"} == set(
        TROUBLES
    )


# A mission that goes on for another one, as after a reload or a mask.


def test_a_pose_that_never_came_is_missing():
    drive = Drive((0, 0), MapReceived(building("....")), config=with_policy(CONFIG))
    for _ in range(A_MINUTE_S // PERIOD_S):
        drive.tell(after=PERIOD_S)
        succeed(drive)
    assert (drive.mission.state, codes(drive)) == (State.WAITING_FOR_POSE, ["no_pose"])


def test_a_dead_dock_is_found():
    drive = charging(power="discharging")
    live_through(drive, A_MINUTE_S)
    assert (drive.mission.state, codes(drive)) == (State.CHARGING, ["no_current"])


def test_a_charging_robot_stays_docked_and_knows_its_battery():
    drive = charging()
    level = drive.mission.charging.gauge.level
    drive.level, drive.power = None, "discharging"
    row, col = drive.cell
    drive.cell = row + 0.9, col
    drive.tell(pose_at(*drive.cell))
    assert drive.mission.state is State.CHARGING, "its base moved it within reach of the contacts"
    succeed(drive)
    assert (drive.mission.state, drive.walk) == (State.CHARGING, [])
    assert drive.mission.charging.gauge.level == level


def test_a_robot_that_stands_is_found():
    drive = robot_at(State.COVERING)
    for _ in range(4 * int(STANDING_S) // PERIOD_S):
        succeed(drive)
        for _ in range(PERIOD_S):
            drive.tell(patch(".", at=(0, 0)), pose_at(*drive.cell))
            if drive.request is not None:
                drive.plan()
    assert (drive.mission.state, codes(drive)) == (State.DEGRADED, ["stands"])


def test_poses_that_stop_after_a_change_of_frame_are_missed():
    """The last one lay in the frame before."""
    drive = Drive((0, 0), config=with_policy(CONFIG, lost_pose_s=3.0))
    drive.tell(MapReceived(building("........", frame="a")), pose_at(0, 0, frame="a"))
    drive.plan()
    drive.tell(pose_at(0, 1, frame="a"))
    while drive.mission.grid.frame == "a":
        drive.tell(MapReceived(building("........", frame="b")), pose_at(0, 1, frame="b"), after=1)
    assert codes(drive) == []
    drive.tell(after=4.0)
    assert codes(drive) == ["no_pose"]
