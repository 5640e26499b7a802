"""A mission told by plain values: what happens, and what it decides."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import MapTooFar, MapTooLarge, PatchWithoutBase, WrongFrame
from fasaco_edge.grid.geometry import FARTHEST_M, GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.standing import PATIENCE_S
from fasaco_edge.mission.events import (
    Decision,
    MapReceived,
    PatchesLost,
    PlanReady,
    PoseReceived,
    State,
)
from fasaco_edge.planners.path import CoveragePath
from tests.mission.world import (
    CELL,
    Drive,
    answer,
    building,
    patch,
    placed,
    pose_at,
    reachable_cells,
    robot_in,
    started,
)

ROOM = ("......", "......", "......", "......")
TWO_ROOMS = ("...#...", "...#...", ".......", "...#...")
CORRIDOR = ("..........",)


def test_a_mission_waits_for_map_then_pose_then_requests_a_plan():
    drive = Drive((0, 0))
    assert drive.mission.state is State.WAITING_FOR_MAP
    assert drive.mission.coverage() is None
    assert drive.decisions == [Decision()]
    drive.tell(MapReceived(building(*ROOM)))
    assert drive.mission.state is State.WAITING_FOR_POSE
    decision = drive.tell(pose_at(1, 2))
    assert drive.mission.state is State.PLANNING
    assert drive.mission.route.requests.is_planning
    assert decision.path is None
    assert decision.plan.reason == "first plan"
    assert decision.plan.problem.start == (1, 2)
    # The tool stands over cell (1, 2): that one is covered, the others are asked for.
    assert decision.plan.problem.cells == 23
    assert not decision.plan.problem.to_cover[1, 2]


def test_a_plan_that_comes_back_is_published():
    drive = robot_in(*ROOM, cell=(1, 2))
    request = drive.request
    decision = drive.plan()
    assert drive.mission.state is State.COVERING
    update = decision.path
    assert (update.revision, update.reason, update.plan_s) == (1, "first plan", 0.25)
    assert np.array_equal(update.plan.cells, answer(request).path.cells)
    assert update.cells[0].tolist() in ([1, 2], [1, 1], [1, 3], [0, 2], [2, 2])
    assert {tuple(cell) for cell in update.cells.tolist()} | {(1, 2)} == set(np.ndindex(4, 6))
    assert decision.plan is None


def test_driving_along_the_path_ends_done_with_an_empty_path():
    drive = started(*TWO_ROOMS)
    drive.finish()
    assert drive.mission.state is State.DONE
    assert drive.visited == reachable_cells(building(*TWO_ROOMS), (0, 0))
    first, last = drive.updates
    assert last.cells.shape == (0, 2)
    # The drawing has no outer walls.
    edge = "the map ends without a wall along 4 m: there may be more floor beyond"
    assert (last.revision, last.reason) == (2, f"every reachable cell is covered; {edge}")
    assert drive.driven[1:] == [tuple(cell) for cell in first.cells.tolist()][1:]
    coverage = drive.mission.coverage()
    assert (coverage.covered, coverage.coverable, coverage.remaining) == (25, 25, 0)
    assert coverage.fraction == 1.0
    assert coverage.cell_m2 == 0.0625
    assert drive.tell(pose_at(*drive.cell), after=10.0) == Decision()
    assert drive.mission.state is State.DONE


def test_a_map_that_touches_no_reachable_cell_changes_nothing():
    drive = started("#????#", "######", "......", "......")
    drive.go()
    for event in (
        patch("##", at=(3, 2)),
        patch("....", at=(3, 1)),  # a room beyond the wall: coverable, not reachable
        MapReceived(building("######", "#....#", "######", *ROOM[:2], "######", at=(-1, 0))),
    ):
        revision = drive.mission.map.map_revision
        assert drive.tell(event) == Decision()
        assert drive.mission.map.map_revision == revision + 1
    assert drive.mission.coverage().unreachable == 4
    assert len(drive.updates) == 1


def test_a_grown_map_requests_a_plan_of_what_is_not_covered():
    drive = started("...", "...", cell=(1, 0))
    drive.go(times=2)
    here, visited = drive.cell, drive.visited
    assert len(visited) == 3
    decision = drive.tell(MapReceived(building("???..", "...##", "...??", "...??", at=(-1, 0))))
    assert decision.path is None, "the path still holds until the new one is there"
    request = decision.plan
    assert request.reason == "map: 3 cells more"
    assert request.problem.start == here
    window = request.problem.lattice.window
    wanted = {
        (row + window.row0, col + window.col0)
        for row, col in np.argwhere(request.problem.to_cover).tolist()
    }
    assert wanted == {(row, col) for row in (-1, 0, 1) for col in range(3)} - visited
    assert drive.mission.coverage().unreachable == 2
    drive.finish()
    assert drive.visited == {(row, col) for row in (-1, 0, 1) for col in range(3)}


def test_a_wall_across_the_path_cuts_it_at_the_last_legal_cell():
    drive = started(*CORRIDOR)
    drive.go(times=3)
    decision = drive.tell(patch("#", at=(0, 6)))
    assert decision.path.cells.tolist() == [[0, 3], [0, 4], [0, 5]]
    assert decision.path.reason == "path blocked at cell (0, 6)"
    assert decision.path.plan is None
    assert decision.plan.reason == decision.path.reason
    assert decision.plan.problem.cells == 2
    drive.finish()
    assert drive.cell == (0, 5)
    assert drive.visited == {(0, col) for col in range(6)}


def test_a_closed_passage_between_reachable_cells_is_a_change():
    """A thin wall that closes a lane but no cell: the path must not lead through it."""
    drive = Drive((0, 0), config=MissionConfig(Footprint(0.25, robot_radius_m=0.0625)))
    cells = np.zeros((16, 16), np.int8)  # four pixels a cell
    geometry = GridGeometry(16, 16, 0.0625, Pose2D(0.0, 0.0))
    drive.tell(MapReceived(OccupancyGrid(geometry, cells)), pose_at(0, 0))
    drive.plan()
    walled = cells.copy()
    walled[:12, 8] = 100  # between columns 1 and 2, up to the last row
    decision = drive.tell(MapReceived(OccupancyGrid(geometry, walled)))
    assert decision.plan.reason.startswith(("path blocked", "map: passages changed at 6 cells"))
    drive.finish()
    assert drive.visited == set(np.ndindex(4, 4))


def test_a_robot_inside_a_wall_stops_and_says_why_and_recovers():
    drive = started("........", "........", "..####..", "..####..", "..####..", "..####..")
    drive.go(times=2)
    decision = drive.tell(pose_at(1, 3))
    assert drive.mission.state is State.BLOCKED
    reason = (
        "robot is in an occupied cell, or too close to one: "
        "waits for a map or a pose that puts it on free ground"
    )
    assert drive.mission.reason == decision.path.reason == reason
    assert decision.path.cells.shape == (0, 2)
    assert decision.plan is None
    assert drive.tell(pose_at(1, 3)) == Decision(), "one empty path is enough"
    drive.cell = (5, 5)
    assert drive.tell(pose_at(5, 5)).plan is None, "a flickering pose keeps no planner busy"
    assert drive.mission.state is State.BLOCKED
    decision = drive.tell(pose_at(5, 5), after=PATIENCE_S)
    assert decision.plan.reason == "robot is on coverable ground again"
    assert decision.plan.problem.start == (5, 5)
    assert drive.mission.state is State.PLANNING
    drive.finish()
    free = reachable_cells(drive.mission.grid, (5, 5))
    assert free <= drive.visited
    assert len(free) == 32


def test_a_map_that_jumps_far_away_takes_no_memory_in_between():
    """As when a mapper adopts UTM coordinates."""
    drive = started(*ROOM)
    drive.go()
    grid = building(*ROOM)
    far = replace(grid.geometry, origin=Pose2D(500_000.0, 800_000.0))
    moved = OccupancyGrid(far, grid.cells)
    pose = PoseReceived(StampedPose(Pose2D(500_000.3, 800_000.3)))
    drive.tell(MapReceived(moved), pose, after=PATIENCE_S)
    assert drive.tell(after=2 * PATIENCE_S).faults == ()
    assert drive.mission.covered.current.total >= 2


def test_a_plan_that_comes_while_blocked_is_not_published():
    drive = robot_in(*ROOM)
    drive.tell(MapReceived(building(*["######"] * 4)))
    decision = drive.plan()
    assert decision == Decision()
    assert drive.mission.state is State.BLOCKED
    drive.tell(MapReceived(building(*ROOM)))
    drive.finish()


def test_a_plan_that_a_map_change_made_illegal_is_refused():
    drive = robot_in(*CORRIDOR)
    # The plan is still being made: no second one is asked for.
    assert drive.tell(patch("#", at=(0, 6))) == Decision()
    decision = drive.plan()
    assert decision.path is None
    assert decision.plan.problem.cells == 5
    assert decision.plan.reason == "map: 4 cells fewer"
    drive.finish()
    assert drive.visited == {(0, col) for col in range(6)}


def test_a_plan_still_legal_after_a_map_change_is_driven():
    drive = Drive((0, 0), MapReceived(building(*CORRIDOR, "##########")), pose_at(1, 0))
    drive.tell(patch(".", at=(0, 9)))
    decision = drive.plan()
    assert decision.path.cells[-1].tolist() == [1, 9]
    assert decision.plan.reason == "map: 1 cell more"


def test_a_plan_leaves_out_what_was_driven_while_it_was_made():
    drive = started(*CORRIDOR)
    drive.tell(patch("#", at=(0, 9)))
    drive.go(times=4)
    revision = drive.mission.route.revision
    # The rest of the plan is what is being driven: nobody needs to hear of it again.
    assert drive.plan().path is None
    assert drive.mission.route.revision == revision
    assert drive.mission.route.path.ahead.tolist() == [[0, col] for col in range(4, 9)]


def test_an_answer_to_another_question_leaves_the_question_open():
    drive = robot_in(*CORRIDOR)
    path = CoveragePath(np.array([[0, 0], [0, 1]], np.int32), "fasaco", 0)
    assert drive.tell(PlanReady(drive.request.number + 1, path, 0.1)) == Decision()
    assert drive.mission.route.requests.is_planning
    assert drive.plan().path.revision == 1
    drive.finish()


def fault_of(drive, event):
    """Tell the mission an event it cannot use; it must change nothing."""
    mission = drive.mission
    route = mission.route
    before = (mission.grid, mission.pose, mission.map.map_revision, route.revision, mission.state)
    visited, total = drive.visited, mission.covered.current.total
    decision = drive.tell(event)
    assert (decision.plan, decision.path) == (None, None)
    after = (mission.grid, mission.pose, mission.map.map_revision, route.revision, mission.state)
    assert after == before
    assert (drive.visited, mission.covered.current.total) == (visited, total)
    (fault,) = decision.faults
    return fault


def test_updates_of_one_cycle_are_one_change_of_the_map():
    """A flood of small ones on a large map held the loop up for seconds, a copy for each."""
    drive, others = started(*ROOM), started(*ROOM)
    updates = [patch("#", at=(2, col)) for col in (2, 4, 2)] + [patch(".", at=(2, 4))]
    revision = drive.mission.map.map_revision
    misfit = patch("#", at=(0, 6))
    faults = drive.tell(*updates[:2], misfit, *updates[2:]).faults
    assert [type(fault) for fault in faults] == [PatchWithoutBase]
    assert drive.mission.map.map_revision == revision + 1
    for update in updates:
        others.tell(update)
    assert np.array_equal(drive.mission.grid.cells, others.mission.grid.cells)
    assert drive.mission.coverage() == others.mission.coverage()
    drive.finish()


def test_after_lost_updates_only_a_full_map_counts():
    drive = started(*ROOM)
    fault = fault_of(drive, PatchesLost(3))
    assert isinstance(fault, PatchWithoutBase)
    assert str(fault) == "3 map updates were lost"
    assert "updates before it were lost" in str(fault_of(drive, patch("#", at=(2, 2))))
    drive.tell(MapReceived(building(*ROOM)))
    assert drive.tell(patch("#", at=(2, 2))).faults == ()
    assert np.count_nonzero(drive.mission.map.area.reachable) == 23


HUGE = OccupancyGrid(GridGeometry(2, 2, 1e4, Pose2D(0, 0)), np.zeros((2, 2), np.int8))
FAR = building(*ROOM, at=(0, round(FARTHEST_M / CELL)))


@pytest.mark.parametrize(
    ("event", "fault", "said"),
    [
        (patch("#", at=(0, 6)), PatchWithoutBase, "update "),
        (patch("##", at=(3, 5)), PatchWithoutBase, "update "),
        (patch(".", frame="odom"), PatchWithoutBase, "update "),
        (pose_at(2, 2, frame="odom"), WrongFrame, "pose in frame 'odom', map in 'map'"),
        (MapReceived(building(*ROOM, frame="odom")), WrongFrame, "map in frame 'odom', "),
        (MapReceived(HUGE), MapTooLarge, ""),
        (MapReceived(FAR), MapTooFar, ""),
    ],
)
def test_what_cannot_be_used_is_a_fault_and_changes_nothing(event, fault, said):
    drive = started(*ROOM)
    found = fault_of(drive, event)
    assert isinstance(found, fault)
    assert str(found).startswith(said)
    drive.finish()


def test_a_bad_event_does_not_affect_the_others():
    drive = Drive((0, 0))
    decision = drive.tell(
        patch("#"), MapReceived(building(*ROOM)), pose_at(0, 0, frame="odom"), pose_at(0, 0)
    )
    assert [type(fault) for fault in decision.faults] == [PatchWithoutBase, WrongFrame]
    assert str(decision.faults[0]) == "map update refused: there is no map yet"
    assert decision.plan.problem.start == (0, 0)


def test_a_pose_far_off_the_map_takes_bounded_memory():
    """A localiser gone astray: the wire lets positions up to a thousand kilometres through."""
    drive = started(*ROOM)
    drive.tell(pose_at(4_000_000, -4_000_000))
    assert drive.mission.state is State.BLOCKED
    drive.tell(pose_at(*drive.cell))
    drive.finish()


def test_a_map_without_pixels_blocks_the_robot():
    drive = Drive((0, 0), MapReceived(placed(np.zeros((0, 0), np.int8), (0, 0))), pose_at(0, 0))
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.coverage().fraction == 0.0


@pytest.mark.parametrize("cell", [(0, 0), (-7, 3)])
def test_a_single_cell_is_covered_by_standing_in_it(cell):
    drive = Drive(cell, MapReceived(building("###", "#.#", "###", at=(cell[0] - 1, cell[1] - 1))))
    decision = drive.tell(pose_at(*cell))
    assert drive.mission.state is State.DONE
    assert decision == Decision()


def test_a_robot_is_resent_to_a_cell_missed_before_the_end():
    """It is neither far from where it was last on its path, nor at its end by that count."""
    drive = started("####", "....")
    drive.go()
    # Around cell (0, 2): its tool does not pass over the centre.
    drive.tell(pose_at(0.55, 1.6), pose_at(0.55, 2.4), pose_at(0.0, 3.0))
    drive.cell, drive.walk = (0, 3), []
    assert (0, 2) not in drive.visited
    drive.tell(pose_at(0, 3), after=PATIENCE_S)
    drive.tell(pose_at(0, 3), after=PATIENCE_S)
    assert drive.request.reason == "cells left over"
    drive.finish()
    assert drive.visited >= {(0, col) for col in range(4)}
