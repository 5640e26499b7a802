"""Swept floor is kept by pixel, as the tool passes over its centre."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.mission.coverage.floor_tiles import FLOOR_TILE, NO_FLOOR, PIXEL_M, pixels_under
from fasaco_edge.mission.coverage.loop_closure import Motion, certain_floor
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.steady_track import PoseScatter, SteadyTrack
from fasaco_edge.mission.coverage.swept_floor import (
    ANYWHERE,
    DROPPED_FLOOR_TILES,
    JUMP_TOOLS,
    MOST_AHEAD,
    MOST_FLOOR_TILES,
    SweptFloor,
)
from tests.mission.world import CELL, rectangle, started
from tests.support.examples import examples

TOOL = 0.3
AROUND = Window(-80, -80, 80, 120)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, math.pi])
@pytest.mark.parametrize("ahead_m", [0.2, -0.2])
def test_a_tool_ahead_of_the_axle_sweeps_there(ahead_m, yaw):
    """Also where the robot turns on the spot: its tool swings round."""
    offset, ledger = MissionLedger(0.3, TOOL, ahead_m), MissionLedger(0.3, TOOL)
    ux, uy = math.cos(yaw), math.sin(yaw)
    for way in np.arange(0.0, 1.01, 0.02):
        offset.record(Pose2D(way * ux, way * uy, yaw))
        x, y = (way + ahead_m) * ux, (way + ahead_m) * uy
        ledger.record(Pose2D(x, y, yaw))
    for turned in np.arange(0.0, math.pi / 2, 0.05):
        offset.record(Pose2D(ux, uy, yaw + turned))
        x, y = ux + ahead_m * math.cos(yaw + turned), uy + ahead_m * math.sin(yaw + turned)
        ledger.record(Pose2D(x, y, yaw + turned))
    swept = offset.floor.swept_in(AROUND)
    assert (swept == ledger.floor.swept_in(AROUND)).all()


def drive(*points, tool_m=TOOL):
    """The floor of a drive over points (x, y) [m]."""
    floor = SweptFloor(tool_m)
    for x, y in points:
        floor.record(Pose2D(x, y))
    return floor


def centres(window):
    """x, y [m] of the centres of a window's pixels."""
    rows, cols = np.mgrid[window.row0 : window.row1, window.col0 : window.col1] + 0.5
    return cols * PIXEL_M, rows * PIXEL_M


def distances(points, window):
    """How far each pixel's centre lies from the line through points [m], (rows, cols)."""
    x, y = centres(window)
    nearest = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in zip(points, [*points[1:], points[-1]], strict=True):
        for share in np.linspace(0.0, 1.0, 80):
            at = ax + share * (bx - ax), ay + share * (by - ay)
            nearest = np.minimum(nearest, np.hypot(x - at[0], y - at[1]))
    return nearest


@examples(25)
@given(
    st.lists(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)), max_size=3),
    st.sampled_from([0.17, 0.3, 0.5]),
)
def test_a_drive_sweeps_what_its_twin_finds_under_many_discs(moves, tool_m):
    """The twin walks each way in tiny steps and asks at every one what lies under the tool."""
    points = np.cumsum([(0.0, -0.1), *moves], axis=0).tolist()
    swept = drive(*points, tool_m=tool_m).swept_in(AROUND)
    nearest = distances(points, AROUND)
    sure = abs(nearest - tool_m / 2) > 1e-3
    assert np.array_equal(swept[sure], (nearest < tool_m / 2)[sure])


def test_all_that_is_swept_is_counted_once():
    floor = drive((0.0, 0.0), (0.5, 0.0), (0.0, 0.0), (0.5, 0.0))
    assert floor.pixels == np.count_nonzero(floor.swept_in(AROUND)) > 0
    assert floor.swept_m2 == pytest.approx(0.5 * TOOL + math.pi * TOOL**2 / 4, rel=0.05)
    changes = floor.changes
    floor.record(Pose2D(0.4, 0.0))
    assert floor.changes == changes


def test_a_jump_of_the_pose_sweeps_nothing():
    jumped = drive((0.0, 0.0), (JUMP_TOOLS * TOOL + 0.01, 0.0))
    assert not jumped.swept_in(Window(-1, 10, 1, 14)).any()
    assert drive((0.0, 0.0), (JUMP_TOOLS * TOOL, 0.0)).swept_in(Window(-1, 10, 1, 14)).all()


@pytest.mark.parametrize("yaw", [0.0, 0.4, math.pi / 2, -2.0])
@pytest.mark.parametrize("resolution", [0.011, 0.025, 0.3])
def test_swept_floor_moves_to_another_raster_by_pixel_centres(yaw, resolution):
    floor = drive((0.0, 0.0), (0.5, 0.2), (0.1, 0.4))
    geometry = GridGeometry(90, 300, resolution, Pose2D(-0.703, -0.311, yaw))
    carried = floor.swept_on(geometry)
    for row, col in np.argwhere(np.ones(carried.shape))[::37].tolist():
        x, y = geometry.to_map(col + 0.5, row + 0.5)
        i, j = math.floor(y / PIXEL_M), math.floor(x / PIXEL_M)
        assert carried[row, col] == floor.swept_in(Window(i, j, i + 1, j + 1))[0, 0]
    part = Window(20, 30, 61, 290)
    assert np.array_equal(floor.swept_on(geometry, part), carried[20:61, 30:290])


def test_a_centre_between_two_pixels_always_lies_on_the_same_one():
    """Rounding decided, by where the window began: the count of a line was off by some pixels."""
    floor = drive((0.0, 0.0), (0.5, 0.2), (0.1, 0.4), (0.9, 0.7), (0.3, 1.1))
    geometry = GridGeometry(142, 82, 0.02, Pose2D(-0.22, -0.22))
    whole = floor.swept_on(geometry)
    for row in range(0, 100, 7):
        for col in range(0, 60, 7):
            part = Window(row, col, row + 40, col + 20)
            assert np.array_equal(
                floor.swept_on(geometry, part), whole[row : row + 40, col : col + 20]
            )


def test_floor_inside_is_forgotten_except_under_the_tool():
    floor = drive((0.0, 0.0), (0.4, 0.0), (0.8, 0.0))
    here = drive((0.8, 0.0)).swept_in(AROUND)
    before = floor.swept_in(AROUND)
    floor.forget(lambda window: centres(window)[0] > 0.3)
    assert np.array_equal(floor.swept_in(AROUND), (before & (centres(AROUND)[0] < 0.3)) | here)
    assert floor.pixels == np.count_nonzero(floor.swept_in(AROUND))
    changes = floor.changes
    floor.break_track()
    floor.forget(lambda window: np.ones((window.rows, window.cols), bool))
    assert floor.pixels == 0
    assert floor.changes > changes
    assert not floor.snapshot().tiles


def test_a_snapshot_is_constant_and_shares_unchanged_parts():
    floor = drive((0.1, 0.1), (5.0, 0.1))
    first = floor.snapshot()
    kept = first.swept_in(AROUND)
    floor.record(Pose2D(5.1, 0.1))
    second = floor.snapshot()
    assert second.tiles[0, 0] is first.tiles[0, 0]
    assert second.tiles[0, 1] is not first.tiles[0, 1]
    assert second.pixels == floor.pixels > first.pixels
    assert np.array_equal(first.swept_in(AROUND), kept)
    with pytest.raises(ValueError, match="read-only"):
        first.tiles[0, 0][0, 0] = 1
    with pytest.raises(TypeError):
        first.tiles[9, 9] = first.tiles[0, 0]


def test_a_restored_floor_continues_without_a_difference():
    points = [(0.1 * step, 0.03 * step) for step in range(40)]
    whole, begun = drive(*points, *points[::-1]), drive(*points)
    restored = SweptFloor.restored(begun.snapshot(), TOOL)
    assert (restored.pixels, restored.changes) == (begun.pixels, begun.changes)
    for x, y in points[::-1]:
        restored.record(Pose2D(x, y))
    window = Window(-20, -20, 100, 200)
    assert np.array_equal(restored.swept_in(window), whole.swept_in(window))
    assert restored.pixels == whole.pixels
    assert SweptFloor.restored(NO_FLOOR, TOOL).pixels == 0


def test_poses_that_jump_all_over_the_world_take_a_bounded_floor():
    floor = SweptFloor(TOOL)
    tile_m = FLOOR_TILE * PIXEL_M
    for number in range(MOST_FLOOR_TILES + 10):
        row, col = divmod(number, 100)
        floor.record(Pose2D((col + 0.5) * tile_m, (row + 0.5) * tile_m))
    tiles = floor.snapshot().tiles
    assert MOST_FLOOR_TILES - DROPPED_FLOOR_TILES < len(tiles) <= MOST_FLOOR_TILES
    assert floor.dropped == DROPPED_FLOOR_TILES
    assert floor.pixels == floor.snapshot().pixels
    # Those far from where the robot is were dropped.
    assert (0, 0) not in tiles
    assert divmod(MOST_FLOOR_TILES + 9, 100) in tiles


def wobbling(sigma_m, poses=400):
    """Poses along a straight lane, every 2.5 cm, with errors."""
    errors = np.random.default_rng(1).normal(0.0, sigma_m, (poses, 2))
    return [(0.025 * step + dx, dy) for step, (dx, dy) in enumerate(errors.tolist())]


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.03])
def test_the_scatter_of_poses_is_what_they_err(sigma_m):
    scatter = PoseScatter(0.15)
    for x, y in wobbling(sigma_m):
        scatter.receive_pose(Pose2D(x, y))
    assert scatter.sigma_m == pytest.approx(sigma_m, rel=0.4)


def test_few_poses_and_corners_show_no_noise():
    scatter = PoseScatter(0.15)
    for number, (x, y) in enumerate([(0.25 * min(n, 6), 0.25 * max(n - 6, 0)) for n in range(13)]):
        scatter.receive_pose(Pose2D(x, y))
        assert scatter.sigma_m == 0.0, number


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.03])
def test_reported_floor_is_swept_despite_noisy_poses(sigma_m):
    """A straight lane: all that the poses add to either side is wrong."""
    points = wobbling(sigma_m)
    floor = drive(*points)
    window = Window(-20, 40, 20, 360)
    swept = floor.swept_in(window)
    right = abs(centres(window)[1]) <= TOOL / 2
    assert np.count_nonzero(swept & right) >= 0.995 * np.count_nonzero(swept)
    assert np.count_nonzero(swept & right) >= 0.85 * np.count_nonzero(right)


def test_exact_poses_are_kept_at_once_and_others_seen_at_once():
    exact, scattered = drive(*wobbling(0.0)), drive(*wobbling(0.03))
    everywhere = Window(-40, -40, 40, 440)
    assert np.count_nonzero(exact.swept_in(everywhere)) == exact.pixels == exact.snapshot().pixels
    kept = scattered.snapshot().swept_in(everywhere)
    seen = scattered.swept_in(everywhere)
    assert np.count_nonzero(kept) == scattered.pixels < np.count_nonzero(seen)
    assert not (kept & ~seen).any()
    # To where the robot is now, and no farther than the tool reaches.
    assert seen[:, 40 + 399].any()
    changes = scattered.changes
    scattered.break_track()
    assert scattered.pixels == np.count_nonzero(scattered.swept_in(everywhere))
    assert scattered.changes > changes
    assert np.array_equal(scattered.swept_in(everywhere), seen)


def test_a_repeated_pose_hides_no_noise():
    """As each map tells the mission to look at the newest pose again."""
    once, twice = SweptFloor(TOOL), SweptFloor(TOOL)
    for x, y in wobbling(0.03, 60):
        for floor, times in ((once, 1), (twice, 2)):
            for _ in range(times):
                floor.record(Pose2D(x, y))
    assert once.changes == twice.changes
    assert np.array_equal(once.swept_in(AROUND), twice.swept_in(AROUND))


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.03])
def test_errors_of_filtered_positions_keep_their_bounds(sigma_m):
    track = SteadyTrack(TOOL)
    poses = wobbling(sigma_m)
    places = [place for x, y in poses for place in track.receive_pose(Pose2D(x, y))] + track.end()
    assert len(places) == len(poses)
    off, said = (np.array(each) for each in zip(*((p.y, p.error_m) for p in places), strict=True))
    assert (abs(off) <= said).mean() >= 0.9
    # The first and the last have few poses to both sides.
    assert said[40:-40].max(initial=0.0) <= max(0.6 * 2 * sigma_m, PIXEL_M / 2)
    assert not track.ahead()


@pytest.mark.parametrize("seed", range(6))
def test_after_a_loop_closure_only_surely_swept_floor_counts(seed):
    rng = np.random.default_rng(seed)
    floor = drive(*[(0.1 * (n % 12), 0.12 * (n // 12)) for n in range(120)])
    start = Pose2D(0.6, 0.6, 0.3)
    jump = rng.uniform(-0.2, 0.2, 3)
    motion = Motion(start, Pose2D(0.6 + jump[0], 0.6 + jump[1], 0.3 + 0.2 * jump[2]))
    before = floor.snapshot()
    floor.break_track()
    floor.leave(certain_floor(before, motion))
    left = floor.swept_in(AROUND)
    x, y = (each[left] for each in centres(AROUND))
    assert len(x) > 100
    for share in np.linspace(0.0, 1.0, 33):
        back_x, back_y = motion.back(float(share), x, y)
        rows, cols = np.floor(back_y / PIXEL_M).astype(int), np.floor(back_x / PIXEL_M).astype(int)
        was = before.swept_in(Window(-200, -200, 300, 300))[rows + 200, cols + 200]
        assert was.mean() > 0.98
    # What is farther from any border than it moved is sure.
    reach = math.hypot(jump[0], jump[1]) + 0.1
    inner = (centres(AROUND)[0] > reach) & (centres(AROUND)[0] < 1.1 - reach)
    inner &= (centres(AROUND)[1] > reach) & (centres(AROUND)[1] < 1.08 - reach)
    assert left[inner].all()


def test_a_robot_that_stood_still_forgets_no_floor():
    floor = drive(*[(0.1 * n, 0.0) for n in range(20)])
    before = floor.snapshot()
    assert not certain_floor(before, Motion(Pose2D(0, 0), Pose2D(0, 0)))(before.tiles)


def test_a_second_pass_forgets_the_floor_of_its_zone():
    drive = started("........")
    drive.finish()
    whole = drive.mission.covered.floor.pixels
    zone = {"name": "east", "polygon": rectangle(0, 0, 1, 4), "passes": 1}
    drive.command("start", {"zones": [zone]})
    assert drive.mission.covered.floor.pixels == pytest.approx(0.5 * whole, rel=0.15)
    mid = round(4 * CELL / PIXEL_M)
    swept = drive.mission.covered.floor.swept_in(Window(0, mid - 10, 10, mid + 10))
    assert not swept[:, :10].any()
    assert swept[:, 10:].any()


@pytest.mark.parametrize("sigma_m", [0.0, 0.03])
def test_the_reported_windows_contain_all_changes(sigma_m):
    """A raster that is kept up to date by the windows of changes alone."""
    floor, geometry = SweptFloor(TOOL), GridGeometry(70, 460, 0.025, Pose2D(-0.5, -0.8, 0.1))
    whole, known, changes = Window(0, 0, 70, 460), np.zeros((70, 460), bool), 0
    for number, (x, y) in enumerate(wobbling(sigma_m)):
        floor.record(Pose2D(x, y))
        if number == 200:
            floor.break_track()
        if number == 300:
            floor.forget(lambda window: centres(window)[0] < 4.0)
        if number % 7:
            continue
        news = floor.changed_since(changes)
        part = news and pixels_under(news, geometry).intersection(whole)
        if part is not None:
            known[part.slices_in(whole)] = floor.swept_on(geometry, part)
        changes = floor.changes
        assert np.array_equal(known, floor.swept_on(geometry)), number
    assert floor.changed_since(floor.changes) is None
    assert floor.changed_since(0) == ANYWHERE, "long ago"


def test_it_is_shown_in_pixels_where_these_are_not_too_many():
    floor = drive((0.1, 0.1), (0.5, 0.2))
    shown = floor.snapshot().as_grid(10**6, "map", 7)
    assert (shown.frame, shown.stamp_ns, shown.geometry.resolution) == ("map", 7, PIXEL_M)
    assert set(np.unique(shown.cells).tolist()) == {0, 100}
    assert np.array_equal(shown.cells > 0, floor.swept_on(shown.geometry))
    assert np.count_nonzero(shown.cells) == floor.pixels


@pytest.mark.parametrize("most", [60_000, 1_000, 300, 70, 20, 5])
def test_too_many_pixels_are_shown_as_squares_with_shares(most):
    floor = drive(*[(-1.0 + 0.05 * n, 0.3) for n in range(90)])
    shown = floor.snapshot().as_grid(most, "map", 0)
    rows, cols = shown.cells.shape
    assert shown.cells.size <= most < 64_000
    side = round(shown.geometry.resolution / PIXEL_M)
    corner = shown.geometry.origin
    row, col = round(corner.y / PIXEL_M), round(corner.x / PIXEL_M)
    swept = floor.swept_in(Window(row, col, row + rows * side, col + cols * side))
    shares = swept.reshape(rows, side, cols, side).mean(axis=(1, 3))
    assert swept.sum() == floor.pixels
    assert np.array_equal(shown.cells, np.floor(100 * shares + 1e-9))


def test_floor_too_large_for_squares_is_not_shown():
    astray = drive((0.0, 0.0), (9000.0, 9000.0))
    assert astray.snapshot().as_grid(10**6, "map", 0) is None
    blank = NO_FLOOR.as_grid(10**6, "map", 0)
    assert blank.cells.size
    assert not blank.cells.any()


def test_a_map_that_jumps_thousands_of_km_leaves_no_floor_sure():
    floor = drive(*[(0.1 * n, 0.0) for n in range(20)])
    before = floor.snapshot()
    floor.break_track()
    floor.leave(certain_floor(before, Motion(Pose2D(0, 0), Pose2D(9e6, -1e7, -4.4))))
    assert floor.pixels == 0


def test_poses_that_scatter_over_a_hall_take_no_memory():
    errors = np.random.default_rng(0).normal(0.0, 8.0, (60, 2)).tolist()
    floor = drive(*[(2.0 * n + dx, dy) for n, (dx, dy) in enumerate(errors)], tool_m=10.0)
    for n, (dx, dy) in enumerate(errors[:20]):
        floor.record(Pose2D(120.0 + 9.0 * n + 0.1 * dx, 0.1 * dy))
        place, ahead = floor._swept_ahead()
        assert ahead.size <= MOST_AHEAD
        assert ahead.shape == (place.rows, place.cols)
    assert floor.pixels
