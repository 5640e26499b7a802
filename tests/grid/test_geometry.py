"""Frames, bounds and windows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid import occupancy
from fasaco_edge.grid.geometry import RASTER_STEPS, GridGeometry, Pose2D, Window, union_bounds
from fasaco_edge.grid.occupancy import known_bounds
from tests.support.grids import grid, on_raster

METRES = st.floats(-1e3, 1e3)
SIDES = st.integers(-20, 20)


@st.composite
def windows(draw):
    row0, row1 = sorted(draw(st.tuples(SIDES, SIDES)))
    col0, col1 = sorted(draw(st.tuples(SIDES, SIDES)))
    return Window(row0, col0, row1, col1)


def cells_of(window):
    return {
        (row, col)
        for row in range(window.row0, window.row1)
        for col in range(window.col0, window.col1)
    }


@given(METRES, METRES, METRES, METRES, st.floats(-7, 7), st.floats(0.01, 2))
def test_to_pixels_undoes_to_map(col, row, x, y, yaw, resolution):
    geometry = GridGeometry(10, 20, resolution, Pose2D(x, y, yaw))
    back = geometry.to_pixels(*geometry.to_map(col, row))
    assert back == pytest.approx((col, row), abs=1e-6)


def test_a_quarter_turn_lays_columns_along_y():
    geometry = GridGeometry(2, 4, 0.5, Pose2D(10.0, -3.0, math.pi / 2))
    assert geometry.to_map(4, 0) == pytest.approx((10.0, -1.0))
    assert geometry.to_map(0, 2) == pytest.approx((9.0, -3.0))
    assert geometry.to_pixels(9.5, -2.5) == pytest.approx((1.0, 1.0))
    assert geometry.bounds() == pytest.approx((9.0, -3.0, 10.0, -1.0))


@given(METRES, METRES, st.floats(-7, 7), st.integers(1, 30), st.integers(1, 30))
def test_the_bounds_hold_every_pixel_and_touch_all_four_sides(x, y, yaw, rows, cols):
    geometry = GridGeometry(rows, cols, 0.1, Pose2D(x, y, yaw))
    corners = [geometry.to_map(col, row) for col in (0, cols) for row in (0, rows)]
    x_min, y_min, x_max, y_max = geometry.bounds()
    assert (min(x for x, _ in corners), max(x for x, _ in corners)) == (x_min, x_max)
    assert (min(y for _, y in corners), max(y for _, y in corners)) == (y_min, y_max)
    middle = geometry.to_map(cols / 2, rows / 2)
    assert middle == pytest.approx(((x_min + x_max) / 2, (y_min + y_max) / 2), abs=1e-9)


@given(windows(), windows())
def test_an_intersection_holds_the_common_cells(one, other):
    common = one.intersection(other)
    assert (cells_of(common) if common else set()) == cells_of(one) & cells_of(other)
    assert common == other.intersection(one)


@given(windows(), windows())
def test_a_window_without_another_is_cut_into_rectangles(one, hole):
    parts = one.without(hole)
    assert len(parts) <= 4
    assert all(part.rows > 0 and part.cols > 0 for part in parts)
    cells = [cell for part in parts for cell in cells_of(part)]
    assert len(cells) == len(set(cells))
    assert set(cells) == cells_of(one) - cells_of(hole)


RESOLUTIONS = st.sampled_from([0.05, 0.1, 0.0375, float(np.float32(0.05))])
YAWS = st.one_of(st.sampled_from([0.0, math.pi / 2, math.pi / 4]), st.floats(-7, 7))


@given(METRES, METRES, YAWS, RESOLUTIONS)
def test_a_raster_is_hardly_off_its_grid(x, y, yaw, resolution):
    geometry = GridGeometry(3, 4, resolution, Pose2D(x, y, yaw))
    raster, window = geometry.on_raster()
    assert (window.rows, window.cols) == (3, 4)
    assert 0.0 <= raster.right < 1.0
    assert 0.0 <= raster.up < 1.0
    snapped = on_raster(geometry)
    col, row = geometry.to_pixels(snapped.origin.x, snapped.origin.y)
    half = 0.5 / RASTER_STEPS + 1e-6
    assert abs(col) <= half
    assert abs(row) <= half


# As maps come: whole and half pixels, or a corner that was rounded once.
CORNERS = st.one_of(st.integers(-400, 400).map(lambda n: n / 2), st.integers(-99, 99).map(float))


@given(CORNERS, CORNERS, YAWS, RESOLUTIONS, SIDES, SIDES, st.booleans())
def test_grids_that_differ_by_whole_pixels_lie_on_one_raster(
    col, row, yaw, resolution, cols, rows, rounded
):
    there = GridGeometry(0, 0, resolution, Pose2D(0, 0, yaw))
    grids = []
    for corner in (there.to_map(col, row), there.to_map(col + cols, row + rows)):
        x, y = (float(np.float32(at)) for at in corner) if rounded else corner
        grids.append(GridGeometry(5, 6, resolution, Pose2D(x, y, yaw)))
    (raster, window), (other, moved) = (geometry.on_raster() for geometry in grids)
    assert raster == other
    assert moved == window.moved(rows, cols)


@pytest.mark.parametrize(
    "other", [Pose2D(0.012, 0.0), Pose2D(0.0, -0.0021), Pose2D(0.0, 0.0, 1e-3)]
)
def test_grids_that_differ_otherwise_do_not(other):
    geometry = GridGeometry(5, 6, 0.05, Pose2D(0.0, 0.0))
    raster, _ = geometry.on_raster()
    assert replace(geometry, origin=other).on_raster()[0] != raster
    assert replace(geometry, resolution=0.0501).on_raster()[0] != raster


@given(windows(), windows())
def test_slices_pick_a_window_out_of_an_array(inner, outer):
    common = inner.intersection(outer)
    if common is None:
        return
    rows, cols = np.mgrid[outer.row0 : outer.row1, outer.col0 : outer.col1]
    picked = common.slices_in(outer)
    assert rows[picked].shape == (common.rows, common.cols)
    cells = zip(rows[picked].ravel().tolist(), cols[picked].ravel().tolist(), strict=True)
    assert set(cells) == cells_of(common)


def test_a_window_is_rounded_outward_to_chunks():
    assert Window(5, 8, 9, 12).in_chunks(4, 10, 40) == Window(4, 8, 10, 12)


@pytest.mark.parametrize("block", [1, 12, 1_000_000])
def test_known_bounds_follow_the_map_when_it_is_turned(monkeypatch, block):
    monkeypatch.setattr(occupancy, "BLOCK_PIXELS", block)
    cells = np.full((4, 6), -1)
    cells[1:3, 2:5] = 0
    assert known_bounds(grid(cells)) == pytest.approx((0.2, 0.1, 0.5, 0.3))
    assert known_bounds(grid(cells, yaw=math.pi / 2)) == pytest.approx((-0.3, 0.2, -0.1, 0.5))
    assert known_bounds(grid(np.full((4, 6), -1))) is None


def test_union_holds_all_parts():
    assert union_bounds() is union_bounds(None) is None
    assert union_bounds(None, (0.0, 0.0, 1.0, 1.0)) == (0.0, 0.0, 1.0, 1.0)
    one, other = (0.0, -1.0, 1.0, 1.0), (-2.0, 0.0, 0.5, 3.0)
    assert union_bounds(one, other) == (-2.0, -1.0, 1.0, 3.0)
