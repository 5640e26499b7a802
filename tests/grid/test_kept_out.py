"""Which pixels of a raster many polygons touch: what each touches alone, near by or not."""

import time

import numpy as np
import pytest

from fasaco_edge.grid.fine_raster import PolygonsOnRaster
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window

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
