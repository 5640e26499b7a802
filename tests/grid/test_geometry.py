"""Frames, bounds and windows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window

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
def test_slices_pick_a_window_out_of_an_array(inner, outer):
    common = inner.intersection(outer)
    if common is None:
        return
    rows, cols = np.mgrid[outer.row0 : outer.row1, outer.col0 : outer.col1]
    picked = common.slices_in(outer)
    assert rows[picked].shape == (common.rows, common.cols)
    cells = zip(rows[picked].ravel().tolist(), cols[picked].ravel().tolist(), strict=True)
    assert set(cells) == cells_of(common)
