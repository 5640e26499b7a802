"""Left floor: cells that the robot has passed with floor unswept, and those it has to come back to.

What the line ahead sweeps is not left; but another line may not sweep it, so such cells are looked
at again and again until their floor is swept. The robot comes back to all of them on its way, and
at last to those that are worth the way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell, mask_of
from fasaco_edge.mission.map.reachable_area import ReachableArea

# Limit on the cells kept: the oldest are dropped.
MOST_PASSED = 2_000
# The turns on the way to left floor [s].
TURNS_S = 4.0


@dataclass(frozen=True, slots=True)
class WayBack:
    """The way of a robot without other work to left floor.

    Attributes:
        area: where it can drive.
        cell: where it is.
        step_s: time of a step [s].
    """

    area: ReachableArea
    cell: Cell
    step_s: float

    def is_worth(self, group: list[Cell], worth_s: float) -> bool:
        """Tell whether the floor of adjacent cells is worth the way to them and along them [s]."""
        most = (worth_s - TURNS_S) / self.step_s - (len(group) - 1)
        row, col = self.cell
        nearest = min(group, key=lambda cell: abs(cell[0] - row) + abs(cell[1] - col))
        # Past walls the way is longer than that.
        if abs(nearest[0] - row) + abs(nearest[1] - col) > most:
            return False
        way = self.area.shortest_path(self.cell, nearest)
        return 0 < len(way) <= most + 1


class LeftFloor:
    """Passed cells with unswept floor.

    Attributes:
        worth_s: those with floor that the line ahead does not sweep either: what it is worth [s].
        chosen: those of them to come back to.
    """

    def __init__(self) -> None:
        self.worth_s: dict[Cell, float] = {}
        self.chosen: set[Cell] = set()
        # In the order in which they were looked at last.
        self._passed: dict[Cell, None] = {}
        # Those left at the last end of a path; and those that the robot does not come back to.
        self._aimed: set[Cell] = set()
        self._tried: set[Cell] = set()

    def clear(self) -> None:
        """Forget all of them."""
        for cells in (self.worth_s, self.chosen, self._aimed, self._tried, self._passed):
            cells.clear()

    def note_passed(self, cell: Cell) -> None:
        """Note that the robot has passed a cell; one that it came back to is done with."""
        if cell in self.chosen:
            self.give_up((cell,))
        elif cell not in self._tried:
            self._passed[cell] = None
            if len(self._passed) > MOST_PASSED:
                self.drop(next(iter(self._passed)))

    def note_path_end(self) -> None:
        """Give up the cells that a whole path did not lead back to."""
        self.give_up(self.chosen & self._aimed)
        self._aimed = set(self.chosen)

    def give_up(self, cells: Iterable[Cell]) -> None:
        """Come back to some cells no more."""
        for cell in tuple(cells):
            self.drop(cell)
            self._tried.add(cell)

    def next(self, most: int) -> list[Cell]:
        """Return the cells to be looked at now: those that were not for longest."""
        cells = list(self._passed)[:most]
        for cell in cells:
            del self._passed[cell]
            self._passed[cell] = None
        return cells

    def note_left(self, cell: Cell, worth_s: float) -> None:
        """Note what the floor of a cell is worth that the line ahead leaves [s]; 0 for none."""
        if worth_s > 0.0:
            self.worth_s[cell] = worth_s
        else:
            self._forget_left(cell)

    def choose(self, way: WayBack | None) -> None:
        """Choose what to come back to.

        Args:
            way: the way to it, which groups of adjacent cells have to be worth; None for all.
        """
        if way is None:
            self.chosen = set(self.worth_s)
            return
        self.chosen = set()
        for group in self._groups():
            if way.is_worth(group, sum(self.worth_s[cell] for cell in group)):
                self.chosen.update(group)

    def _groups(self) -> Iterator[list[Cell]]:
        left = set(self.worth_s)
        for first in self.worth_s:
            if first not in left:
                continue
            group = [first]
            left.remove(first)
            for row, col in group:
                around = ((row + up, col + right) for up in (-1, 0, 1) for right in (-1, 0, 1))
                beside = [cell for cell in around if cell in left]
                group += beside
                left.difference_update(beside)
            yield group

    def drop(self, cell: Cell) -> None:
        """Forget a cell: its floor is swept."""
        self._passed.pop(cell, None)
        self._forget_left(cell)

    def _forget_left(self, cell: Cell) -> None:
        self.worth_s.pop(cell, None)
        self.chosen.discard(cell)

    def passed_in(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window are such passed cells, bool (rows, cols)."""
        return mask_of(self._passed, window)

    def chosen_in(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window it has to come back to, bool (rows, cols)."""
        return mask_of(self.chosen, window)
