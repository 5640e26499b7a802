"""A building to publish: halls of ten metres with doors, 50 m x 50 m as it comes from SLAM."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid

RESOLUTION_M = 0.05
HALL_PX, WALL_PX, DOOR_PX, CRATE_PX = 200, 4, 30, 16
# A crate further along each time, by less than its own width and back again.
CRATE_PLACES, CRATE_STEP_PX = 12, 12


def building(side_px: int = 1000) -> OccupancyGrid:
    """Return a fully known building of ``side_px`` x ``side_px`` pixels of 0.05 m."""
    cells = np.full((side_px, side_px), FREE, np.int8)
    walls = range(0, side_px, HALL_PX)
    for wall in walls:
        cells[wall : wall + WALL_PX] = OCCUPIED
        cells[:, wall : wall + WALL_PX] = OCCUPIED
    for wall in walls[1:]:
        for hall in walls:
            door = slice(hall + (HALL_PX - DOOR_PX) // 2, hall + (HALL_PX + DOOR_PX) // 2)
            cells[wall : wall + WALL_PX, door] = FREE
            cells[door, wall : wall + WALL_PX] = FREE
    cells[-WALL_PX:] = cells[:, -WALL_PX:] = OCCUPIED
    geometry = GridGeometry(side_px, side_px, RESOLUTION_M, Pose2D(0.0, 0.0))
    return OccupancyGrid(geometry, cells)


def with_crate(grid: OccupancyGrid, number: int, stamp_ns: int) -> OccupancyGrid:
    """Return the building with a crate in the hall farthest from the robot.

    Crates of successive numbers stand at different places, so that each map gains
    and loses coverable cells against the one before.
    """
    side = grid.geometry.rows
    row, col = side - HALL_PX // 2, side - HALL_PX + 2 * CRATE_PX
    col += CRATE_STEP_PX * (number % CRATE_PLACES)
    cells = grid.cells.copy()
    cells[row : row + CRATE_PX, col : col + CRATE_PX] = OCCUPIED
    return replace(grid, cells=cells, stamp_ns=stamp_ns)


def robot_pose(stamp_ns: int) -> StampedPose:
    """Return a robot that stands in the building's first hall."""
    return StampedPose(Pose2D(2.5, 2.5), stamp_ns=stamp_ns)
