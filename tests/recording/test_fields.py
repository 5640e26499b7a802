"""Pheromone fields read back: upright, in their place, and not more than can be kept."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.rotation import rotated_point
from fasaco_edge.recording.arrow import pa
from fasaco_edge.recording.read.drawn import MOST_FIELDS, FieldSampler


def strict(kind):
    return pa.field("item", kind, nullable=False)


def rows_of(*images, x=0.6, y=-0.3, cell_m=0.3, yaw=None):
    """Rows as a recorder writes them: images with the top row first."""
    column = {
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


def test_a_field_at_an_angle_has_the_cells_that_it_is_of():
    sampler = FieldSampler()
    x, y = rotated_point(0.6, -0.3, -25.0)
    sampler.take(rows_of(np.ones((2, 3), np.uint8), x=x, y=y, yaw=math.radians(-25.0)), [5])
    sampler.take(rows_of(np.ones((2, 3), np.uint8), yaw=0.0), [6])
    askew, straight = sampler.spread()
    assert askew.window == straight.window == Window(-1, 2, 1, 5)
    assert askew.yaw_deg == pytest.approx(-25.0, abs=1e-4)
    assert straight.yaw_deg == 0.0


def test_a_field_stands_upright_where_it_was_drawn():
    image = np.array([[9, 8, 7], [1, 2, 3]], np.uint8)
    sampler = FieldSampler()
    sampler.take(rows_of(image), [5])
    (field,) = sampler.spread()
    assert (field.at_ns, field.window) == (5, Window(-1, 2, 1, 5))
    np.testing.assert_array_equal(field.levels, [[1, 2, 3], [9, 8, 7]])


@pytest.mark.parametrize("count", [0, 1, 2, MOST_FIELDS, MOST_FIELDS + 1, 5 * MOST_FIELDS + 3])
def test_of_many_some_are_kept_all_over_the_time_and_the_last(count):
    sampler = FieldSampler()
    for number in range(count):
        sampler.take(rows_of(np.full((2, 2), number % 256, np.uint8)), [10 * number])
    assert sampler.count == count
    times = [field.at_ns for field in sampler.spread()]
    assert len(times) <= MOST_FIELDS + 1
    if count:
        assert (times[0], times[-1]) == (0, 10 * (count - 1))
        assert max(np.diff(times), default=0) <= 10 * max(4 * count // MOST_FIELDS, 1)


def test_a_field_of_another_size_than_told_is_refused():
    rows = rows_of(np.zeros((2, 2), np.uint8))
    wrong = pa.array([[{"width": 3, "height": 2}]])
    broken = rows.set_column(rows.schema.get_field_index("GridMap:format"), "GridMap:format", wrong)
    with pytest.raises(ValueError, match="a field of 4 cells, stated 2 x 3"):
        FieldSampler().take(broken, [0])
