"""A robot that drives home by command, or at the end of its order: mission.home, mission.dock."""

import math
from dataclasses import replace

import pytest
from msgspec import structs

from fasaco_edge.mission.config import Dock, Place
from fasaco_edge.mission.events import MapReceived, State
from fasaco_edge.mission.work.order_state import OrderState, Stage
from tests.mission.world import (
    CELL,
    CONFIG,
    building,
    idle,
    patch,
    pose_at,
    robot_in,
    started,
    with_policy,
)

ROOM = ("........",) * 6
HOME = Place(x_m=0.5 * CELL, y_m=5.5 * CELL, yaw_deg=90.0)
# Its robot stands in the dock at (5, 6), and before it at (5, 4).
DOCK = Dock(x_m=6.5 * CELL, y_m=5.5 * CELL, approach_m=2 * CELL)


def covering(steps=5, **policy):
    drive = started(*ROOM, config=with_policy(CONFIG, **policy))
    drive.go(times=steps)
    return drive


def arrive(drive, ticks=80):
    """Drive until the robot stands."""
    for _ in range(ticks):
        if drive.mission.state is not State.RETURNING:
            return
        drive.go()
    raise AssertionError(drive.mission.reason)


@pytest.mark.parametrize(
    ("policy", "there"),
    [
        ({}, (0, 0)),
        ({"home": HOME}, (5, 0)),
        ({"dock": DOCK}, (5, 4)),
        ({"home": HOME, "dock": DOCK}, (5, 0)),
    ],
)
def test_it_drives_home_and_resume_continues_the_order(policy, there):
    drive = covering(**policy)
    decision = drive.command("home")
    assert (decision.path.reason, drive.mission.state) == ("drives home", State.RETURNING)
    assert decision.path.end_yaw == {(0, 0): None, (5, 0): math.pi / 2, (5, 4): 0.0}[there]
    arrive(drive)
    assert (drive.cell, drive.walk) == (there, [])
    assert (drive.mission.state, drive.mission.reason) == (
        State.PAUSED,
        "at home, paused by command",
    )
    before = drive.visited
    assert drive.command("resume").plan.reason == "goes on"
    drive.finish()
    assert before < drive.visited
    assert len(drive.visited) == 48


def test_the_way_home_begins_at_the_robot_even_off_its_path():
    """A polished line takes short cuts; the robot drove 20 m to a home that was 3 m away."""
    drive = covering(home=HOME)
    assert drive.cell != (5, 7)
    drive.mission.map.set_path_cell((5, 7))
    path = drive.command("home").path
    assert tuple(path.cells[0].tolist()) == drive.cell
    assert len(path.cells) == 1 + abs(drive.cell[0] - 5) + abs(drive.cell[1] - 0)


def test_it_continues_at_the_nearer_end_of_the_rest():
    row, col = covering().mission.route.path.cells[-1].tolist()
    drive = covering(home=Place(x_m=(col + 0.5) * CELL, y_m=(row + 0.5) * CELL))
    drive.command("home")
    arrive(drive)
    left = drive.mission.route.aside.tolist()
    assert left[-1] == [row, col]
    drive.command("resume")
    assert drive.request.problem.before.tolist() == left[::-1]
    drive.finish()
    assert len(drive.visited) == 48


def test_paused_on_the_way_home_it_stops_and_resumed_drives_home():
    drive = covering(20)
    drive.command("home")
    drive.go()
    for path in (drive.command("pause").path, drive.command("pause").path):
        assert path is None or not len(path.cells)
    assert (drive.mission.state, drive.mission.reason) == (State.PAUSED, "paused by command")
    assert drive.walk == []
    drive.command("resume")
    drive.command("resume")
    assert drive.mission.reason == "on the way home"
    arrive(drive)
    assert (drive.cell, drive.mission.reason) == ((0, 0), "at home, paused by command")
    assert drive.command("resume").plan.reason == "goes on"
    drive.finish()


def test_after_a_reset_home_is_where_the_next_order_begins():
    drive = covering(20)
    began = drive.cell
    drive.command("reset")
    drive.command("start")
    drive.plan()
    drive.go(times=8)
    drive.command("home")
    arrive(drive)
    assert drive.cell == began != (0, 0)


def test_without_a_home_the_command_is_refused():
    drive = idle(*ROOM)
    drive.command("home")
    assert str(drive.refused) == "there is no home yet"


def test_a_home_out_of_reach_is_waited_for():
    drive = covering(home=structs.replace(HOME, x_m=7.5 * CELL))
    drive.tell(patch(*["#"] * 6, at=(0, 6)))
    drive.command("home")
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason == "no way home: waits for a map that shows one"
    assert drive.walk == []
    drive.tell(patch(*["."] * 6, at=(0, 6)))
    arrive(drive)
    assert drive.cell == (5, 7)


def test_a_way_home_that_is_blocked_leads_round():
    drive = covering(home=HOME)
    drive.command("home")
    drive.tell(patch("#", at=drive.walk[2]))
    arrive(drive)
    assert drive.cell == (5, 0)


def test_a_robot_carried_off_its_way_finds_another():
    drive = covering(home=HOME)
    drive.command("home")
    drive.cell = (5, 7)
    for _ in range(3):
        drive.tell(pose_at(5, 7), after=2.0)
    arrive(drive)
    assert drive.cell == (5, 0)


def test_an_order_ends_at_home():
    drive = idle(*ROOM, cell=(3, 3), config=with_policy(CONFIG, home=HOME))
    drive.command("start", {"return_home": True})
    drive.plan()
    drive.finish()
    assert drive.cell == (5, 0)


def test_the_errand_survives_a_restart():
    drive = covering(20)
    drive.command("home")
    note = drive.mission.snapshot().note
    kept = OrderState.from_json(note)
    assert replace(kept, reached=None) == drive.mission.order_state
    assert drive.mission.order_state.errand == "home"
    again = robot_in(*ROOM, cell=drive.cell, order_state=OrderState.from_json(note))
    assert again.mission.state is State.RETURNING


def test_an_order_without_an_errand_is_readable_by_older_daemons():
    drive = covering()
    assert "errand" not in drive.mission.snapshot().note


@pytest.mark.parametrize("how", ["home", "return_home"])
def test_a_path_cut_off_by_a_map_behind_it_is_replaced_at_once(how):
    """Its own cell is blocked, the one beside it is not, and no way leads home from there."""
    drive = robot_in("............")
    drive.finish()
    if how == "home":
        drive.command("home")
    else:
        drive.command("start", {"return_home": True, "keep_covered": True})
    while drive.cell != (0, 8):
        assert drive.walk
        drive.go()
    assert drive.walk
    edge = pose_at(0, 8.45)
    drive.tell(edge)
    blocked = MapReceived(building("........#..."))
    decision = drive.tell(blocked, edge)
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason == "no way home: waits for a map that shows one"
    assert decision.path is not None
    assert drive.walk == []


# Floor out of reach as the robot sets out for home, and opens while it is on its way.


# Home is in the small room.
ROOMS = ("...#......", "...#......", "..........", "...#......")
DOOR = (1, 3)
START = (0, 9)
SMALL_ROOM = Place(x_m=0.5 * CELL, y_m=0.5 * CELL)
SHUT, OPEN = patch("#", at=DOOR), patch(".", at=DOOR)


def returning(retries=2, rows=ROOMS):
    """A robot that sets out for home while the door is shut."""
    config = with_policy(CONFIG, home=SMALL_ROOM, retries=retries, retry_s=5.0)
    drive = idle(*rows, cell=START, config=config)
    drive.command("start", {"return_home": True})
    drive.tell(SHUT)
    assert until(drive, lambda: drive.mission.order_state.stage is Stage.RETURNING)
    return drive


def until(drive, holds, ticks=400):
    for _ in range(ticks):
        if holds():
            return True
        drive.tick()
    return holds()


def ends(drive):
    return until(drive, lambda: drive.mission.order_state.stage is Stage.OVER)


@pytest.mark.parametrize("retries", [0, 2])
def test_a_way_home_that_opens_leads_over_the_floor_left(retries):
    drive = returning(retries)
    until(drive, lambda: drive.now > 60.0)
    assert drive.mission.reason == "no way home: waits for a map that shows one"
    drive.tell(OPEN)
    assert ends(drive)
    assert drive.mission.reason.startswith("every reachable cell is covered")
    assert drive.cell == (0, 0)


def test_a_narrow_opening_does_not_turn_the_robot_back():
    drive = returning(rows=("##########", *ROOMS))
    drive.tell(patch("......", at=(4, 4)))
    until(drive, lambda: drive.now > 60.0)
    assert drive.mission.order_state.stage is Stage.RETURNING


def test_a_door_that_opens_repeatedly_does_not_delay_the_end():
    drive = returning()
    turned = 0
    for _ in range(10):
        if not until(drive, lambda: drive.mission.order_state.stage is Stage.RETURNING):
            break
        drive.tell(OPEN, after=5.0)
        turned += drive.mission.order_state.stage is Stage.RETRYING
        drive.tell(SHUT)
    assert turned == 3
    drive.tell(OPEN)
    assert ends(drive)
    assert "left over" in drive.mission.reason
