"""Grids read back from drawings: upright and in their place."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import chunks_in, pa
from fasaco_edge.recording.read.timeline import grids_in
from fasaco_edge.recording.scene import archetypes
from tests.support.recordings import writer_in

CELLS = np.array([[1, 2, 3], [9, 8, 100]], np.int8)


@pytest.fixture
def batches(tmp_path):
    """Return the rows of a map at an angle, and of swept floor, by their entity."""
    geometry = GridGeometry(2, 3, 0.3, Pose2D(0.6, -0.3, math.radians(-25.0)))
    grid = OccupancyGrid(geometry, CELLS)
    writer = writer_in(tmp_path)
    writer.log(entities.MAP, archetypes.map_archetype(grid))
    writer.log(entities.FLOOR, archetypes.floor_archetype(grid))
    assert writer.close()
    (part,) = tmp_path.glob("*.rrd")
    return {chunk.entity: chunk.batch for chunk in chunks_in(part)}


def test_a_grid_lies_where_it_was_drawn_and_a_tint_is_its_opacity(batches):
    (drawn,) = grids_in(batches[entities.MAP], np.array([1000.0, 2000.0]))
    size = drawn.geometry
    assert (size.rows, size.cols, size.resolution) == (2, 3, pytest.approx(0.3))
    assert (size.origin.x, size.origin.y) == pytest.approx((1000.6, 1999.7))
    assert math.degrees(size.origin.yaw) == pytest.approx(-25.0, abs=1e-4)
    np.testing.assert_array_equal(drawn.pixels, CELLS)
    (floor,) = grids_in(batches[entities.FLOOR], np.zeros(2))
    np.testing.assert_allclose(floor.pixels, CELLS * (entities.SWEPT_OPACITY / 100), atol=1.0)


def test_a_grid_whose_size_does_not_match_is_refused(batches):
    rows, wrong = batches[entities.MAP], pa.array([[{"width": 4, "height": 2}]])
    broken = rows.set_column(rows.schema.get_field_index("GridMap:format"), "GridMap:format", wrong)
    with pytest.raises(ValueError, match="a grid of 6 pixels, stated 2 x 4"):
        next(grids_in(broken, np.zeros(2)))
