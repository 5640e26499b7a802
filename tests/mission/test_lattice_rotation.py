"""Cells at an angle to the map frame: given, or found by the walls, and what is carried over."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.daemon.ledger.codec import decode_ledger, encode_ledger
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry, rotated_point, rotated_points, rotated_pose
from fasaco_edge.judge.floor import judge_floor
from fasaco_edge.mission.config import Dock, Place
from fasaco_edge.mission.core.lattice_layout import WallWatch
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.relaid_ledger import relaid_ledger
from fasaco_edge.mission.events import CommandReceived, MapReceived, PlanReady, PoseReceived
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.grid.test_floor import room
from tests.mission.test_line import CELL_M, CONFIG, ROBOT, START, Robot, robot_on
from tests.mission.world import with_policy
from tests.support.grids import seen_around

DEG = 30.0
AUTO = replace(CONFIG, lattice_deg=None)
ROOM = room(3.0, 2.4)
IN_YAW = replace(ROOM, geometry=rotated_geometry(ROOM.geometry, DEG))


def turned(grid, deg):
    """The map of the same building, turned about the frame's origin; its pixels are not."""
    x0, y0, x1, y1 = rotated_geometry(grid.geometry, deg).bounds()
    unit = grid.geometry.resolution
    rows, cols = math.ceil((y1 - y0) / unit), math.ceil((x1 - x0) / unit)
    geometry = GridGeometry(rows, cols, unit, Pose2D(x0, y0))
    centres = np.stack(np.meshgrid(np.arange(cols) + 0.5, np.arange(rows) + 0.5), axis=-1)
    there = rotated_points(centres.reshape(-1, 2) * unit + (x0, y0), -deg)
    col, row = (np.floor(at).astype(int) for at in grid.geometry.to_pixels(*there.T))
    inside = (row >= 0) & (col >= 0) & (row < grid.geometry.rows) & (col < grid.geometry.cols)
    cells = np.full(rows * cols, -1, np.int8)
    cells[inside] = grid.cells[row[inside], col[inside]]
    return OccupancyGrid(geometry, cells.reshape(rows, cols), grid.frame)


def first_path(mission, grid, at, order=None):
    """The line of the first path from a point, and the answers before."""
    events = [MapReceived(grid), PoseReceived(StampedPose(Pose2D(*at), "map"))]
    if order is not None:
        events.append(CommandReceived(1, "start", read_order(order)))
    decision = mission.step(events, 0.0)
    limit = WorkLimit(SearchWork(proposals=20_000))
    path = NearOptimal().plan(decision.plan.problem, limit)
    ready = PlanReady(decision.plan.number, path, 0.0)
    return mission.step([ready], 0.1).path, decision.answers


ZONE = [[2.2, 1.2], [3.6, 1.2], [3.6, 2.6], [2.2, 2.6]]
COLUMN = [[4.0, 2.4], [4.4, 2.4], [4.4, 2.8], [4.0, 2.8]]


@pytest.mark.parametrize("order", [None, {"zones": [{"name": "a", "polygon": ZONE}]}])
def test_a_turned_building_is_driven_like_a_straight_one(order):
    """Map, pose, zones and keep-out zones are turned, and so is the line."""
    straight = Mission(with_policy(CONFIG, keep_out=(tuple(map(tuple, COLUMN)),)))
    around = tuple(rotated_point(x, y, DEG) for x, y in COLUMN)
    askew = Mission(with_policy(replace(CONFIG, lattice_deg=DEG), keep_out=(around,)))
    path, _ = first_path(straight, ROOM, START, order)
    if order is not None:
        polygon = [rotated_point(x, y, DEG) for x, y in ZONE]
        order = {"zones": [{"name": "a", "polygon": polygon}]}
    other, _ = first_path(askew, IN_YAW, rotated_point(*START, DEG), order)
    assert (other.cells == path.cells).all()
    # Rounding decides where in a cell some of the line's points are.
    there = rotated_points(path.xy, DEG)
    away = np.hypot(*(there[:, None] - other.xy[None]).T)
    assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 0.15
    lengths = [np.hypot(*np.diff(xy, axis=0).T).sum() for xy in (there, other.xy)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.02)
    # What is said to others is of the map frame.
    told = askew.pose.pose
    assert (told.x, told.y, told.yaw) == pytest.approx((*rotated_point(*START, DEG), 0.0))
    assert askew.grid.geometry.origin.yaw == pytest.approx(math.radians(DEG))


def test_an_added_keep_out_lies_where_that_of_an_order_lies():
    ordered, added = (Mission(replace(CONFIG, lattice_deg=DEG)) for _ in range(2))
    corners = tuple(rotated_point(x, y, DEG) for x, y in COLUMN)
    start = rotated_point(*START, DEG)
    path, _ = first_path(ordered, IN_YAW, start, {"keep_out": [corners]})
    added.step([CommandReceived(1, "keep_out_add", keep_out=KeepOut("column", corners))], 0.0)
    other, _ = first_path(added, IN_YAW, start, {})
    assert (other.cells == path.cells).all()
    assert OrderState.from_json(added.snapshot().note).keep_out[0].polygon == corners


def test_a_way_home_ends_at_place_and_heading_in_the_map_frame():
    home = Place(x_m=2.6, y_m=3.0, yaw_deg=80.0)
    mission = Mission(
        with_policy(replace(CONFIG, lattice_deg=25.0), home=home, dock=Dock(x_m=9, y_m=9))
    )
    grid, at = ROOM, StampedPose(Pose2D(*START), "map")
    first_path(mission, grid, START)
    decision = mission.step([CommandReceived(1, "home")], 1.0)
    if decision.plan is not None:
        limit = WorkLimit(SearchWork(proposals=20_000))
        path = NearOptimal().plan(decision.plan.problem, limit)
        decision = mission.step([PlanReady(decision.plan.number, path, 0.0)], 1.1)
    assert decision.path is not None
    assert math.dist(decision.path.xy[-1], (2.6, 3.0)) < CELL_M
    assert decision.path.end_yaw == pytest.approx(math.radians(80.0))
    assert math.dist(mission.rotation.centre(mission.orders.goal(), CELL_M), (2.6, 3.0)) < CELL_M
    assert mission.pose == replace(at, pose=mission.pose.pose)


def test_the_refusal_of_a_zone_off_the_map_uses_the_map_frame():
    mission = Mission(replace(CONFIG, lattice_deg=DEG))
    moon = {"zones": [{"name": "moon", "polygon": [[20, 20], [22, 20], [22, 22]]}]}
    events = MapReceived(ROOM), PoseReceived(StampedPose(Pose2D(*START), "map"))
    mission.step(events, 0.0)
    decision = mission.step([CommandReceived(1, "start", read_order(moon))], 0.1)
    (answer,) = decision.answers
    assert "x 1.95..5.05 m, y 0.95..3.45 m" in str(answer.error)


def test_an_order_is_kept_to_the_last_bit_as_it_was_given():
    mission = Mission(replace(CONFIG, lattice_deg=17.3))
    zone = {"name": "a", "polygon": [[2.1, 1.1], [3.3, 1.2], [3.1, 2.7]]}
    order = read_order({"zones": [zone], "keep_out": [COLUMN]})
    first_path(mission, ROOM, START, {"zones": [zone], "keep_out": [COLUMN]})
    assert mission.order_state.order != order
    kept = OrderState.from_json(mission.snapshot().note)
    assert kept.order == order
    # The same order once more, after a restart, goes on.
    again = Mission(replace(CONFIG, lattice_deg=17.3))
    again.restore(mission.snapshot(), kept)
    assert again.order_state.order == mission.order_state.order
    decision = again.step([CommandReceived(1, "start", order)], 0.0)
    assert decision.answers[0].error is None
    assert again.order_state.home == mission.order_state.home


def askew_building():
    """A hall with a wall in it, 5 x 4 m, turned by 30 degrees."""
    grid = room(5.0, 4.0)
    cells = grid.cells.copy()
    cells[1:50, 55:57] = 100
    return turned(OccupancyGrid(grid.geometry, cells), DEG)


def test_cells_align_with_the_walls_once_and_keep_swept_floor():
    grid = askew_building()
    start = rotated_point(*START, DEG)
    robot = robot_on(seen_around(grid, start, 1.2), 20, at=start, config=AUTO)
    mission = robot.mission
    assert mission.rotation.deg == 0.0
    swept_m2, revision = mission.covered.floor.swept_m2, mission.route.revision
    robot.tell(MapReceived(grid))
    robot.drive(15)
    assert mission.rotation.deg == pytest.approx(DEG, abs=1.0)
    assert swept_m2 > 0.5
    assert mission.covered.floor.swept_m2 > swept_m2
    assert mission.route.revision > revision
    laid = [reason for reason in robot.reasons if "cells lie along the walls" in reason]
    assert laid
    kept = decode_ledger(encode_ledger(mission.snapshot()), CELL_M)
    assert kept.lattice_deg == mission.rotation.deg
    # A mission that goes on after a restart has the angle at once.
    again = Robot(Mission(AUTO), at=robot.at)
    again.mission.restore(kept, mission.order_state)
    again.tell(MapReceived(grid))
    assert again.mission.rotation.deg == mission.rotation.deg
    # Where it stands it may sweep a pixel more.
    assert 0 <= again.mission.covered.floor.pixels - mission.covered.floor.pixels <= 2
    assert again.mission.order_state.home == mission.order_state.home
    robot.finish()
    assert len([r for r in robot.reasons if "cells lie along the walls" in r]) <= len(laid) + 1
    figures = judge_floor(grid, np.array(robot.trail), ROBOT).figures
    assert figures.swept_share > 0.97
    assert figures.illegal_share == 0.0


def test_a_map_too_small_for_askew_cells_has_them_along_its_axes():
    """A lattice askew over a map spans more cells than one along its axes."""
    grid, config = turned(room(5.0, 4.0), DEG), replace(AUTO, max_lattice_cells=2600)
    robot = robot_on(grid, 40, at=rotated_point(*START, DEG), config=config)
    assert robot.mission.rotation.deg
    cells = np.pad(grid.cells, ((0, 0), (0, 276)), constant_values=-1)
    grown = OccupancyGrid(replace(grid.geometry, cols=cells.shape[1]), cells)
    robot.tell(MapReceived(grown))
    assert robot.mission.rotation.deg == 0.0
    assert robot.mission.grid is grown
    robot.drive(3)
    assert robot.line


@pytest.mark.parametrize(("deg", "cell_m"), [(DEG, CELL_M), (0.0, 0.5 * CELL_M)])
def test_floor_that_is_carried_over_lies_where_it_was(deg, cell_m):
    robot = robot_on(ROOM, 60)
    robot.mission.covered.break_track()
    before = robot.mission.snapshot()
    after = relaid_ledger(before, deg, cell_m)
    assert (after.lattice_deg, after.cell_m) == (deg, cell_m)
    total = before.total * (CELL_M / cell_m) ** 2
    assert after.total == pytest.approx(total, rel=0.25)
    assert after.floor.pixels == pytest.approx(before.floor.pixels, rel=0.01)
    # Pixels of the map frame, looked up in both.
    place = GridGeometry(80, 90, 0.05, Pose2D(1.5, 0.5))
    there = rotated_geometry(place, -deg)
    was, now = (
        snapshot_of(ledger).swept_on(geometry)
        for ledger, geometry in ((before, place), (after, there))
    )
    assert np.count_nonzero(was != now) < 0.07 * np.count_nonzero(was)
    # A cell counts where the floor at its centre is swept.
    rows, cols = np.nonzero(after.visits(Window(-20, -20, 60, 60)))
    assert len(rows)
    for row, col in zip((rows - 20).tolist(), (cols - 20).tolist(), strict=True):
        x, y = rotated_point((col + 0.5) * cell_m, (row + 0.5) * cell_m, deg)
        pixel = Window(int(y / 0.025), int(x / 0.025), int(y / 0.025) + 1, int(x / 0.025) + 1)
        assert before.floor.swept_in(pixel).all()
    assert relaid_ledger(before, 0.0, CELL_M) is before


def snapshot_of(ledger):
    mission = Mission(CONFIG)
    mission.restore(replace(ledger, lattice_deg=0.0))
    return mission.covered.floor


def looks(grid, metres=12):
    watch, found = WallWatch(), []
    for step in range(10 * metres):
        found.append(watch.estimate(grid, Pose2D(0.1 * step, 0.0)))
    return [deg for deg in found if deg is not None]


def test_walls_are_observed_only_until_they_are_certain():
    (deg,) = looks(turned(room(5.0, 4.0), 20.0))
    assert deg == pytest.approx(20.0, abs=0.6)
    assert looks(room(5.0, 4.0)) == [0.0]
    # Too little wall, and a round one.
    assert looks(turned(room(0.9, 0.8), 20.0)) == []
    y, x = np.mgrid[-60:60, -60:60] + 0.5
    away = np.hypot(x, y)
    cells = np.where(away < 55, 0, np.where(away < 57, 100, -1)).astype(np.int8)
    assert looks(OccupancyGrid(GridGeometry(120, 120, 0.05, Pose2D(0, 0)), cells)) == []


def test_a_jump_of_the_pose_does_not_count_as_a_drive():
    watch, grid = WallWatch(), turned(room(2.6, 2.0), 20.0)
    found = [watch.estimate(grid, Pose2D(50.0 * step, 0.0)) for step in range(50)]
    assert found == [None] * 50
    assert rotated_pose(Pose2D(1.0, 0.0, 0.0), 90.0).x == pytest.approx(0.0)
