"""A tool wider than the robot sweeps nothing behind walls."""

import math

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.coverage.swept_floor import SweptFloor
from fasaco_edge.mission.coverage.tool_sight import ToolSight
from tests.grid.test_tool_reach import RADIUS_M, two_rooms

TOOL_M = 1.2
# The wall between the rooms begins here [m].
WALL_M = 2.05


def swept_by(poses, grid, radius_m=RADIUS_M):
    floor = SweptFloor(TOOL_M, ToolSight(TOOL_M, radius_m, 25, lambda: grid))
    for x, y in poses:
        floor.record(Pose2D(x, y, 0.0))
    return floor


def mask_of(floor):
    return floor.swept_in(Window(0, 0, math.ceil(2.2 / PIXEL_M), math.ceil(4.2 / PIXEL_M)))


def test_the_floor_behind_a_thin_wall_is_not_swept():
    along = [(1.7, 0.5 + 0.02 * step) for step in range(50)]
    swept = mask_of(swept_by(along, two_rooms()))
    cols = np.flatnonzero(swept.any(axis=0))
    assert cols.max() * PIXEL_M < WALL_M
    # On its own side it reaches as far as its tool.
    assert cols.min() * PIXEL_M == pytest.approx(1.7 - 0.6, abs=0.03)
    # With no map nothing is known of walls: the robot's disc alone counts.
    cols = np.flatnonzero(mask_of(swept_by(along, None)).any(axis=0))
    assert cols.min() * PIXEL_M == pytest.approx(1.7 - RADIUS_M, abs=0.03)


def test_away_from_walls_all_under_the_tool_is_swept():
    along = [(0.9 + 0.02 * step, 1.0) for step in range(20)]
    with_sight = swept_by(along, two_rooms())
    without = SweptFloor(TOOL_M)
    for x, y in along:
        without.record(Pose2D(x, y, 0.0))
    assert (mask_of(with_sight) == mask_of(without)).all()
