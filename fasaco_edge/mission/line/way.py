"""Way: a line that only leads somewhere, with as few corners as the floor allows.

A walk over cells is a staircase wherever it leads across their rows: a robot that turns on the spot
needs twice as long for its corners as for its length.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.floor.turning import turn_seconds
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.line.pieces import Points

# A point is connected straight to one of so many next ones, the farthest possible: each is a corner
# of the walk, so this spans a hall.
MOST_SKIPPED = 40


def is_clear_between(floor: FloorMap, a: Points, b: Points) -> bool:
    """Tell whether the robot can drive straight between two points, (2,): y, x [pixels]."""
    if math.isnan(b[0]):
        return False
    radius = floor.discs.radius_m / floor.geometry.resolution
    return bool(is_clear(floor.blocked, a[0], a[1], b[0], b[1], radius))


def shortened(points: Points, floor: FloorMap) -> NDArray[np.intp]:
    """Return the indices of the points of a way that skips corners wherever the floor is clear.

    Args:
        points: float64 (n, 2), n >= 1: y, x [pixels]; from each to the next one it is clear.
        floor: the floor.
    """
    kept, last = [0], len(points) - 1
    while kept[-1] < last:
        at = kept[-1]
        farthest = min(at + MOST_SKIPPED, last)
        while farthest > at + 1 and not is_clear_between(floor, points[at], points[farthest]):
            farthest -= 1
        kept.append(farthest)
    return np.array(kept, np.intp)


def way_s(walk: NDArray[np.int32], pose: Pose2D, floor: FloorMap, sweeping: Sweeping) -> float:
    """Return how long the way along a walk takes [s].

    Counted with a half turn at each of its ends: the robot may face away from it, and from the
    heading that it ends with.

    Args:
        walk: int32 (n, 2), n >= 1, cells (row, col), each a legal step from the previous one.
        pose: of the robot, in or near the first cell.
        floor, sweeping: of the mission.
    """
    points, _ = floor.stands.line(walk)
    here = np.array(map_to_raster(floor.geometry, pose.x, pose.y))
    points = np.concatenate([here[None], points])
    edges = np.diff(points[shortened(points, floor)], axis=0)
    way_m = float(np.hypot(*edges.T).sum()) * floor.geometry.resolution
    headings = np.arctan2(*edges.T)
    turns = np.abs((np.diff(headings) + math.pi) % math.tau - math.pi)
    turning = sweeping.line.turning
    turning_s = sum(turn_seconds(turning, turn) for turn in (*turns.tolist(), math.pi, math.pi))
    return way_m / sweeping.line.speed_m_s + turning_s
