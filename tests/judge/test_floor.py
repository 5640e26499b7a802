"""The judge of swept floor, against cases computed by hand and a slow, obvious twin."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from fasaco_edge.judge import floor
from fasaco_edge.judge.floor import JudgedFloor, SweepingRobot, judge_floor, swept_words
from fasaco_edge.judge.pixels import Patches, within

PIXEL_M = 0.05
ROBOT = SweepingRobot(tool_m=0.4, radius_m=0.2, speed_m_s=0.5, turn_s=2.0)
# What the corners of a room keep from a disc of 0.2 m [m2].
CORNERS_M2 = (4 - math.pi) * 0.2**2


def room(width_m: float, depth_m: float, origin: Pose2D | None = None) -> OccupancyGrid:
    """Return an empty room within walls of one pixel; the walls' outer corner is at ``origin``."""
    rows, cols = round(depth_m / PIXEL_M) + 2, round(width_m / PIXEL_M) + 2
    cells = np.full((rows, cols), FREE, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    geometry = GridGeometry(rows, cols, PIXEL_M, origin or Pose2D(-PIXEL_M, -PIXEL_M))
    return OccupancyGrid(geometry, cells)


def with_rectangle(
    grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float, value: int = OCCUPIED
) -> OccupancyGrid:
    """Return ``room`` with a rectangle [m] of another value."""
    cells = grid.cells.copy()
    col0, row0, col1, row1 = (round(at / PIXEL_M) + 1 for at in (x0, y0, x1, y1))
    cells[row0:row1, col0:col1] = value
    return OccupancyGrid(grid.geometry, cells)


def judged(
    grid: OccupancyGrid, *points: tuple[float, float], driven: list[bool] | None = None
) -> JudgedFloor:
    ways = None if driven is None else np.array(driven, np.bool_)
    return judge_floor(grid, np.array(points, np.float64), ROBOT, driven=ways)


def test_empty_room_is_reachable_but_for_its_corners() -> None:
    figures = judged(room(4.0, 3.0), (2.0, 1.5)).figures
    # The raster keeps the robot's disc a finer pixel from the walls.
    assert figures.reachable_m2 == pytest.approx(4.0 * 3.0 - CORNERS_M2, rel=0.02)
    assert figures.pixel_m == 0.025
    # A tool that stood still swept its own disc.
    assert figures.swept_m2 == pytest.approx(math.pi * 0.2**2, rel=0.05)
    assert [figures.length_m, figures.quarter_turns, figures.seconds] == [0.0, 0.0, 0.0]
    assert figures.illegal_share == 0.0


def test_one_lane_sweeps_its_length_and_a_disc() -> None:
    figures = judged(room(4.0, 3.0), (1.0, 1.5), (2.0, 1.5), (3.0, 1.5)).figures
    swept_m2 = 2.0 * 0.4 + math.pi * 0.2**2
    assert figures.swept_m2 == pytest.approx(swept_m2, rel=0.01)
    assert figures.swept_share == pytest.approx(swept_m2 / (12.0 - CORNERS_M2), rel=0.02)
    assert [figures.length_m, figures.seconds] == pytest.approx([2.0, 4.0])
    assert figures.seconds_per_m2 == pytest.approx(4.0 / swept_m2, rel=0.01)
    # All that is left hangs together around the lane.
    assert figures.patches_over_4_dm2 == 1
    assert figures.largest_patch_m2 == pytest.approx(figures.reachable_m2 - figures.swept_m2)


def test_no_line_takes_less_than_the_least_time() -> None:
    # Along a straight lane nothing is swept twice: the bound is reached, and not passed.
    lane = judged(room(6.0, 3.0), (1.0, 1.5), (5.0, 1.5)).figures
    assert lane.least_s == pytest.approx(lane.seconds, rel=0.01)
    # Two lanes side by side sweep two discs and a strip less than their length promises.
    lanes = judged(room(6.0, 3.0), (1.0, 1.0), (5.0, 1.0), (5.0, 1.4), (1.0, 1.4)).figures
    swept_m2 = 8.0 * 0.4 + 0.2 * 0.4 + 1.5 * math.pi * 0.2**2
    least_s = (swept_m2 - math.pi * 0.2**2) / 0.4 / 0.5
    assert lanes.gap == pytest.approx((8.4 / 0.5 + 2 * 2.0) / least_s - 1.0, abs=0.01)
    # There and back sweeps the floor of one way.
    again = judged(room(6.0, 3.0), (1.0, 1.5), (5.0, 1.5), (1.0, 1.5)).figures
    assert again.gap == pytest.approx((16.0 + 2 * 2.0) / 8.0 - 1.0, abs=0.02)
    # A tool that stands still takes no time.
    assert judged(room(4.0, 3.0), (2.0, 1.5)).figures.gap == 0.0


def test_turns_count_by_their_angle() -> None:
    points = [(1.0, 1.0), (2.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 1.0)]
    figures = judged(room(4.0, 3.0), *points).figures
    # A quarter to the left, then three eighths of a full turn; standing still is none.
    assert figures.quarter_turns == pytest.approx(1.0 + 1.5)
    assert figures.seconds == pytest.approx((2.0 + math.sqrt(2.0)) / 0.5 + 2.5 * 2.0)


def test_swept_floor_equals_a_comparison_pixel_by_pixel() -> None:
    grid = room(4.0, 3.0)
    rng = np.random.default_rng(3)
    for count in (1, 2, 3, 9):
        points = rng.uniform((-0.5, -0.5), (4.5, 3.5), (count, 2))
        # Along the axes, standing still, and a hair's breadth on.
        points[1::4, 0], points[2::4, 1] = points[0, 0], points[0, 1]
        points[4::4] = points[3:-1:4][: len(points[4::4])]
        points[8::4] += 1e-9
        floor = judge_floor(grid, points, ROBOT, stands_at=(2.0, 1.5))
        rows, cols = np.indices(floor.swept.shape) + 0.5
        x = floor.geometry.origin.x + cols * floor.geometry.resolution
        y = floor.geometry.origin.y + rows * floor.geometry.resolution
        near = np.hypot(x - points[0, 0], y - points[0, 1]) <= 0.2
        for (ax, ay), (bx, by) in pairwise(points):
            length = max((bx - ax) ** 2 + (by - ay) ** 2, 1e-30)
            share = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0.0, 1.0)
            near |= np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)) <= 0.2
        differ = floor.swept != (near & floor.reachable)
        # The tolerance of a thousandth of a pixel decides about few of them.
        assert np.count_nonzero(differ) <= 0.001 * np.count_nonzero(near)
        assert floor.figures.swept_m2 == pytest.approx(np.count_nonzero(floor.swept) * 0.025**2)


@pytest.mark.parametrize("value", [OCCUPIED, UNKNOWN, 26])
def test_a_pillar_is_no_floor(value: int) -> None:
    empty = judged(room(4.0, 3.0), (0.5, 0.5)).figures
    grid = with_rectangle(room(4.0, 3.0), 2.0, 1.0, 2.5, 2.0, value)
    figures = judged(grid, (0.5, 0.5)).figures
    # A finer pixel around it is not reached either.
    assert empty.reachable_m2 - figures.reachable_m2 == pytest.approx(0.5, abs=0.1)
    through = judged(grid, (1.0, 1.5), (3.0, 1.5)).figures
    # The robot touches it from its radius before to its radius behind.
    assert through.illegal_share == pytest.approx((0.5 + 2 * 0.2) / 2.0, abs=0.05)


def test_a_line_through_a_wall_sweeps_nothing_behind_it() -> None:
    grid = with_rectangle(room(4.0, 3.0), 1.9, 0.0, 2.1, 3.0)
    figures = judged(grid, (1.0, 1.5), (3.0, 1.5)).figures
    assert figures.illegal_share == pytest.approx((0.2 + 2 * 0.2) / 2.0, abs=0.05)
    assert figures.reachable_m2 == pytest.approx(1.9 * 3.0 - CORNERS_M2, rel=0.03)
    lane_m2 = 0.7 * 0.4 + math.pi * 0.2**2
    assert figures.swept_m2 == pytest.approx(lane_m2, rel=0.06)


@pytest.mark.parametrize(("door_m", "rooms"), [(0.3, 1), (0.4, 1), (0.45, 2), (0.6, 2)])
def test_a_door_must_be_wider_than_the_robot(door_m: float, rooms: int) -> None:
    grid = with_rectangle(room(4.1, 3.0), 2.0, 0.0, 2.1, 3.0)
    grid = with_rectangle(grid, 2.0, 1.0, 2.1, 1.0 + door_m, FREE)
    figures = judged(grid, (1.0, 1.5)).figures
    assert figures.reachable_m2 == pytest.approx(rooms * 2.0 * 3.0, rel=0.04)


def test_a_map_that_lies_askew_is_judged_the_same() -> None:
    straight = with_rectangle(room(4.0, 3.0, Pose2D(0.0, 0.0)), 2.0, 1.0, 2.5, 2.0)
    rows, cols = straight.cells.shape
    askew = GridGeometry(rows, cols, PIXEL_M, Pose2D(7e4, -3e4, 0.7))
    turned = OccupancyGrid(askew, straight.cells)
    # Beside the pixels' centres and edges: rounding decides nothing here.
    points = np.array([(0.51, 0.52), (3.51, 0.73), (3.33, 2.57), (0.72, 2.41)])
    moved = np.array([turned.geometry.to_map(*point) for point in points / PIXEL_M])
    one = judge_floor(straight, points, ROBOT)
    other = judge_floor(turned, moved, ROBOT)
    assert np.array_equal(one.swept, other.swept)
    assert np.array_equal(one.reachable, other.reachable)
    assert asdict(other.figures) == pytest.approx(asdict(one.figures), rel=1e-6)
    swept = np.argwhere(other.swept)[0]
    x, y = other.geometry.to_map(swept[1] + 0.5, swept[0] + 0.5)
    assert np.hypot(*(moved - (x, y)).T).min() < 3.5


def test_a_way_that_was_not_driven_sweeps_nothing() -> None:
    points = (1.0, 0.5), (2.0, 0.5), (2.0, 2.5), (1.0, 2.5)
    figures = judged(room(4.0, 3.0), *points, driven=[True, False, True]).figures
    assert figures.length_m == pytest.approx(2.0)
    assert figures.swept_m2 == pytest.approx(2 * (1.0 * 0.4 + math.pi * 0.2**2), rel=0.02)
    assert judged(room(4.0, 3.0), *points, driven=[False] * 3).figures.length_m == 0.0
    with pytest.raises(ValueError, match="a member for each of"):
        judged(room(4.0, 3.0), *points, driven=[True])


def test_floor_is_reachable_from_where_the_robot_stands() -> None:
    grid = with_rectangle(room(5.0, 3.0), 1.9, 0.0, 2.0, 3.0)
    line = np.array([(1.0, 1.5), (3.0, 1.5)])
    here = judge_floor(grid, line, ROBOT).figures.reachable_m2
    there = judge_floor(grid, line, ROBOT, stands_at=(3.0, 1.5)).figures.reachable_m2
    assert [here, there] == pytest.approx([1.9 * 3.0, 3.0 * 3.0], rel=0.03)


def test_without_reachable_floor_there_is_no_share() -> None:
    nowhere = OccupancyGrid(
        GridGeometry(4, 4, PIXEL_M, Pose2D(0.0, 0.0)), np.full((4, 4), UNKNOWN, np.int8)
    )
    for grid in (nowhere, room(0.3, 3.0)):
        figures = judged(grid, (0.1, 0.1), (0.2, 0.1)).figures
        assert (figures.reachable_m2, figures.swept_share) == (0.0, None)
        assert (figures.seconds_per_m2, figures.largest_patch_m2) == (None, 0.0)
        assert figures.illegal_share == 1.0


@pytest.mark.parametrize(
    ("swept_m2", "reachable_m2", "said"),
    [
        (34.54, 49.42, "34.5 of 49.4 m2 (69.9 %)"),
        (1999.9, 2000.0, "1,999.9 of 2,000.0 m2 (99.9 %)"),
        (2.0, 2.0, "2.0 of 2.0 m2 (100.0 %)"),
        (0.0, 0.0, "0.0 of 0.0 m2"),
    ],
)
def test_not_all_is_not_called_all(swept_m2: float, reachable_m2: float, said: str) -> None:
    assert swept_words(swept_m2, reachable_m2) == said


def test_pixels_are_coarser_on_a_large_map(monkeypatch: pytest.MonkeyPatch) -> None:
    fine = judged(room(4.0, 3.0), (1.0, 1.5), (3.0, 1.5)).figures
    monkeypatch.setattr(floor, "MOST_PIXELS", 80 * 60)
    coarse = judged(room(4.0, 3.0), (1.0, 1.5), (3.0, 1.5)).figures
    assert (fine.pixel_m, coarse.pixel_m) == (0.025, 0.05)
    assert coarse.swept_m2 == pytest.approx(fine.swept_m2, rel=0.05)


@pytest.mark.parametrize(
    "line", [np.zeros((0, 2)), np.zeros((2, 3)), np.array([[0.0, math.nan]]), np.zeros(2)]
)
def test_refuses_what_is_no_line(line: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match="a line must be"):
        judge_floor(room(1.0, 1.0), line, ROBOT)


SHAPES = [(1, 1), (1, 9), (9, 1), (13, 17), (30, 20)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("distance", [-0.5, 0.0, 1.0, 1.5, math.sqrt(5), 4.0, 40.0])
def test_within_a_distance_as_compared_pixel_by_pixel(
    shape: tuple[int, int], distance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fasaco_edge.judge.pixels.BLOCK_PIXELS", 64)
    rng = np.random.default_rng(5)
    for share in (0.0, 0.03, 0.5, 1.0):
        mask = rng.random(shape) < share
        near = np.zeros(shape, np.bool_)
        marked = np.argwhere(mask)
        for row, col in np.ndindex(shape):
            squares = ((marked - (row, col)) ** 2).sum(axis=1)
            near[row, col] = distance >= 0 and bool((squares <= distance**2 + 1e-12).any())
        assert np.array_equal(within(mask, distance + 1e-9 if distance > 0 else distance), near)


@pytest.mark.parametrize("shape", SHAPES)
def test_patches_as_found_by_spreading(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(6)
    for share in (0.0, 0.3, 0.55, 0.7, 1.0):
        mask = rng.random(shape) < share
        patches, left, sizes = Patches.of(mask), {tuple(at) for at in np.argwhere(mask)}, []
        while left:
            seed = min(left)
            patch, edge = set(), [seed]
            while edge:
                row, col = at = edge.pop()
                if at in left:
                    left.discard(at)
                    patch.add(at)
                    edge += [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
            sizes.append(len(patch))
            found = patches.nearest_to(seed[1] + 0.5, seed[0] + 0.5)
            assert {tuple(at) for at in np.argwhere(found)} == patch
        assert sorted(patches.pixels.tolist()) == sorted(sizes)
    assert not Patches.of(np.zeros(shape, np.bool_)).nearest_to(0.0, 0.0).any()


def test_a_robot_with_a_turning_radius_reverses_to_turn() -> None:
    grid, line = room(4.0, 3.0), np.array([(1.0, 1.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0)])
    spot, arc = (
        judge_floor(grid, line, replace(ROBOT, turn_radius_m=radius_m)).figures
        for radius_m in (0.0, 0.5)
    )
    assert (spot.reversals, spot.spot_turns) == (0, 0)
    assert spot.seconds == pytest.approx(5.0 / 0.5 + 3 * 2.0)
    # The corner stays a turn on the spot; turning back costs a stop.
    assert (arc.reversals, arc.spot_turns) == (1, 1)
    assert arc.seconds == pytest.approx(5.0 / 0.5 + 2.0 + 2.0)
