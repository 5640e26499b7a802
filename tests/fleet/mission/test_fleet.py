"""Robots that share an area: nothing is left out whatever happens, and little is swept twice."""

import math
import time
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission.layer import MANY_TAKEN
from fasaco_edge.fleet.mission.members import GONE_S
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS, MOST_TILES, SharedProgress
from fasaco_edge.fleet.mission.shared_work import MOST_AHEAD
from fasaco_edge.fleet.mission.tiles import TILE_BYTES, SweptQueue
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones
from tests.fleet.mission.fleets import FleetDrive, FleetRobot, flaky
from tests.mission.world import CONFIG, rectangle, with_policy
from tests.support.examples import examples

HALL = ("." * 24,) * 12
ROOMS = (
    "........#........#......",
    "........#........#......",
    "........#...............",
    "........#........#......",
    "........#........#......",
    "........................",
    "........#........#......",
    "........#........#......",
    "........#........#......",
)
TWO = {"r1": (0, 0), "r2": (0, 1)}
THREE = {"r1": (0, 0), "r2": (0, 23), "r3": (8, 12)}


@cache
def alone(rows):
    drive = FleetDrive(rows, {"r1": (0, 0)})
    drive.finish()
    return drive.seconds


@pytest.mark.parametrize("rows", [HALL, ROOMS], ids=["hall", "rooms"])
@pytest.mark.parametrize(("starts", "share"), [(TWO, 0.68), (THREE, 0.55)], ids=["two", "three"])
def test_robots_share_what_one_would_do(rows, starts, share):
    fleet = FleetDrive(rows, starts)
    fleet.finish()
    assert fleet.left_out() == set()
    assert fleet.seconds <= share * alone(rows)


@pytest.mark.parametrize("seed", range(2))
def test_lost_and_repeated_messages_leave_no_cell_out(seed):
    fleet = FleetDrive(ROOMS, THREE)
    fleet.finish(**flaky(seed))
    assert fleet.left_out() == set()


@pytest.mark.parametrize("at", [5, 40, 70])
def test_the_part_of_a_lost_robot_is_taken_over(at):
    fleet = FleetDrive(HALL, TWO)
    fleet.run(at)
    del fleet.robots["r2"]
    survivor = fleet.robots["r1"].mission
    fleet.run(int(GONE_S) + 3)
    assert not survivor.company.parts
    fleet.finish()
    assert fleet.left_out() == set()


def test_a_standing_robot_loses_its_part_until_it_moves():
    fleet = FleetDrive(HALL, TWO)
    fleet.run(20)
    fleet.robots["r2"].hangs = True
    fleet.run(12)
    assert not fleet.robots["r1"].mission.company.parts
    fleet.robots["r2"].hangs = False
    fleet.run(4)
    assert fleet.robots["r1"].mission.company.parts
    fleet.finish()
    assert fleet.left_out() == set()


def test_a_network_that_is_split_and_heals_unites_what_was_swept():
    fleet = FleetDrive(HALL, THREE)
    fleet.run(20)
    fleet.hears = lambda speaker, listener: "r3" not in (speaker, listener)
    fleet.run(30)
    fleet.hears = lambda speaker, listener: True
    fleet.finish()
    assert fleet.left_out() == set()
    assert fleet.seconds < 0.6 * alone(HALL)


def test_a_newer_division_without_this_robot_hides_no_other():
    # r1 has lost the network: it takes the others for gone, and divides for itself alone. Meanwhile
    # r2 and r3 have both divided anew; r3 has to take over what r2 has made.
    fleet = FleetDrive(HALL, THREE)
    fleet.run(20)
    robots = fleet.robots
    number = robots["r3"].mission.company.numbers.number
    shifted = tuple(replace(part, handicap_s=1.5) for part in robots["r2"].report().parts)
    alone = replace(robots["r1"].report(), division=number + 2, by="r1", parts=())
    of_r2 = replace(robots["r2"].report(), division=number + 1, by="r2", parts=shifted)
    robots["r3"].tell(alone, of_r2)
    robots["r3"].tick()
    fleet = robots["r3"].mission.company
    assert (fleet.numbers.number, fleet.numbers.by) == (number + 1, "r2")
    assert fleet.parts == shifted


def sweeps_everything_again(robot):
    zone = {"name": "hall", "polygon": rectangle(0, 0, 12, 24)}
    return robot.command("start", {"zones": [zone]})


def test_an_order_begun_later_counts_no_sweep_from_before():
    fleet = FleetDrive(HALL, TWO)
    fleet.finish()
    fleet.swept = set()
    for robot in fleet.robots.values():
        sweeps_everything_again(robot)
    assert all(robot.mission.state != "done" for robot in fleet.robots.values())
    begun = fleet.seconds
    fleet.finish()
    # But for where the tools were when the orders came.
    assert len(fleet.left_out()) <= 2
    assert fleet.seconds - begun < 0.75 * alone(HALL)


def test_a_reset_elsewhere_sweeps_again_and_keeps_the_order():
    fleet = FleetDrive(HALL, TWO)
    fleet.run(60)
    ours, other = fleet.robots["r1"], fleet.robots["r2"]
    sweeps_everything_again(ours)
    fleet.run(5)
    before = ours.mission.order_state.order
    other.command("reset")
    fleet.run(2)
    assert ours.mission.covered.shared.cells_of("r2") <= 4
    assert ours.mission.order_state.order == before
    fleet.finish_one(ours)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"frame": "hall_2"}, "its frame is 'hall_2', here it is 'map'"),
        ({"misfit": "its cells are 0.5 m wide, here they are 0.25 m"}, "its cells are 0.5 m wide"),
    ],
)
def test_a_robot_that_does_not_fit_is_named_and_left_out(changes, why):
    fleet = FleetDrive(HALL, TWO)
    ours, other = fleet.robots.values()
    report = other.report()
    ours.tell(replace(report, **changes))
    ours.tick()
    assert ours.mission.company.others.known["r2"].absence(ours.now).startswith(why)
    assert not ours.mission.company.parts
    assert ours.mission.covered.shared.cells_of("r2") == 0


def test_cells_swept_by_others_survive_a_restart():
    fleet = FleetDrive(HALL, TWO)
    fleet.run(30)
    ours = fleet.robots["r1"].mission
    kept = ours.snapshot()
    again = FleetRobot("r1", (0, 0), HALL, before=kept)
    assert again.mission.covered.shared.cells_of("r2") == ours.covered.shared.cells_of("r2") > 20
    assert again.mission.covered.shared.epoch == ours.covered.shared.epoch
    # What is disregarded stays so.
    sweeps_everything_again(again)
    restarted = FleetRobot("r1", (0, 0), HALL, before=again.mission.snapshot())
    restarted.tell(fleet.robots["r2"].report())
    assert restarted.mission.covered.shared.cells_of("r2") == 0


@pytest.mark.parametrize(
    "kept",
    [
        b'{"version":2,"fleet":{"epoch":"7"}}',
        b'{"version":1,"epoch":7,"robots":{"r2":[1,[[0,0,"AAAA"]],[]]}}',
        b'{"version":1,"epoch":7}',
        b'{"version":1,"epoch":7,"robots":{"\xff":[1,[],[]]}}',
        b"\x00",
    ],
)
def test_unreadable_progress_of_others_is_received_again(kept):
    shared = SharedProgress()
    shared.restore(kept)
    shared.begin_epoch(9)
    assert shared.epoch == 9
    assert not shared.swept(Window(0, 0, 9, 9)).any()


def test_an_unsweepable_cell_is_given_up_while_another_works():
    fleet = FleetDrive(HALL, TWO, with_policy(CONFIG, retries=1, retry_s=30.0))
    ours, other = fleet.robots.values()
    ours.cannot = {(11, 23)}
    report = replace(other.report(), tiles=())
    reasons = []
    for second in range(500):
        ours.tell(replace(report, x=0.5 + second % 2))
        ours.tick()
        reasons.append(ours.mission.reason)
    assert ours.mission.company.parts
    assert "1 cell not reached: tried again after 30 s (1 of 1)" in reasons
    assert "0.1 m2 not reached: left over after" in reasons[-1]
    assert ours.mission.route.requests.plans < 40


def test_after_a_loop_closure_nothing_uncertain_is_given_back():
    ledger, block = (
        MissionLedger(0.3, 0.3, shared=SharedProgress()),
        {(row, col) for row in range(10) for col in range(10)},
    )
    ledger.shared.begin_epoch(5)
    ledger.shared.receive("r2", 1, tiles_of(block))
    ledger.lift_tool()
    ledger.forget_uncertain(Motion(Pose2D(1.5, 1.5), Pose2D(2.1, 1.5)))
    left = ledger.shared.swept(Window(0, 0, 10, 10))
    # It was there wherever between its two places the map lay.
    assert left[:, 2:].all()
    assert not left[:, :2].any()
    assert ledger.shared.epoch == 6
    ledger.shared.receive("r2", 1, tiles_of(block))
    assert (ledger.shared.swept(Window(0, 0, 10, 10)) == left).all()
    # Who swept them forgets them, and sweeps one again: that counts.
    ledger.shared.receive("r2", 2, tiles_of({(99, 99)}))
    ledger.shared.receive("r2", 3, tiles_of({(0, 5), (1, 0)}))
    assert ledger.shared.cells_of("r2") == 1


def test_memory_for_a_robot_with_false_cells_is_bounded():
    fleet = FleetDrive(HALL, TWO)
    ours, other = fleet.robots.values()
    tiles = tuple(((row, 1000), bytes(TILE_BYTES)) for row in range(MOST_TILES + 1))
    decision = ours.tell(replace(other.report(), tiles=tiles))
    assert [fault.code for fault in decision.faults] == ["fleet_member"]
    ours.tick()
    assert ours.mission.state == "covering"
    assert ours.mission.company.others.known["r2"].absence(ours.now).endswith("are kept at most")
    # There is room for others.
    assert not ours.tell(replace(other.report(), robot="r3", tiles=tiles[:2])).faults


def test_absent_robots_that_swept_least_make_room():
    shared, members = SharedProgress(), [f"r{number}" for number in range(MOST_ROBOTS)]
    for number, robot in enumerate(members):
        shared.receive(robot, 1, tiles_of({(number, col) for col in range(9 - number % 8)}))
    with pytest.raises(FleetError, match="32 robots"):
        shared.receive("new", 1, (), members)
    assert shared.receive("new", 1, (), members[8:])
    assert [shared.cells_of(robot) for robot in members[6:9]] == [3, 0, 9]
    assert not shared.receive("newer", 1, (), members)


def test_a_zone_swept_again_by_many_does_not_delay_others():
    ledger, bits = MissionLedger(0.3, 0.3, shared=SharedProgress()), b"\xff" * TILE_BYTES
    angles = np.linspace(0.0, 2.0 * np.pi, 900, endpoint=False)
    ring = tuple((48.0 + 40.0 * math.cos(angle), 48.0 + 40.0 * math.sin(angle)) for angle in angles)
    for robot in range(MOST_ROBOTS - 1):
        ledger.shared.receive(f"m{robot}", 1, [((n // 5, n % 5), bits) for n in range(24)])
    inside = partial(in_zones, (Zone("ring", ring),))
    ledger.forget(inside)
    asked = []

    def again(window, edge_m):
        asked.append(window)
        return in_zones((Zone("again", tuple(reversed(ring))),), window, edge_m)

    ledger.forget(again)
    # Once for each tile, whoever has swept it.
    assert len(asked) == 24
    whole = Window(0, 0, 320, 320)
    swept = ledger.shared.swept(whole)
    assert not swept[inside(whole, 0.3)].any()
    assert swept[~inside(whole, 0.3)][:1000].all()


def everywhere(rows, _cols):
    return np.ones(len(rows), np.bool_)


@pytest.mark.parametrize(
    ("kept", "counted"), [((), 20), (range(3), 17), (None, 0)], ids=["none", "some", "unknown"]
)
def test_disregarded_cells_count_once_swept_again(kept, counted):
    shared, cells = SharedProgress(), {(0, col) for col in range(20)}
    shared.begin_epoch(1)
    shared.receive("r2", 1, tiles_of(cells))
    shared.disregard(everywhere)
    # It has forgotten all but what it kept, and swept all again, out of hearing.
    told = None if kept is None else tiles_of({(0, col) for col in kept})
    for _ in range(3):
        shared.receive("r2", 2, tiles_of(cells), (), told)
        assert shared.cells_of("r2") == counted
    # In an epoch, what is disregarded stays so.
    shared.disregard(everywhere)
    shared.receive("r2", 2, tiles_of(cells), (), told)
    assert shared.cells_of("r2") == 0


def test_a_second_order_counts_cells_swept_for_it_out_of_range():
    fleet = FleetDrive(HALL, TWO)
    fleet.finish()
    ours, other = fleet.robots.values()
    for robot in (ours, other):
        sweeps_everything_again(robot)
    fleet.hears = lambda speaker, listener: False
    fleet.run(40)
    fleet.hears = lambda speaker, listener: True
    fleet.run(2)
    # All but what it passed before it first told of the order.
    assert ours.mission.covered.shared.cells_of("r2") >= other.mission.snapshot().cells - 2 > 35


def test_disregarded_cells_are_dropped_with_the_cells_or_if_many():
    shared = SharedProgress()
    for epoch in range(1, 120):
        places = range(100 * epoch, 100 * epoch + 100)
        shared.receive("r2", epoch, [((row, 0), b"\xff" * TILE_BYTES) for row in places])
        shared.disregard(everywhere)
    assert len(shared.encode()) < 2 * MOST_TILES * 700
    shared.receive("r2", 120, [((row, 0), bytes(TILE_BYTES)) for row in places])
    shared.receive("r2", 120, [((row, 0), b"\xff" * TILE_BYTES) for row in places])
    assert shared.cells_of("r2") == 100 * 8 * TILE_BYTES


def test_cells_that_this_robot_swept_stay_its_own():
    fleet = FleetDrive(HALL, TWO)
    fleet.run(50)
    ours, other = fleet.robots.values()
    report = other.report()
    seen = {tuple(cell) for cell in ours.driven}
    assert len(seen) >= MANY_TAKEN
    ours.tell(replace(report, tiles=tiles_of(seen)))
    assert ours.request is None


def test_cells_of_this_robot_are_taken_again_after_a_forget():
    fleet = FleetDrive(HALL, {"r1": (0, 0), "r2": (0, 12)})
    fleet.run(4)
    ours, other = fleet.robots.values()
    report, ahead = replace(other.report(), tiles=()), ours.walk[::-1]
    taken = replace(report, tiles=tiles_of(ahead[: MANY_TAKEN + 9]))
    for told, is_replanned in (
        (taken, True),
        (replace(report, epoch=report.epoch + 1), True),
        (replace(taken, epoch=report.epoch + 1), True),
        (replace(taken, epoch=report.epoch + 1), False),
    ):
        ours.tell(told)
        assert (ours.request is not None) == is_replanned
        if is_replanned:
            ours.plan()


def test_a_burst_of_fleet_messages_does_not_delay_the_loop():
    fleet = FleetDrive(["." * 300] * 300, {"r1": (0, 0), "r2": (299, 299)})
    ours, other = fleet.robots.values()
    report = other.report()

    def said(bit):
        bits = bytes([bit]) + bytes(TILE_BYTES - 1)
        tiles = tuple(((place // 5, place % 5), bits) for place in range(24))
        return [replace(report, robot=f"m{name}", tiles=tiles) for name in range(MOST_ROBOTS - 1)]

    ours.tell(*said(1))
    before = time.thread_time()
    ours.tell(*said(2), *said(4), after=0.0)
    assert time.thread_time() - before < 0.1
    assert ours.mission.covered.shared.cells_of("m7") == 24 * 3
    assert np.count_nonzero(ours.mission.covered.shared.swept(Window(0, 0, 300, 300))) == 24 * 3


def test_robots_beyond_the_limit_do_not_replace_each_other():
    fleet = FleetDrive(HALL, TWO)
    ours, other = fleet.robots.values()
    report, names = other.report(), [f"m{number}" for number in range(MOST_ROBOTS + 8)]
    for second in range(20):
        said = [replace(report, robot=name, x=0.5 + 0.2 * (second % 2)) for name in names]
        decision = ours.tell(*said, after=0.0)
        assert [fault.code for fault in decision.faults] == ["fleet_member"] * 8
        ours.tick()
    assert list(ours.mission.company.others.known) == names[:MOST_ROBOTS]
    assert ours.mission.company.numbers.number <= 3
    # Those that are gone make room.
    later = [replace(report, robot=name) for name in names[8:]]
    assert not ours.tell(*later, after=GONE_S + 1.0).faults


def test_a_robot_that_comes_and_goes_keeps_the_paths_of_others():
    fleet = FleetDrive(HALL, TWO)
    ours, other = fleet.robots.values()
    report, plans = other.report(), ours.mission.route.requests.plans
    for second in range(40):
        state = "covering" if second % 2 else "blocked"
        ours.tell(replace(report, state=state, x=1.0 + 0.1 * (second % 3)), after=0.0)
        ours.tick()
    assert 2 <= ours.mission.company.numbers.number <= 9
    assert ours.mission.route.requests.plans - plans <= 9


def test_a_robot_without_a_part_does_not_divide_again_and_again():
    fleet = FleetDrive(HALL, TWO)
    ours, other = fleet.robots.values()
    ours.hangs = True
    swept = {(row, col) for row in range(12) for col in range(24)} - {(11, 23)}
    report = replace(other.report(), tiles=tiles_of(swept), y=2.7)
    for second in range(20):
        ours.tell(replace(report, x=5.6 + 0.2 * (second % 2)), after=0.0)
        ours.tick()
    assert ours.mission.company.part_cells() < 200
    assert 0 < ours.mission.company.numbers.number <= 4


@pytest.mark.parametrize("begun", [0, 4])
def test_a_division_with_an_impossible_number_is_ignored(begun):
    fleet = FleetDrive(HALL, TWO)
    fleet.run(begun)
    ours, other = fleet.robots.values()
    liar = replace(other.report(), robot="r0", division=2**31 - 1, state="idle")
    for _ in range(6):
        ours.tell(liar)
        fleet.tick()
    assert 0 < ours.mission.company.numbers.number < 10
    assert abs(ours.mission.company.numbers.number - other.mission.company.numbers.number) <= 1
    del fleet.robots["r2"]
    before = ours.mission.company.numbers.number
    fleet.run(int(GONE_S) + 3)
    assert ours.mission.company.numbers.number > before


def test_a_robot_behind_adopts_a_number_that_others_counted_to():
    fleet = FleetDrive(HALL, TWO)
    fleet.run(4)
    ours, other = (robot.mission.company for robot in fleet.robots.values())
    # It has counted on with a third robot, where this one heard none of it.
    fleet.hears = lambda speaker, listener: False
    fleet.run(8)
    other.numbers.number += MOST_AHEAD - 100
    fleet.hears = lambda speaker, listener: True
    fleet.run(15)
    assert ours.numbers.number > MOST_AHEAD - 100
    said, heard = ((one.numbers.number, one.numbers.by, one.parts) for one in (other, ours))
    assert heard == said


@examples(60)
@given(st.lists(st.tuples(st.integers(0, 3), st.sets(st.integers(0, 40))), max_size=8), st.data())
def test_repeated_or_reordered_messages_of_an_epoch_are_harmless(sweeps, data):
    messages, swept = [], set()
    for column, cells in sweeps:
        swept |= {(cell, column) for cell in cells}
        messages.append(tiles_of(swept))
    one, other = SharedProgress(), SharedProgress()
    for tiles in messages:
        one.receive("r2", 7, tiles)
    shuffled = data.draw(st.permutations(messages + messages[-2:]))
    for tiles in shuffled:
        other.receive("r2", 7, tiles)
    window = Window(-5, -5, 60, 60)
    found = {(row - 5, col - 5) for row, col in np.argwhere(one.swept(window)).tolist()}
    assert found == swept
    assert (one.swept(window) == other.swept(window)).all()


def tiles_of(cells):
    ledger = CoverageLedger(1.0)
    for cell in cells:
        ledger.visit(cell)
    return SweptQueue().next(ledger.snapshot().tiles, 100)


def test_robots_that_meet_in_a_corridor_pass_at_a_niche():
    rows = (
        ["." * 8 + "#" * 24 + "." * 8] * 4
        + ["." * 40]
        + ["." * 8 + "#" * 11 + "..." + "#" * 10 + "." * 8] * 2
    )
    fleet = FleetDrive(rows, {"r1": (0, 0), "r2": (0, 39)})
    fleet.robots["r1"].walk, fleet.robots["r2"].walk = [], []
    least = math.inf
    while not all(robot.mission.state == "done" for robot in fleet.robots.values()):
        assert fleet.seconds < 2000
        fleet.tick()
        first, second = (robot.mission.pose.pose for robot in fleet.robots.values())
        least = min(least, math.dist((first.x, first.y), (second.x, second.y)))
    assert fleet.left_out() == set()
    assert least >= 2 * CONFIG.footprint.robot_radius_m


def test_robots_of_a_fleet_keep_their_zones_in_order():
    """One with more time or charge than another would sweep its zones in another order."""
    robot, other = FleetRobot("r1", (0, 0), HALL), FleetRobot("r2", (0, 23), HALL)
    zones = [
        {"name": "west", "polygon": rectangle(0, 0, 12, 12)},
        {"name": "east", "polygon": rectangle(0, 12, 12, 24), "priority": 90},
    ]
    for first, events in ("east", ()), ("west", (other.report(),)):
        robot.tell(*events)
        robot.command("start", {"zones": zones, "until_min": 2.0})
        assert robot.mission.order_state.current_zone.name == first
        robot.command("cancel")
