"""Obstacles missing on the map: a follower reports them, and their floor is closed for some time.

Closed floor is occupied on the mission's map, so plans keep the same clearance from it as from
walls; the robot's own place stays free. As people walk away and doors open, the floor is opened
after 20 s, and after twice as long each time an obstacle is reported there again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point
from fasaco_edge.grid.occupancy import OCCUPIED, OccupancyGrid

# Floor is closed for CLOSED_S, twice as long each further time, up to MOST_CLOSED_S [s].
CLOSED_S, MOST_CLOSED_S = 20.0, 320.0
# Reports within SAME_M [m] mean the same obstacle. It is forgotten FORGET_S [s] after its floor was
# opened.
SAME_M, FORGET_S = 0.5, 600.0
# A follower that still reports the obstacle after WIDEN_AFTER_S [s] cannot drive the new path
# either: the floor is closed wider by WIDER_M [m], up to MOST_WIDER times.
WIDEN_AFTER_S, WIDER_M, MOST_WIDER = 3.0, 0.05, 4
# An obstacle is taken to be DEEP_M deep, away from the robot, with points every SPACING_M. The
# follower keeps MARGIN_M away from it. A ring of FREE_M around the robot's disc stays free [m].
DEEP_M, SPACING_M, MARGIN_M, FREE_M = 0.3, 0.05, 0.06, 0.01
# Largest map on which obstacles are drawn [pixels]: such a map is kept twice (``daemon.memory``).
MOST_PIXELS = 6_000_000
# The newest MOST obstacles are kept, each with up to MOST_POINTS.
MOST, MOST_POINTS = 32, 192


@dataclass(frozen=True, slots=True)
class _Obstacle:
    """An obstacle.

    Attributes:
        points: points seen of it, the nearest first [m].
        here: the robot's position at that time [m].
        at, until: times at which its floor is closed and opened [s].
        times: number of separate times that its floor was closed.
        wider: number of times that the closed floor was widened.
    """

    points: tuple[Point, ...]
    here: Point
    at: float
    until: float
    times: int
    wider: int


class Obstacles:
    """Keeps obstacles, and draws them on maps.

    Args:
        radius_m: radius of the robot's disc [m].
    """

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._closed: list[_Obstacle] = []
        self._past: list[_Obstacle] = []

    @property
    def closed(self) -> int:
        """Number of obstacles whose floor is closed now."""
        return len(self._closed)

    def close(self, points: Sequence[Point], here: Point, now: float) -> bool:
        """Close the floor at some points; return whether closed floor has changed.

        Args:
            points: points seen, the nearest first [m].
            here: the robot's position [m].
            now: the time [s].
        """
        if not points:
            return False
        same = [one for one in self._closed if _is_same(one, points[0])]
        if any(now - one.at < WIDEN_AFTER_S for one in same):
            return False
        past = [one for one in self._past if _is_same(one, points[0])]
        times = max([1, *(one.times for one in same), *(one.times + 1 for one in past)])
        wider = min(max((one.wider + 1 for one in same), default=0), MOST_WIDER)
        until = now + min(CLOSED_S * 2.0 ** (times - 1), MOST_CLOSED_S)
        self._past = [one for one in self._past if one not in past]
        kept = [one for one in self._closed if one not in same]
        seen = tuple(points) + tuple(point for one in same for point in one.points)
        self._closed = [*kept, _Obstacle(seen[:MOST_POINTS], here, now, until, times, wider)]
        self._closed = self._closed[-MOST:]
        return True

    def open_due(self, now: float) -> bool:
        """Open floor when its time is up; return whether any was opened."""
        self._past = [one for one in self._past if now - one.until < FORGET_S][-MOST:]
        due = [one for one in self._closed if now >= one.until]
        if due:
            self._closed = [one for one in self._closed if one not in due]
            self._past += due
        return bool(due)

    def on(self, grid: OccupancyGrid) -> OccupancyGrid:
        """Return a map with the obstacles drawn; a map that is too large stays as it is."""
        if not self._closed or grid.cells.size > MOST_PIXELS:
            return grid
        cells = grid.cells.copy()
        for obstacle in self._closed:
            self._draw(obstacle, grid, cells)
        return replace(grid, cells=cells)

    def _draw(self, obstacle: _Obstacle, grid: OccupancyGrid, cells: NDArray[np.int8]) -> None:
        geometry, (x, y) = grid.geometry, obstacle.here
        deep = np.arange(0.0, DEEP_M + 1e-9, SPACING_M)[:, None]
        points = np.array(obstacle.points)
        away = points - (x, y)
        lengths = np.maximum(np.hypot(*away.T), 1e-9)[:, None]
        spots = (points + deep[:, :, None] * (away / lengths)).reshape(-1, 2)
        col, row = geometry.to_pixels(spots[:, 0], spots[:, 1])
        far = (MARGIN_M + obstacle.wider * WIDER_M) / geometry.resolution
        row0, row1 = max(math.floor(row.min() - far), 0), math.ceil(row.max() + far) + 1
        col0, col1 = max(math.floor(col.min() - far), 0), math.ceil(col.max() + far) + 1
        part = cells[row0:row1, col0:col1]
        if not part.size:
            return
        rows, cols = np.mgrid[row0 : row0 + part.shape[0], col0 : col0 + part.shape[1]] + 0.5
        near = np.zeros(part.shape, bool)
        for at_row, at_col in zip(row, col, strict=True):
            near |= np.hypot(rows - at_row, cols - at_col) <= far + 0.5
        my_col, my_row = geometry.to_pixels(x, y)
        clear = (self._radius_m + FREE_M) / geometry.resolution + math.sqrt(0.5)
        part[near & (np.hypot(rows - my_row, cols - my_col) >= clear)] = OCCUPIED


def _is_same(obstacle: _Obstacle, point: Point) -> bool:
    return math.dist(obstacle.points[0], point) <= SAME_M
