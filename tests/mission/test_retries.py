"""Cells that are blocked or left over: tried again later, and named in the end."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import MapReceived, PoseReceived, State
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.work.uncovered import viewpoints_beside
from tests.mission.world import CELL, CONFIG, Drive, patch, pose_at, rectangle, started, with_policy

RETRIES = with_policy(CONFIG, retries=2, retry_s=30.0)
# A room behind a door in column 4.
ROOMS = ("....#....", "....#....", ".........", "....#....")
DOOR = (1, 4)


def drives(*rows, cell=(0, 0), config=RETRIES):
    return started(*rows, cell=cell, config=config)


def reasons(drive):
    return [(area.cells, area.reason) for area in drive.mission.orders.uncovered.found().areas]


def test_a_room_with_a_shut_door_is_tried_again_later():
    drive = drives(*ROOMS)
    drive.tell(patch("#", at=DOOR))
    drive.run(State.BLOCKED)
    waits = "17 cells not reached: tried again after 30 s (1 of 2)"
    assert drive.mission.reason == waits
    assert reasons(drive) == [(16, "closed off by obstacles"), (1, "no longer free on the map")]
    assert drive.tell(after=29.0).plan is None
    decision = drive.tell(after=2.0)
    assert decision.plan.reason == "tried again, 1 of 2"
    # The robot drives to the door, and to nowhere else.
    assert np.argwhere(decision.plan.problem.to_cover).tolist() == [[1, 3]]
    drive.run(State.BLOCKED)
    assert drive.cell == (1, 3)
    assert drive.mission.reason == waits.replace("1 of 2", "2 of 2")
    # It still is shut; in the end nobody waits any more.
    drive.tell(after=31.0)
    drive.run(State.DONE)
    assert drive.mission.reason.startswith(
        "48 % of 2.1 m2 covered; 1.1 m2 not reached: closed off by obstacles (1.0 m2), "
        "no longer free on the map (0.1 m2)"
    )
    coverage = drive.mission.coverage()
    assert (coverage.covered, coverage.coverable) == (16, 33)
    assert sum(cells for cells, _ in reasons(drive)) == 17
    assert drive.tell(after=100.0).plan is None


def test_a_door_that_has_opened_when_it_is_looked_at():
    drive = drives(*ROOMS)
    drive.tell(patch("#", at=DOOR))
    drive.run(State.BLOCKED)
    drive.tell(after=31.0)
    drive.plan()
    while drive.cell != (1, 3):
        drive.go()
    # From here the mapper sees that it is open.
    assert drive.tell(patch(".", at=DOOR), after=2.0).plan.reason == "map: 17 cells more"
    drive.run(State.DONE)
    assert reasons(drive) == []
    assert (0, 8) in drive.visited


def test_a_door_that_opens_ends_the_wait_for_another_try():
    drive = drives(*ROOMS)
    drive.tell(patch("#", at=DOOR))
    drive.run(State.BLOCKED)
    drive.tell(patch(".", at=DOOR), after=3.0)
    drive.run(State.DONE)
    assert drive.now < 30.0
    assert reasons(drive) == []


def test_cells_that_were_never_reachable_are_not_waited_for():
    drive = drives("...#..", "...#..")
    drive.run(State.DONE)
    assert drive.now < 5.0
    assert reasons(drive) == [(4, "closed off by obstacles")]
    (area,) = drive.mission.orders.uncovered.found().areas
    assert area.cell in {(row, col) for row in (0, 1) for col in (4, 5)}


def test_rows_left_along_a_wall_are_named_and_not_tried_again():
    """A map that refines its walls closes many of them."""
    drive = drives(*["......"] * 5)
    drive.tell(patch("######", at=(4, 0)))
    drive.run(State.DONE)
    assert drive.now < 10.0
    assert reasons(drive) == [(6, "no longer free on the map")]


def test_cells_covered_before_they_closed_are_no_loss():
    drive = drives(*["......"] * 4)
    drive.run(State.DONE)
    drive.tell(patch("###", "###", at=(1, 1)))
    assert drive.mission.state is State.DONE
    assert reasons(drive) == []


# Beside the centre of cell (0, 2): the tool does not come there.
SHORT_OF = pose_at(-0.48, 1.52)


def stands_short(drive, ticks):
    """The robot does not come to cell (0, 2), however often it is sent there."""
    plans, drive.cell = 0, (0, 2)
    for _ in range(ticks):
        decision = drive.tell(SHORT_OF, after=1.0)
        if decision.plan is not None:
            plans += 1
            drive.plan()
    return plans


def test_a_cell_left_after_several_tries_is_tried_again_later():
    drive = drives("...")
    drive.go()
    assert stands_short(drive, 20) == 3
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.startswith("1 cell not reached: tried again after 30 s")
    assert stands_short(drive, 20) == 1
    assert drive.mission.state is State.BLOCKED
    assert stands_short(drive, 100) == 1
    assert drive.mission.state is State.DONE
    assert drive.mission.reason == (
        "66 % of 0.2 m2 covered; 0.1 m2 not reached: left over after 6 tries (0.1 m2)"
    )
    assert reasons(drive) == [(1, "left over after 6 tries")]


def test_a_robot_still_turning_in_its_last_cell_is_not_done():
    """A try to come to the cell in which it had waited was over within a second."""
    drive = drives("...")
    drive.go()
    drive.cell = (0, 2)
    at = SHORT_OF.pose
    for number in range(8):
        turned = replace(at, pose=replace(at.pose, yaw=0.4 * number))
        assert drive.tell(PoseReceived(turned), after=0.5).plan is None
    assert drive.tell(PoseReceived(turned), after=1.0).plan.reason == "cells left over"


def test_a_cell_left_over_can_be_covered_at_a_later_try():
    drive = drives("...")
    drive.go()
    stands_short(drive, 20)
    drive.tell(after=31.0)
    drive.run(State.DONE)
    assert drive.mission.reason == "every reachable cell is covered"


def test_cells_left_in_one_zone_do_not_delay_the_next_zone():
    drive = drives("......")
    zones = [
        {"name": "a", "polygon": rectangle(0, 2, 1, 3)},
        {"name": "b", "polygon": rectangle(0, 0, 1, 1)},
    ]
    drive.command("start", {"zones": zones})
    drive.plan()
    drive.go()
    for _ in range(30):
        if drive.mission.order_state.zone == 1:
            break
        stands_short(drive, 1)
    assert drive.now < 25.0
    assert drive.request is None or drive.request.reason == "zone 'b'"
    drive.run(State.BLOCKED)
    assert reasons(drive) == [(1, "left over after 4 tries")]
    drive.tell(after=31.0)
    drive.run(State.DONE)
    assert {(0, 0), (0, 2)} <= drive.visited


def test_closed_areas_are_looked_at_from_beside_them():
    closed, reachable = np.zeros((6, 6), bool), np.zeros((6, 6), bool)
    reachable[0:2] = True
    closed[2:4, 1:3] = True
    closed[2, 5] = True
    assert viewpoints_beside(closed, reachable) == [(1, 2)]
    closed[4:6, 4:6] = True  # out of sight
    assert viewpoints_beside(closed, reachable) == [(1, 2)]
    assert viewpoints_beside(~reachable, reachable) == [(1, 3)]
    assert viewpoints_beside(~reachable, np.zeros((6, 6), bool)) == []
    assert viewpoints_beside(np.zeros((0, 0), bool), np.zeros((0, 0), bool)) == []


def test_cells_beside_a_keep_out_are_not_blamed_on_an_obstacle():
    """What is beside it and was reachable lies in the zone for the robot; a wall that the map
    draws thicker meanwhile is no obstacle that has come."""
    drive = drives(*["......"] * 5)
    drive.command(
        "keep_out_add", keep_out=KeepOut("stairs", tuple(map(tuple, rectangle(2, 2, 3, 4))))
    )
    drive.tell(patch("######", at=(4, 0)))
    drive.run(State.DONE)
    said = {reason for _, reason in reasons(drive)}
    assert said == {"in a keep-out zone", "no longer free on the map"}


SMALL = replace(RETRIES, footprint=Footprint(CELL, CELL / 4))
FENCE = KeepOut("fence", tuple(map(tuple, rectangle(0, 3, 1, 5))))


def two_rooms(*doors):
    """Two rooms of 4 x 4 cells; in the wall between, thinner than a cell, doors in some rows."""
    cells = np.zeros((32, 64), np.int8)
    cells[:, 31] = 100
    for row in doors:
        cells[8 * row : 8 * (row + 1), 31] = 0
    return OccupancyGrid(GridGeometry(32, 64, CELL / 8, Pose2D(0.0, 0.0)), cells, "map")


OFF = KeepOut("fence")
VASE = KeepOut("vase", tuple(map(tuple, rectangle(3, 0, 4, 1))))


@pytest.mark.parametrize(
    ("doors", "events", "waits"),
    [
        ((0,), [FENCE], False),  # no obstacle is there that could leave
        ((0, 3), [FENCE, (0,)], True),  # the other way has shut
        ((0,), [FENCE, OFF, ()], True),
        ((0,), [FENCE, (), OFF], True),
        ((0,), [FENCE, VASE], False),
    ],
    ids=["behind it", "in one way of two", "removed", "removed after the door shut", "a second"],
)
def test_only_doors_and_not_keep_outs_are_waited_for(doors, events, waits):
    """Each event is a keep-out, added or removed, or the doors that the map shows from then on."""
    drive = Drive((0, 0), MapReceived(two_rooms(*doors)), pose_at(0, 0), config=SMALL)
    drive.plan()
    for event in events:
        if isinstance(event, tuple):
            drive.tell(MapReceived(two_rooms(*event)))
        else:
            drive.command("keep_out_add" if event.polygon else "keep_out_remove", keep_out=event)
    drive.run(State.BLOCKED if waits else State.DONE)
    if waits:
        assert "tried again after 30 s (1 of 2)" in drive.mission.reason
        return
    assert drive.now < 10.0
    assert (15, "closed off by a keep-out zone") in reasons(drive) or VASE in events
    assert "closed off by a keep-out zone (0." in drive.mission.reason


SHORT = 0.48


def drive_short(drive, cells, *events):
    """Drive a cell in a second; into ``cells`` no farther than their edge, with no tool there."""
    if drive.request is not None:
        drive.plan()
    before = drive.cell
    if drive.walk:
        drive.cell = drive.walk.pop(0)
    if drive.cell in cells and before != drive.cell:
        drive.aside = SHORT * (before[1] - drive.cell[1])
    row, col = drive.cell
    short = (row - SHORT, col + drive.aside) if drive.cell in cells else drive.cell
    drive.tell(pose_at(*short), *events, after=1.0)


def test_a_flickering_cell_does_not_count_as_progress():
    drive = drives("##.##", ".....", cell=(0, 2))
    drive.command("start", {"zones": []})
    for tick in range(200):
        flickers = [patch(".#"[tick // 5 % 2], at=(0, 4))] if tick % 5 == 0 else []
        drive_short(drive, {(0, 0), (0, 4)}, *flickers)
    assert drive.mission.state is State.DONE
    assert drive.mission.reason.startswith("66 % of 0.4 m2 covered; 0.1 m2 not reached: ")
