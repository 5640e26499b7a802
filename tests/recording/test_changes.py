"""Where a map contradicts the one before, in metres, whatever its origin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording.scene.layers import changed_bounds


def grid(cells, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> OccupancyGrid:
    cells = np.asarray(cells, np.int8)
    return OccupancyGrid(GridGeometry(*cells.shape, 0.1, Pose2D(x, y, yaw)), cells)


def test_a_new_obstacle_is_found_where_it_is():
    before, after = np.zeros((6, 8)), np.zeros((6, 8))
    after[2:4, 5] = 100
    bounds = changed_bounds(grid(before, 1.0, -2.0), grid(after, 1.0, -2.0))
    assert bounds == pytest.approx((1.5, -1.8, 1.6, -1.6))


@given(st.integers(0, 3), st.integers(0, 3))
def test_growth_of_the_map_is_no_change(rows, cols):
    before = np.zeros((4, 4))
    after = np.zeros((4 + rows, 4 + cols))
    after[0, 0] = 100
    assert changed_bounds(grid(before), grid(after, -0.1 * cols, -0.1 * rows)) == (
        None if rows or cols else pytest.approx((0.0, 0.0, 0.1, 0.1))
    )


def test_exploration_and_noise_are_no_changes():
    before = grid([[-1, 0, 100, 60]])
    after = grid([[100, 20, 80, -1]])
    assert changed_bounds(before, after) is None


@pytest.mark.parametrize(
    "other",
    [
        grid(np.full((4, 4), 100), yaw=0.1),
        grid(np.full((4, 4), 100), x=0.05),
        grid(np.full((4, 4), 100), x=5.0),
    ],
)
def test_other_rasters_are_not_compared(other):
    assert changed_bounds(grid(np.zeros((4, 4))), other) is None
