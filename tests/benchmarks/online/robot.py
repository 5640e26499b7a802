"""A robot that drives its path cell by cell, and turns on the spot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.planners.cost import CoverageCost
from tests.benchmarks.online.sight import Point, Sight

NEAR_PX = 1e-6


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast the robot is: straight on [m/s], and for a quarter-turn [s]."""

    speed_m_s: float
    turn_s: float

    def cost(self, cell_m: float, *, with_turns: bool) -> CoverageCost:
        """Return what walks cost over cells of ``cell_m`` [m]: time, or steps alone."""
        if not with_turns:
            return CoverageCost()
        return CoverageCost.for_robot(cell_m, self.speed_m_s, self.turn_s)

    def seconds(self, metres: float, quarters: float) -> float:
        """Return the time for a way with turns [s]."""
        return metres / self.speed_m_s + quarters * self.turn_s


@dataclass(frozen=True, slots=True)
class Leg:
    """The way to the next waypoint.

    Attributes:
        end: where it leads [pixels].
        distance_m: how far that is [m].
        quarters: how far the robot turns before it, in quarter-turns.
    """

    end: Point
    distance_m: float
    quarters: float


class Robot:
    """A robot on the path it was given last.

    Attributes:
        at: where it is in truth [pixels].
        trail: where it has been: the start, and the end of every leg.
        times: when it was there [s].
        metres, quarters: what it has driven and turned.
    """

    def __init__(self, at: Point, cell_m: float) -> None:
        self.at = at
        self.trail = [at]
        self.times = [0.0]
        self.metres = self.quarters = 0.0
        self._cell_m = cell_m
        self._heading: Point | None = None
        self._path = np.empty((0, 2), np.int32)
        # Of the path's cells, how many are behind; that before them is where the robot is.
        self._behind = 0

    def follow(self, path: NDArray[np.int32]) -> None:
        """Drive along ``path``, cells int32 (n, 2), from now on; an empty one halts."""
        self._path, self._behind = path, 0

    @property
    def ahead(self) -> NDArray[np.int32]:
        """The path from the robot's cell on, int32 (n, 2)."""
        return self._path[max(self._behind - 1, 0) :]

    def pose(self, sight: Sight) -> Pose2D:
        """Return where the robot is in its map."""
        along = self._heading or (1.0, 0.0)
        return sight.pose_of(self.at, math.atan2(along[1], along[0]))

    def next_leg(self, sight: Sight) -> Leg | None:
        """Return the way to the next waypoint; None at the path's end."""
        while self._behind < len(self._path):
            end = self._waypoint(sight, *self._path[self._behind].tolist())
            distance = math.dist(self.at, end)
            if distance > NEAR_PX:
                metres = distance * sight.geometry.resolution
                return Leg(end, metres, self._quarters_to(end))
            self._behind += 1
        return None

    def drive(self, leg: Leg, arrival_s: float) -> None:
        """Come to the end of a leg."""
        self._heading = _direction(self.at, leg.end)
        self.at = leg.end
        self._behind += 1
        self.trail.append(leg.end)
        self.times.append(arrival_s)
        self.metres += leg.distance_m
        self.quarters += leg.quarters

    def _waypoint(self, sight: Sight, row: int, col: int) -> Point:
        return sight.point_of((col + 0.5) * self._cell_m, (row + 0.5) * self._cell_m)

    def _quarters_to(self, end: Point) -> float:
        # How it stands in the beginning is nobody's merit.
        if self._heading is None:
            return 0.0
        (x, y), (to_x, to_y) = self._heading, _direction(self.at, end)
        turn = math.atan2(x * to_y - y * to_x, x * to_x + y * to_y)
        return abs(turn) / (0.5 * math.pi)


def cells_of(points: list[Point], sight: Sight, cell_m: float) -> NDArray[np.int32]:
    """Return the lattice cells that points [pixels] lie in, int32 (n, 2)."""
    places = [sight.geometry.to_map(*point) for point in points]
    cells: list[Cell] = [(math.floor(y / cell_m), math.floor(x / cell_m)) for x, y in places]
    return np.array(cells, np.int32)


def _direction(start: Point, end: Point) -> Point:
    length = math.dist(start, end)
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length
