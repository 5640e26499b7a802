"""Bounds of what is known of a map, and of several things together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fasaco_edge.grid import occupancy
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, union_bounds
from fasaco_edge.grid.occupancy import OccupancyGrid, known_bounds


def grid(cells, yaw: float = 0.0) -> OccupancyGrid:
    cells = np.asarray(cells, np.int8)
    return OccupancyGrid(GridGeometry(*cells.shape, 0.1, Pose2D(0.0, 0.0, yaw)), cells)


@pytest.mark.parametrize("block", [1, 12, 1_000_000])
def test_known_bounds_follow_the_map_when_it_is_turned(monkeypatch, block):
    monkeypatch.setattr(occupancy, "BLOCK_PIXELS", block)
    cells = np.full((4, 6), -1)
    cells[1:3, 2:5] = 0
    assert known_bounds(grid(cells)) == pytest.approx((0.2, 0.1, 0.5, 0.3))
    assert known_bounds(grid(cells, math.pi / 2)) == pytest.approx((-0.3, 0.2, -0.1, 0.5))
    assert known_bounds(grid(np.full((4, 6), -1))) is None


def test_union_holds_all_parts():
    assert union_bounds() is union_bounds(None) is None
    assert union_bounds(None, (0.0, 0.0, 1.0, 1.0)) == (0.0, 0.0, 1.0, 1.0)
    one, other = (0.0, -1.0, 1.0, 1.0), (-2.0, 0.0, 0.5, 3.0)
    assert union_bounds(one, other) == (-2.0, -1.0, 1.0, 3.0)
