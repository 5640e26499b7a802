"""Missed floor: floor worth coming back for at the end of a path, and floor out of reach."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.kernels.floor.bits import WORD, unpacked
from fasaco_edge.planners.line import LineConfig


@dataclass(frozen=True, slots=True)
class MissedFloor:
    """Cost of driving back to cells, and worth of their floor.

    Attributes:
        speed_m_s: speed of the robot [m/s].
        price_s_m2: worth of floor [s/m2].
        least_s: least worth of floor to drive back for, without the way there [s].
    """

    speed_m_s: float
    price_s_m2: float
    least_s: float

    @classmethod
    def at(cls, line: LineConfig, least_s: float) -> Self:
        """Return the costs for the speed and price of a line."""
        return cls(line.speed_m_s, line.price_s_m2, least_s)

    def worth_the_way(
        self,
        areas_m2: dict[Cell, float],
        here: Cell,
        cell_m: float,
        may_take: Callable[[Cell], bool],
    ) -> list[Cell]:
        """Return the cells whose floor is worth driving to, and through them.

        Cells side by side are taken together or not at all. The nearest come first, and each way
        starts at the cells taken before.

        Args:
            areas_m2: floor left in each cell [m2].
            here: the robot's cell.
            cell_m: edge of a cell [m].
            may_take: whether a cell worth driving through may be taken.
        """
        step_s = cell_m / self.speed_m_s
        gains_s = {cell: self.price_s_m2 * m2 - step_s for cell, m2 in areas_m2.items()}
        worth = {cell for cell, gain_s in gains_s.items() if gain_s > 0.0 and may_take(cell)}
        pieces, taken = _pieces(worth), list[Cell]()
        while pieces:
            nearest = min(pieces, key=lambda piece: min(_apart(here, cell) for cell in piece))
            pieces.remove(nearest)
            at = min(nearest, key=lambda cell: (_apart(here, cell), cell))
            way_s = step_s * _apart(here, at)
            if sum(gains_s[cell] for cell in nearest) >= self.least_s + way_s:
                taken += nearest
                here = at
        return taken


def _apart(one: Cell, other: Cell) -> float:
    return math.dist(one, other)


def _pieces(cells: set[Cell]) -> list[list[Cell]]:
    """Return cells in pieces that are connected by edges or corners."""
    rest, pieces = set(cells), []
    while rest:
        piece = [rest.pop()]
        for row, col in piece:
            near = {(row + i, col + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & rest
            rest -= near
            piece += sorted(near)
        pieces.append(sorted(piece))
    return sorted(pieces)


class Cause(IntEnum):
    """Why the tool cannot reach a pixel; 0 if it can, or if the pixel is not free."""

    NARROW = 1
    CLOSED = 2
    KEPT_OUT = 3


REASONS = {
    Cause.NARROW: "too narrow for the robot, or too near to a wall or to furniture",
    Cause.CLOSED: "closed off: no way leads there that the robot fits through",
    Cause.KEPT_OUT: "in a keep-out zone, or too near to one",
}


def causes_of(
    floor: FloorMap, free: FloorMap, reachable: NDArray[np.bool_], part: Window
) -> NDArray[np.uint8]:
    """Return the cause of each pixel in a window of the raster, uint8 (rows, cols).

    Args:
        floor: the floor with keep-out zones.
        free: the floor of the same map without; the same object if there are none.
        reachable: bool (rows, cols) of the lattice, the reachable cells.
        part: window of the raster.
    """
    anywhere = floor.stands.lattice.coverable
    fits = floor.reached(anywhere, part)
    fits_free = fits if free is floor else free.reached(free.stands.lattice.coverable, part)
    first, end = part.col0 // WORD, -(-part.col1 // WORD)
    words = unpacked(free.blocked[part.row0 : part.row1, first:end], (end - first) * WORD)
    is_free = ~words[:, part.col0 - first * WORD : part.col1 - first * WORD]
    causes = np.full(fits.shape, Cause.NARROW, np.uint8)
    causes[fits_free] = Cause.KEPT_OUT
    causes[fits] = 0
    if (anywhere & ~reachable).any():
        causes[fits & ~floor.reached(reachable, part)] = Cause.CLOSED
    causes[~is_free] = 0
    return causes
