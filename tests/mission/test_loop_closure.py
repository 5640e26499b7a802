"""What counts as covered after the mapper has moved map and pose at once."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.coverage.loop_closure import (
    Motion,
    has_moved,
    moved_cells,
    small_shift,
    uncertain_cells,
)
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.mission.line_robot import CONFIG, PIXEL_M
from tests.mission.test_reached_cells import changed, two_rooms
from tests.mission.world import CELL, Drive, pixels, placed, pose_at, started

FOOTPRINT = Footprint(0.3, 0.15)
HOME = Pose2D(0.0, 0.0)


def rooms(origin=HOME, door=True, known=1.0):
    """Return a map of two rooms with pillars, 12 m x 6 m."""
    pixels = np.zeros((120, 240), np.int8)
    pixels[:3] = pixels[-3:] = pixels[:, :3] = pixels[:, -3:] = 100
    pixels[:, 118:122] = 100
    pixels[20:100:20, 20:230:20] = 100
    if door:
        pixels[50:65, 118:122] = 0
    pixels[:, round(240 * known) :] = -1
    return OccupancyGrid(GridGeometry(*pixels.shape, 0.05, origin), pixels)


def change(before, after):
    lattice = LatticeChange.first(before, FOOTPRINT).after
    return LatticeChange.between((before, after), lattice, FOOTPRINT)


@pytest.mark.parametrize("jump", [Pose2D(0.4, 0.1), Pose2D(0.3, 0.3, math.radians(3.0))])
def test_walls_elsewhere_all_over_are_a_loop_closure(jump):
    assert has_moved(change(rooms(), rooms(jump)))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (rooms(), rooms()),
        (rooms(), rooms(door=False)),
        (rooms(known=0.3), rooms(known=0.6)),
        (rooms(), rooms(known=0.5)),
    ],
)
def test_doors_and_new_floor_are_no_loop_closure(before, after):
    assert not has_moved(change(before, after))


def test_a_first_map_has_not_moved():
    assert not has_moved(LatticeChange.first(rooms(), FOOTPRINT))


def test_a_motion_is_gone_back_by_shares():
    motion = Motion(Pose2D(1.0, 2.0, 0.1), Pose2D(1.5, 2.0, 0.1 + math.pi / 2))
    x, y = motion.back(1.0, np.array([1.5, 1.5]), np.array([2.0, 3.0]))
    np.testing.assert_allclose((x[0], y[0]), (1.0, 2.0), atol=1e-12)
    np.testing.assert_allclose((x[1], y[1]), (2.0, 2.0), atol=1e-12)
    x, y = motion.back(0.5, np.array([1.25]), np.array([2.0]))
    np.testing.assert_allclose((x[0], y[0]), (1.0, 2.0), atol=1e-12)
    assert not motion.is_still
    assert Motion(HOME, Pose2D(0.01, 0.01, math.tau)).is_still


@pytest.mark.parametrize("seed", range(8))
def test_only_floor_that_the_tool_passed_over_counts(seed):
    """Wherever the map came to lie, what is left is a part of what was covered, moved along."""
    rng = np.random.default_rng(seed)
    ledger = CoverageLedger(0.3)
    for step in range(40):
        along = 0.3 * min(step % 20, 12)
        ledger.record(Pose2D(along if step < 20 else 3.6 - along, 0.15 + 0.3 * (step // 4)))
    start = Pose2D(2.0, 1.5, 0.3)
    end = Pose2D(2.0 + rng.uniform(-0.5, 0.5), 1.5 + rng.uniform(-0.5, 0.5), rng.uniform(0.2, 0.4))
    motion, before = Motion(start, end), ledger.snapshot()
    window = Window(-5, -5, 40, 40)
    was = before.visits(window) > 0
    ledger.lift_tool()
    ledger.forget(uncertain_cells(before, motion))
    left = np.argwhere(ledger.visits(window) > 0) + np.array((window.row0, window.col0))
    assert (ledger.visits(window)[~was] == 0).all()
    x, y = motion.back(1.0, (left[:, 1] + 0.5) * 0.3, (left[:, 0] + 0.5) * 0.3)
    for row, col in zip(np.floor(y / 0.3).astype(int), np.floor(x / 0.3).astype(int), strict=True):
        assert was[row - window.row0, col - window.col0]


@pytest.mark.parametrize(("shift", "counts"), [((0.3, 0.0), True), ((0.15, 0.15), False)])
def test_the_corner_of_four_cells_was_not_under_a_round_tool(shift, counts):
    """It was in the middle of each of them; the map moved by a whole cell, or by half a cell."""
    ledger = CoverageLedger(0.3)
    for row in range(10):
        for col in range(10):
            ledger.break_track()
            ledger.record(Pose2D(0.3 * (col + 0.5), 0.3 * (row + 0.5)))
    motion = Motion(Pose2D(1.5, 1.5), Pose2D(1.5 + shift[0], 1.5 + shift[1]))
    rows, cols = np.mgrid[3:7, 3:7].reshape(2, -1)
    doubt = uncertain_cells(ledger.snapshot(), motion)(rows, cols)
    assert doubt.all() != counts
    assert doubt.any() != counts


def test_a_robot_that_stood_still_forgets_nothing():
    ledger = CoverageLedger(0.3)
    for step in range(40):
        ledger.record(Pose2D(0.1 * step, 0.15))
    before = ledger.snapshot()
    ledger.forget(uncertain_cells(before, Motion(HOME, HOME)))
    assert ledger.snapshot().cells == before.cells > 5


def test_a_ledger_of_far_jumps_is_looked_up_at_once():
    """Tile by tile, and each time through all of them, 1,500 tiles took three seconds."""
    ledger = CoverageLedger(0.3)
    for number in range(1500):
        ledger.record(Pose2D(20.0 * (number % 40), 20.0 * (number // 40)))
    before, motion = ledger.snapshot(), Motion(HOME, Pose2D(0.3, 0.0))
    ledger.lift_tool()
    started = time.thread_time()
    ledger.forget(uncertain_cells(before, motion))
    assert time.thread_time() - started < 0.5
    assert not ledger.snapshot().cells, "each was a disc alone"


WALLED = ("############", *["#..........#"] * 12, "############")


def moved_hall(shift):
    """A hall, half a cell wider than its columns, that has moved by some columns."""
    drawn = np.insert(pixels(*WALLED), 3, 0, axis=1)
    drawn[0:2] = drawn[-2:] = 100
    return MapReceived(placed(drawn, (0, shift)))


def closed(shift, *, together=True):
    """A robot on its path when the map moves by so many columns; the path ahead before that."""
    drive = Drive((1, 1), moved_hall(0), pose_at(1, 1))
    drive.plan()
    drive.go(times=4)
    ahead = [drive.cell, *drive.walk]
    row, col = drive.cell
    there = pose_at(row, col + shift)
    drive.cell = row, round(col + shift + 0.1)
    if together:
        drive.tell(moved_hall(shift), there)
    else:
        drive.tell(moved_hall(shift))
        drive.tell(there)
    return drive, ahead


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("shift", [3, 2.5])
def test_the_path_stays_with_the_building(shift, together):
    """By half a cell, too: then each cell is another place, and the path leads over the nearest."""
    drive, ahead = closed(shift, together=together)
    moved = [(row, col + 3) for row, col in ahead]
    assert drive.walk == moved[1:]
    assert drive.updates[-1].reason == "map and pose moved"
    if not together:
        # A plan from where the robot seemed to be comes too late.
        assert drive.plan().path is None
    # The next one mends what was moved.
    assert drive.request.reason.startswith("map and pose moved")
    assert [tuple(cell) for cell in drive.request.problem.before.tolist()] == moved
    planned = NearOptimal().plan(drive.request.problem).cells
    assert [tuple(cell) for cell in planned.tolist()][:19] == moved[:19]
    drive.finish()


def test_cells_of_a_turned_map_are_moved_one_by_one():
    walk = np.array([(0, col) for col in range(20)], np.int32)
    motion = Motion(Pose2D(0.15, 0.15), Pose2D(0.45, 0.75, math.radians(6.0)))
    moved = moved_cells(walk, motion, 0.3)
    assert moved[0].tolist() == [2, 1]
    x, y = 0.45 + 0.3 * 19 * math.cos(math.radians(6)), 0.75 + 0.3 * 19 * math.sin(math.radians(6))
    assert moved[-1].tolist() == [math.floor(y / 0.3), math.floor(x / 0.3)]
    apart = np.abs(np.diff(moved, axis=0))
    assert apart.max() == 1
    assert apart.any(axis=1).all()


def test_of_two_motions_the_path_before_the_first_moves_and_none_of_another_order_or_map():
    drive = started(*["." * 12] * 6, cell=(2, 2))
    route, motion = drive.mission.route, drive.mission._handler.motion
    pose = pose_at(2, 2).pose.pose
    moved, path = replace(pose, x=pose.x + CELL), route.path.ahead
    motion.receive_map(pose)
    route.publish(path[:3], "cut", drive.now)
    # The map moves again before a pose comes.
    motion.receive_map(pose)
    assert motion.receive_pose(moved).end == moved
    assert motion.move_path(drive.now) is not None
    assert route.path_to_keep[-1].tolist() == [path[-1][0], path[-1][1] + 1]
    motion.receive_map(pose)
    motion.forget_order()
    assert motion.receive_pose(moved) is not None
    assert motion.move_path(drive.now) is None
    motion.receive_map(pose)
    motion.leave_map()
    assert motion.receive_pose(moved) is None


# Shifts of a map by a few pixels, and changes that are none.


def shifted(before, after, right=0.0, up=0.0, yaw=0.0):
    """The shift found between two maps, the second one moved by so many pixels, or None."""
    grids = [
        OccupancyGrid(GridGeometry(*pixels.shape, PIXEL_M, origin), np.ascontiguousarray(pixels))
        for pixels, origin in (
            (before, Pose2D(0.0, 0.0)),
            (after, Pose2D(right * PIXEL_M, up * PIXEL_M, yaw)),
        )
    ]
    found = small_shift(*grids, CONFIG.footprint)
    return None if found is None else (found.end.x / PIXEL_M, found.end.y / PIXEL_M)


@pytest.mark.parametrize("shift", [(1, 0), (-3, 2), (4, -4), (2.8, 0.0)])
def test_a_map_that_was_shifted(shift):
    assert shifted(two_rooms(is_open=True), two_rooms(is_open=True), *shift) == pytest.approx(
        np.rint(shift)
    )


def test_a_map_with_walls_of_many_pixels():
    walls = np.pad(two_rooms(is_open=True), 8, constant_values=100)
    assert shifted(walls, walls, 3, 1) == pytest.approx((3, 1))


def noisy(pixels, seed):
    """The same with walls that are a pixel thicker in places, and specks."""
    rng = np.random.default_rng(seed)
    cells = pixels.copy()
    beside = np.zeros(cells.shape, bool)
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        beside |= np.roll(pixels == 100, by, axis)
    cells[beside & (rng.random(cells.shape) < 0.3)] = 100
    cells[rng.random(cells.shape) < 0.01] = 100
    return cells


def furnished():
    pixels = two_rooms(is_open=True)
    pixels[10:20, 20:34] = pixels[30:44, 80:90] = 100
    return pixels


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (two_rooms(is_open=True), two_rooms(is_open=True)),
        (two_rooms(is_open=True), changed("closed")),
        (two_rooms(is_open=True), changed("unknown")),
        (two_rooms(is_open=True), furnished()),
        (furnished(), two_rooms(is_open=True)),
        (noisy(two_rooms(is_open=True), 1), noisy(two_rooms(is_open=True), 2)),
        (two_rooms(is_open=True), np.zeros((52, 124), np.int8)),
        (two_rooms(is_open=True), np.full((52, 124), 100, np.int8)),
    ],
    ids=["same", "door", "unknown", "furniture", "none", "noise", "no walls", "no floor"],
)
def test_a_map_that_was_not(before, after):
    assert shifted(before, after) is None


def test_noise_hides_no_shift():
    assert shifted(
        noisy(two_rooms(is_open=True), 1), noisy(two_rooms(is_open=True), 2), 3, 0
    ) == pytest.approx((3, 0))
