"""A floor plan from rooms and furniture, in metres of the map frame.

Rooms are given as free areas. Walls follow from them: what borders on a free area is
wall, what lies beyond is unknown, as a laser scanner at ankle height leaves it. So a
table is four legs, and the inside of a cabinet is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

RESOLUTION = 0.05
WALL = 0.15
SHELL = 0.1
LEG = 0.05

Point = tuple[float, float]


class Floor:
    """A floor plan under construction, over x0..x1 by y0..y1 [m]."""

    def __init__(self, x0: float, y0: float, x1: float, y1: float) -> None:
        rows, cols = round((y1 - y0) / RESOLUTION), round((x1 - x0) / RESOLUTION)
        self._origin = Pose2D(x0, y0)
        self._cells = np.full((rows, cols), UNKNOWN, np.int8)
        self._x = x0 + (np.arange(cols) + 0.5) * RESOLUTION
        self._y = y0 + (np.arange(rows) + 0.5)[:, None] * RESOLUTION

    def room(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Free a rectangle: a room, a passage, a door."""
        self._cells[self._inside([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])] = FREE

    def hall(self, *corners: Point) -> None:
        """Free a polygon."""
        self._cells[self._inside(corners)] = FREE

    def walls(self) -> None:
        """Raise the walls around all that is free so far."""
        free = self._cells == FREE
        wall = np.zeros_like(free)
        reach = round(WALL / RESOLUTION)
        for down in range(-reach, reach + 1):
            for right in range(-reach, reach + 1):
                wall |= _moved(free, down, right)
        self._cells[wall & ~free] = OCCUPIED

    def block(self, x: float, y: float, width: float, depth: float, turn: float = 0.0) -> None:
        """Put a solid thing at its centre (x, y), turned by degrees; unknown inside."""
        self._cells[self._inside(_turned(x, y, width, depth, turn))] = OCCUPIED
        if min(width, depth) > 3 * SHELL:
            core = _turned(x, y, width - 2 * SHELL, depth - 2 * SHELL, turn)
            self._cells[self._inside(core)] = UNKNOWN

    def legs(self, x: float, y: float, width: float, depth: float, turn: float = 0.0) -> None:
        """Put the four legs of a table or chair with centre (x, y), turned by degrees."""
        for leg_x, leg_y in _turned(x, y, width - LEG, depth - LEG, turn):
            self.block(leg_x, leg_y, LEG, LEG)

    def round(self, x: float, y: float, radius: float) -> None:
        """Put a round thing at (x, y); unknown inside."""
        distance = np.hypot(self._x - x, self._y - y)
        self._cells[distance <= radius] = OCCUPIED
        self._cells[distance <= radius - 2 * SHELL] = UNKNOWN

    def grid(self) -> OccupancyGrid:
        """Return the map."""
        rows, cols = self._cells.shape
        return OccupancyGrid(GridGeometry(rows, cols, RESOLUTION, self._origin), self._cells)

    def _inside(self, corners: Iterable[Point]) -> NDArray[np.bool_]:
        """Return which pixel centres lie inside a polygon, by the even-odd rule."""
        corners = list(corners)
        inside = np.zeros(self._cells.shape, bool)
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            if ay == by:
                continue
            crosses = (ay > self._y) != (by > self._y)
            inside ^= crosses & (self._x < ax + (self._y - ay) * (bx - ax) / (by - ay))
        return inside


def _turned(x: float, y: float, width: float, depth: float, degrees: float) -> list[Point]:
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    half = [(width / 2 * u, depth / 2 * v) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in half]


def _moved(mask: NDArray[np.bool_], down: int, right: int) -> NDArray[np.bool_]:
    moved = np.zeros_like(mask)
    rows, cols = mask.shape
    moved[max(down, 0) : rows + min(down, 0), max(right, 0) : cols + min(right, 0)] = mask[
        max(-down, 0) : rows - max(down, 0), max(-right, 0) : cols - max(right, 0)
    ]
    return moved
