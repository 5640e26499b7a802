"""Floor of a map: places, what the tool reaches, and where the robot stands in the cells."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import MapTooLarge, StartBlocked, StartOutsideMap
from fasaco_edge.grid.fine_raster import PolygonsOnRaster, RobotDiscs
from fasaco_edge.grid.floor import Floor, StandLattice, straightened
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import unpacked

DISCS = RobotDiscs(radius_m=0.18, tool_m=0.3)


def room(width_m: float, height_m: float, yaw: float = 0.0, unit: float = 0.05) -> OccupancyGrid:
    """Return a room without anything in it, walls one pixel thick; its corner lies at (2, 1) m."""
    rows, cols = round(height_m / unit) + 2, round(width_m / unit) + 2
    cells = np.zeros((rows, cols), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    x, y = 2.0 - unit, 1.0 - unit
    cos, sin = math.cos(yaw), math.sin(yaw)
    return OccupancyGrid(
        GridGeometry(rows, cols, unit, Pose2D(cos * x - sin * y, sin * x + cos * y, yaw)), cells
    )


def test_the_reachable_floor_of_a_room():
    floor = Floor.around(room(3.0, 2.0), DISCS, (3.0, 2.0))
    # Of fine pixels of 0.025 m the robot may be from 0.1875 m on; at 0.18 m a disc would fit.
    inner = (3.0 - 0.35) * (2.0 - 0.35)
    assert np.count_nonzero(
        unpacked(floor.places, floor.geometry.cols)
    ) * 0.025**2 == pytest.approx(inner)
    # Beside it the tool reaches 6 pixels; in the corners it is round.
    rim = 2 * 0.15 * (3.0 + 2.0 - 0.7) + math.pi * 0.15**2
    assert floor.reachable_m2 == pytest.approx(inner + rim, abs=0.03)


@pytest.mark.parametrize("yaw", [math.pi / 2, 0.4, -2.0])
def test_a_turned_map_has_the_same_floor(yaw):
    level, turned = room(3.0, 2.0), room(3.0, 2.0, yaw)
    cos, sin = math.cos(yaw), math.sin(yaw)
    expected = Floor.around(level, DISCS, (3.0, 2.0))
    found = Floor.around(turned, DISCS, (3 * cos - 2 * sin, 3 * sin + 2 * cos))
    assert (found.places == expected.places).all()
    pixels = np.array([(30.0, 40.0), (50.5, 60.25)])
    back = found.to_map(pixels) @ np.array([[cos, -sin], [sin, cos]])
    assert back == pytest.approx(expected.to_map(pixels))


def test_a_start_has_to_be_where_the_robot_fits():
    grid = room(3.0, 2.0)
    with pytest.raises(StartOutsideMap, match=r"\(9, 9\) m is outside the map"):
        Floor.around(grid, DISCS, (9.0, 9.0))
    with pytest.raises(StartBlocked, match="does not fit at"):
        Floor.around(room(0.3, 0.3), DISCS, (2.1, 1.1))
    with pytest.raises(StartBlocked, match="nor within its radius of it"):
        Floor.around(grid, DISCS, (2.02, 1.02))
    beside_the_wall = Floor.around(grid, DISCS, (2.02, 2.0))
    (at,) = beside_the_wall.to_map(np.array([beside_the_wall.start]))
    assert at == pytest.approx((2.1875, 2.0), abs=0.02)


def test_a_raster_too_large_is_refused(monkeypatch):
    monkeypatch.setattr("fasaco_edge.grid.floor.MOST_PIXELS", 3_000)
    with pytest.raises(MapTooLarge, match=r"pixels of 0\.05 m exceeds 3000 pixels"):
        Floor.around(room(3.0, 2.0), DISCS, (3.0, 2.0))


def test_cells_at_walls_have_stands_beside_their_middles():
    floor = Floor.around(room(3.0, 2.0), DISCS, (3.0, 2.0))
    stands = StandLattice.over(floor, 0.275)
    lattice = stands.lattice
    cells = np.argwhere(lattice.coverable)
    at = floor.to_map(stands.stands[tuple(cells.T)])
    own = np.floor(at / 0.275).astype(int)[:, ::-1]
    assert (own == cells + np.array((lattice.window.row0, lattice.window.col0))).all()
    # Of all places in the cell it is the nearest to the middle, to half a pixel.
    places = floor.to_map(np.argwhere(unpacked(floor.places, floor.geometry.cols)))
    middles = lattice.centres(own.astype(np.int32))
    for cell, middle, stand in zip(own, middles, at, strict=True):
        inside = places[(np.floor(places / 0.275)[:, ::-1] == cell).all(axis=1)]
        nearest = np.hypot(*(inside - middle).T).min()
        assert np.hypot(*(stand - middle)) == pytest.approx(nearest, abs=0.0125)
    row, col = stands.start_cell(floor)
    assert np.hypot(*(lattice.centres(np.array([[row, col]]))[0] - (3.0, 2.0))) < 0.2


def test_stands_keep_the_clearance_where_their_cell_allows_it():
    grid = room(3.0, 2.0)
    plain, careful = (RobotDiscs(DISCS.radius_m, DISCS.tool_m, clearance_m=m) for m in (0.0, 0.04))
    floor = Floor.around(grid, plain, (3.0, 2.0))
    with_it = replace(floor, discs=careful)
    stands, kept = (StandLattice.over(each, 0.275) for each in (floor, with_it))
    assert (stands.lattice.coverable == kept.lattice.coverable).all()
    assert (stands.lattice.steps == kept.lattice.steps).all()
    roomy = Floor.around(grid, RobotDiscs(careful.clear_m, DISCS.tool_m), (3.0, 2.0))
    places = roomy.to_map(np.argwhere(unpacked(roomy.places, roomy.geometry.cols)))
    have_one = {tuple(cell) for cell in np.floor(places / 0.275).astype(int).tolist()}
    moved = 0
    for row, col in np.argwhere(kept.lattice.coverable).tolist():
        x, y = floor.to_map(kept.stands[row, col][None])[0]
        apart = min(x - 2.0, 5.0 - x, y - 1.0, 3.0 - y)
        is_kept = apart > careful.clear_m - 1e-3
        assert is_kept == ((int(x // 0.275), int(y // 0.275)) in have_one)
        is_same = np.array_equal(kept.stands[row, col], stands.stands[row, col])
        assert is_kept or is_same
        moved += not is_same
    assert 0 < moved < kept.lattice.coverable.sum() / 2


def test_a_step_round_a_corner_has_a_bend():
    grid = room(1.6, 1.6)
    cells = grid.cells.copy()
    cells[16:, 16:] = 100  # all but an L
    floor = Floor.around(
        OccupancyGrid(grid.geometry, cells), RobotDiscs(radius_m=0.3, tool_m=0.7), (2.4, 1.4)
    )
    stands = StandLattice.over(floor, 0.7)
    assert not np.isnan(stands.bends).all()


def test_points_on_the_straight_way_are_left_out():
    line = np.array([(0, 0), (0, 0), (0, 1), (0, 2), (0, 1), (3, 1), (3, 1)], float)
    assert straightened(line).tolist() == [[0, 0], [0, 2], [0, 1], [3, 1]]
    assert straightened(line[:2]).tolist() == [[0, 0]]


# Which pixels of a raster many polygons touch: what each touches alone, near by or not.


ROWS, COLS = 120, 170


def polygons_of(count, seed=0):
    """Triangles and rectangles all over a raster of 6 m x 8.5 m, and beyond it."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        x, y, width, height = [*rng.uniform(-3.0, 10.0, 2), *rng.choice([0.05, 0.3, 0.61], 2)]
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        found.append(tuple(corners[: 3 + number % 2]))
    return found


@pytest.mark.parametrize("origin", [Pose2D(0.0, 0.0), Pose2D(-0.7, 0.31, 0.4)])
def test_several_polygons_touch_the_union_of_their_cells(origin):
    geometry, whole = GridGeometry(ROWS, COLS, 0.05, origin), Window(0, 0, ROWS, COLS)
    polygons = polygons_of(60)
    expected = np.zeros((ROWS, COLS), bool)
    for polygon in polygons:
        expected |= PolygonsOnRaster.of([polygon], geometry).touched(whole)
    assert expected.any()
    together = PolygonsOnRaster.of(polygons, geometry)
    for part in (whole, Window(40, 0, 41, COLS), Window(7, 100, 90, 131)):
        assert np.array_equal(together.touched(part), expected[part.slices_in(whole)])


def test_the_work_depends_on_the_polygons_near_a_part():
    """Each part looked at each of two thousand: three seconds for these."""
    geometry = GridGeometry(ROWS, COLS, 0.05, Pose2D(100.0, 0.0))
    far = PolygonsOnRaster.of(polygons_of(2000), geometry)
    far.touched(Window(0, 0, 9, 9))
    started = time.thread_time()
    for row in range(100):
        assert not far.touched(Window(row, 0, row + 20, COLS)).any()
    assert time.thread_time() - started < 0.5
