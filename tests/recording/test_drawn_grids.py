"""Grids read back from drawings: upright and in their place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import pa
from fasaco_edge.recording.read.timeline import grids_in


def strict(kind):
    return pa.field("item", kind, nullable=False)


def rows_of(*images, x=0.6, y=-0.3, cell_m=0.3, yaw=None):
    """Rows as a recorder writes them: images with the top row first."""
    column = {
        entities.WALL_CLOCK: pa.array(range(len(images)), pa.timestamp("ns")),
        "GridMap:data": pa.array(
            [[image.ravel().tolist()] for image in images],
            pa.list_(pa.list_(strict(pa.uint8()))),
        ),
        "GridMap:cell_size": pa.array([[cell_m]] * len(images), pa.list_(pa.float32())),
        "GridMap:translation": pa.array(
            [[[x, y, 0.0]]] * len(images), pa.list_(pa.list_(strict(pa.float32()), 3))
        ),
        "GridMap:format": pa.array(
            [[{"width": image.shape[1], "height": image.shape[0]}] for image in images]
        ),
    }
    if yaw is not None:
        turn = [0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)]
        column["GridMap:quaternion"] = pa.array(
            [[turn]] * len(images), pa.list_(pa.list_(strict(pa.float32()), 4))
        )
    return pa.RecordBatch.from_pydict(column)


def test_a_grid_at_an_angle_lies_where_it_was_drawn():
    anchor = np.array([1000.0, 2000.0])
    rows = rows_of(np.ones((2, 3), np.uint8), yaw=math.radians(-25.0))
    (grid,) = grids_in(rows, anchor)
    size = grid.geometry
    assert (size.rows, size.cols, size.resolution) == (2, 3, pytest.approx(0.3))
    assert (size.origin.x, size.origin.y) == pytest.approx((1000.6, 1999.7))
    assert math.degrees(size.origin.yaw) == pytest.approx(-25.0, abs=1e-4)


def test_a_grid_stands_upright_and_a_tint_is_its_opacity():
    image = np.array([[9, 8, 7], [1, 2, 3]], np.uint8)
    tinted = np.dstack([np.full((2, 3, 3), 200, np.uint8), image])
    for rows in (rows_of(image), rows_of(tinted)):
        (grid,) = grids_in(rows, np.zeros(2))
        assert (grid.at_ns, grid.geometry.origin.yaw) == (0, 0.0)
        np.testing.assert_array_equal(grid.pixels, [[1, 2, 3], [9, 8, 7]])


def test_a_grid_whose_size_does_not_match_is_refused():
    rows = rows_of(np.zeros((2, 2), np.uint8))
    wrong = pa.array([[{"width": 3, "height": 2}]])
    broken = rows.set_column(rows.schema.get_field_index("GridMap:format"), "GridMap:format", wrong)
    with pytest.raises(ValueError, match="a grid of 4 pixels, stated 2 x 3"):
        next(grids_in(broken, np.zeros(2)))
