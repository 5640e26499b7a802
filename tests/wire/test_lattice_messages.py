"""Coverage and pheromone: what lies on the coverage lattice."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid import lattice
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire.messages import maps
from fasaco_edge.wire.messages.maps import (
    decode_occupancy_grid,
    direction_values,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.pheromone import decode_pheromone, encode_pheromone
from tests.support.examples import examples

# The float32s from the least normal one up: trails do not come smaller.
trails = hnp.arrays(
    np.float32,
    hnp.array_shapes(min_dims=2, max_dims=2, max_side=9),
    elements=st.one_of(st.just(0.0), st.floats(2.0**-126, 2.0**120, width=32)),
)


def snapshot(trail: np.ndarray, **changes: int) -> ColonySnapshot:
    rows, cols = trail.shape
    counts = {"cohort": 0, "velocity": 1, "ants": 8, "best_steps": 40} | changes
    return ColonySnapshot(Window(-2, 3, rows - 2, cols + 3), 0.3, trail, **counts)


def test_coverage_values_are_those_of_the_contract() -> None:
    states = np.array(
        [[lattice.UNKNOWN, lattice.BLOCKED, lattice.COVERABLE], [lattice.COVERABLE] * 3], np.uint8
    )
    # A cell that became blocked after it was covered shows as blocked.
    visits = np.array([[0, 3, 0], [1, 2, 65535]], np.uint16)
    grid = OccupancyGrid(
        GridGeometry.of_cells(Window(-1, 2, 1, 5), 0.4),
        maps.coverage_values(states, visits),
        "floor",
        7,
    )
    assert grid.cells.tolist() == [[-1, 100, 0], [50, 75, 75]]
    assert (grid.frame, grid.stamp_ns) == ("floor", 7)
    assert grid.geometry.origin == Pose2D(0.8, -0.4)
    assert grid.geometry.resolution == 0.4
    again = decode_occupancy_grid(encode_occupancy_grid(grid))
    np.testing.assert_array_equal(again.cells, grid.cells)


@examples(150)
@given(trails)
def test_a_level_is_the_trail_to_half_a_step(trail: np.ndarray) -> None:
    message = decode_pheromone(encode_pheromone(snapshot(trail), "map", 1))
    present = trail > 0
    np.testing.assert_array_equal(message.levels > 0, present)
    again = message.trail()
    assert not again[~present].any()
    if not present.any():
        assert (message.trail_min, message.trail_max) == (0.0, 0.0)
        return
    assert (message.trail_min, message.trail_max) == (trail[present].min(), trail.max())
    step = math.log(message.trail_max / message.trail_min) / 254
    error = np.abs(np.log(again[present].astype(float)) - np.log(trail[present].astype(float)))
    assert error.max() <= step / 2 + 1e-5


def test_levels_span_the_scale() -> None:
    trail = np.array([[0.0, 1.0, 10.0, 100.0]], np.float32)
    message = decode_pheromone(encode_pheromone(snapshot(trail), "map", 1))
    assert message.levels.tolist() == [[0, 1, 128, 255]]
    even = decode_pheromone(encode_pheromone(snapshot(np.full((2, 2), 0.5, np.float32)), "m", 1))
    assert even.levels.tolist() == [[1, 1], [1, 1]]
    assert (even.trail() == 0.5).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_an_invalid_trail_is_not_sent(value: float) -> None:
    trail = np.array([[1.0, value]], np.float32)
    with pytest.raises(MalformedMessage, match="trail must be finite and not negative"):
        encode_pheromone(snapshot(trail), "map", 1)


def test_counts_must_fit() -> None:
    trail = np.ones((1, 1), np.float32)
    with pytest.raises(MalformedMessage, match="best_steps must be a uint32, got -1"):
        encode_pheromone(snapshot(trail, best_steps=-1), "map", 1)
    with pytest.raises(MalformedMessage, match="levels must be"):
        encode_pheromone(ColonySnapshot(Window(0, 0, 2, 2), 0.3, trail, 0, 1, 1, 1), "map", 1)


def test_directions_are_sent_to_a_twenty_fourth():
    pointed = np.array([[-1, 0, 1], [2, 3, 3]], np.int8)
    share = np.array([[0.0, 0.25, 1.0], [0.52, 0.7, 1.0]], np.float32)
    geometry = GridGeometry.of_cells(Window(-2, 4, 0, 7), 0.3)
    grid = OccupancyGrid(geometry, direction_values(pointed, share), "hall", 7)
    assert grid.cells.tolist() == [[-1, 6, 49], [62, 92, 99]]
    there = decode_occupancy_grid(encode_occupancy_grid(grid))
    assert (there.frame, there.stamp_ns) == ("hall", 7)
    np.testing.assert_array_equal(there.cells, grid.cells)
