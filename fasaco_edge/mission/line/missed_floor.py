"""Missed floor: which of the floor left at the end of a path is worth coming back for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from fasaco_edge.grid.lattice import Cell
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
        """Return it for the speed and price of a line."""
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
    """Return cells in pieces that hang together by edges or corners."""
    rest, pieces = set(cells), []
    while rest:
        piece = [rest.pop()]
        for row, col in piece:
            near = {(row + i, col + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & rest
            rest -= near
            piece += sorted(near)
        pieces.append(sorted(piece))
    return sorted(pieces)
