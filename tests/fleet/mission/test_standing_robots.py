"""Robots that stand: cells closed around them, and one that is stopped beside another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.members import Members
from fasaco_edge.fleet.mission.message import path_ahead
from fasaco_edge.fleet.mission.shared import SharedProgress
from fasaco_edge.fleet.mission.tiles import TILE_BYTES
from fasaco_edge.fleet.mission.traffic import OLD_S, PATIENCE_S, STANDS_S
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import MapReceived, MemberReceived
from tests.mission.world import CONFIG, Drive, building, pose_at, with_policy

CELL_M, RADIUS_M = 0.25, 0.1


def member(x, y):
    return MemberReceived("r2", state="covering", x=x, y=y, epoch=1, radius_m=0.1)


def meet(drive, *heard, at=(2, 4), seconds=1):
    for _ in range(seconds):
        drive.tell(pose_at(*at), *heard, after=1.0)
        if drive.request is not None:
            drive.plan()


def planned(**policy):
    drive = Drive((2, 4), config=with_policy(CONFIG, **policy), kind=FleetKind("r1"))
    drive.tell(MapReceived(building(*["." * 24] * 5)), pose_at(2, 4))
    drive.plan()
    return drive


@pytest.fixture
def area():
    return ReachableArea.around(CoverageLattice.from_free(np.ones((9, 40), bool), CELL_M), (0, 0))


@pytest.fixture
def members():
    return Members(MissionLedger(CELL_M, CELL_M, shared=SharedProgress()), CELL_M)


# Two discs of 0.1 m, and 0.1 m between them: the cell of its place, and the four beside it.
AROUND = {(4, 4), (3, 4), (5, 4), (4, 3), (4, 5)}


@pytest.mark.parametrize(
    ("then", "closed"),
    [
        (member(1.125, 1.125), AROUND),
        # Its poses scatter while it stands.
        (member(1.18, 1.07), AROUND),
        (member(2.125, 1.125), set()),
        (replace(member(1.125, 1.125), misfit="its map is another"), set()),
    ],
    ids=["stands", "scatters", "drives on", "on another map"],
)
def test_cells_around_a_robot_in_the_way_are_closed_while_it_stands(area, members, then, closed):
    members.receive(member(1.125, 1.125), 0.0)
    assert members.closed(area, RADIUS_M) is None
    members.avoid("r2")
    members.receive(then, 1.0)
    found = members.closed(area, RADIUS_M)
    assert members.is_avoided("r2") == bool(closed)
    assert (set() if found is None else set(map(tuple, np.argwhere(found).tolist()))) == closed


@pytest.mark.parametrize("x", [-0.1, 10.1, 90.0])
def test_a_robot_at_the_edge_closes_only_cells_of_the_map(area, members, x):
    members.receive(member(x, 1.125), 0.0)
    members.avoid("r2")
    assert np.count_nonzero(members.closed(area, RADIUS_M)) == (0 if x == 90.0 else 1)


def test_cells_closed_for_a_silent_robot_are_opened(area, members):
    members.receive(member(1.125, 1.125), 0.0)
    members.avoid("r2")
    assert members.forget_silent(OLD_S - 0.1) == ""
    assert members.closed(area, RADIUS_M).any()
    assert members.forget_silent(OLD_S) == "r2"
    assert members.closed(area, RADIUS_M) is None


def test_a_robot_stopped_beside_another_plans_around_it():
    drive = planned()
    row, col = drive.walk[1]
    # Two cells behind it, where its path does not lead.
    behind = member((4.5 - (col - 4)) * CELL_M, (2.5 - (row - 2)) * CELL_M)
    for _ in range(int(PATIENCE_S) + 1):
        assert not drive.mission.company.others.is_avoided("r2")
        meet(drive, behind)
    assert drive.mission.company.others.is_avoided("r2")
    assert len(drive.mission.route.path.ahead) > 1


def test_a_robot_that_waited_beside_another_may_drive_on():
    # Two such stood for minutes: the time of the wait counted as if they could not drive.
    drive = planned()
    row, col = drive.walk[1]
    x, y = (col + 0.5) * CELL_M, (row + 0.5) * CELL_M
    for _ in range(int(PATIENCE_S)):
        drive.tell(pose_at(2, 4), member(x, y), after=1.0)
        assert drive.mission.giving_way.waits_for == "r2"
    # Now it stands where the path does not lead.
    behind = member((8.5 - col) * CELL_M, (4.5 - row) * CELL_M)
    for _ in range(int(PATIENCE_S)):
        meet(drive, behind)
        assert drive.mission.giving_way.waits_for == ""
    assert len(drive.mission.route.path.ahead) > 1


@pytest.mark.parametrize("scatter_m", [0.02, 0.05])
@pytest.mark.parametrize("state", ["charging", "covering"])
def test_a_plan_avoids_a_standing_robot_with_scattered_poses(state, scatter_m):
    # Each jump of more than 5 cm counted as motion: it was waited for to the end.
    random, drive = np.random.default_rng(1), planned(retries=2, retry_s=30.0)
    for _ in range(400):
        if drive.request is not None:
            drive.plan()
        if drive.walk:
            drive.cell = drive.walk.pop(0)
        x, y = random.normal((12.5 * CELL_M, 2.5 * CELL_M), scatter_m)
        drive.tell(pose_at(*drive.cell), replace(member(x, y), state=state), after=1.0)
        if drive.mission.state == "done":
            break
    else:
        raise AssertionError(drive.mission.reason)
    # Those around its disc, and what that closes in a corner of the grid of cells.
    assert len(drive.visited) >= 24 * 5 - 10


@pytest.mark.parametrize("names", [("r2",), ("r2", "r3")], ids=["one", "two in turn"])
def test_a_plan_avoids_robots_that_stand_in_the_way_repeatedly(names):
    # Where they were told to be scattered about what has to be kept clear: each moment without them
    # began the wait anew, and so did the other one of two.
    drive = planned()
    (row, col), (to_row, to_col) = drive.cell, drive.walk[0]
    ahead, aside = np.array([to_col - col, to_row - row]), np.array([to_row - row, to_col - col])
    here = (np.array([col, row]) + 0.5) * CELL_M
    for tick in range(int(PATIENCE_S) + 3):
        heard = []
        for place, name in enumerate(names):
            off_m = 0.31 if tick % 2 == place else 0.34
            x, y = here + CELL_M * ahead + (1 - 2 * place) * off_m * aside
            heard.append(replace(member(x, y), robot=name))
        meet(drive, *heard, at=(row, col))
    assert any(map(drive.mission.company.others.is_avoided, names))


def test_a_near_robot_is_known_also_at_rest():
    drive = planned()
    drive.command("pause")
    for x, near in ((3.0, True), (20.0, False)):
        drive.tell(pose_at(2, 4), member(x, 0.6), after=1.0)
        assert drive.mission.giving_way.is_near == near


def test_a_jammed_robot_is_planned_around():
    # Nobody moved again: the first by name goes first, and could not.
    drive = planned()
    row, col = drive.walk[1]
    x, y = (col + 0.5) * CELL_M, (row + 0.5) * CELL_M
    away = (x + (col - 4) * CELL_M, y + (row - 2) * CELL_M)
    jammed = replace(member(x, y), robot="r0", ahead=(away,), waits_for="r1")
    meet(drive, jammed, seconds=int(PATIENCE_S + STANDS_S) + 2)
    assert drive.mission.giving_way.waits_for == ""
    assert len(drive.mission.route.path.ahead) > 1


def test_a_robot_without_a_way_to_its_refuge_replans():
    # It stood for ever beside one that was done: the refuge was the cell that it stood in, and the
    # way to the middle of it, of one point, was no way to drive.
    drive = planned()
    (row, col), (to_row, to_col) = drive.walk[1], drive.walk[0]
    off = 2 + 0.4 * (to_row - 2), 4 + 0.4 * (to_col - 4)
    other = replace(member((col + 0.5) * CELL_M, (row + 0.5) * CELL_M), state="done")
    meet(drive, other, at=off, seconds=int(2 * PATIENCE_S + STANDS_S))
    assert drive.mission.giving_way.waits_for == ""
    assert len(drive.mission.route.path.ahead) > 1


def test_a_waiting_robot_is_done_when_others_sweep_the_rest():
    drive = planned()
    x, y = ((at + 0.5) * CELL_M for at in drive.walk[1][::-1])
    ahead = replace(member(x, y), waits_for="r3")
    meet(drive, ahead, seconds=3)
    assert drive.mission.giving_way.waits_for == "r2"
    assert len(path_ahead(drive.mission))
    swept = replace(ahead, tiles=(((0, 0), b"\xff" * TILE_BYTES),))
    meet(drive, swept, seconds=3)
    assert drive.mission.state == "done"
    assert drive.mission.giving_way.waits_for == ""
    assert not len(path_ahead(drive.mission))


def test_a_yielding_robot_drives_to_the_middle_of_its_refuge():
    drive = planned()
    x, y = ((at + 0.5) * CELL_M for at in drive.walk[1][::-1])
    drive.tell(pose_at(2, 4), replace(member(x, y), waits_for="r3"), after=1.0)
    assert drive.mission.giving_way.waits_for == "r2"
    over = replace(member(x, y), ahead=((4.5 * CELL_M, 2.5 * CELL_M),))
    drive.tell(pose_at(2, 4), over, after=2.0)
    assert "makes way for r2" in drive.mission.reason
    way = drive.mission.route.path.cells
    (before, last) = way[-2:]
    edge = last + 0.4 * (before - last)
    drive.tell(pose_at(*edge.tolist()), over, after=2.0)
    assert len(drive.mission.route.path.cells)
    drive.tell(pose_at(*last.tolist()), over, after=1.0)
    assert not len(drive.mission.route.path.cells)
