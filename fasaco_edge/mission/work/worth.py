"""Worth: which floor is planned first, by priority, if time or battery do not allow all.

One plan covers the floor of all priorities that fit, so that its way is short; the rest follows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.floor_tiles import centres
from fasaco_edge.mission.orders.order import RoomArea, Zone
from fasaco_edge.mission.orders.zones import cells_of
from fasaco_edge.mission.rooms.room_raster import BLOCK

MOST_PRIORITY = 100
# Floor planned first may take this share of the time left, as lines are longer than estimated.
SHARE = 0.8


@lru_cache(maxsize=2)
def room_priorities(
    ranked: tuple[RoomArea, ...], others: int, window: Window, cell_m: float
) -> NDArray[np.uint8]:
    """Return the priority of each cell of a window, uint8 (rows, cols), read-only.

    ``others``: priority of cells outside the ranked rooms.
    """
    found = np.full((window.rows, window.cols), others, np.uint8)
    for room in ranked:
        found[cells_of(room.outline, room.holes, window, cell_m)] = room.priority
    found.flags.writeable = False
    return found


def least_priority(counts: NDArray[np.int64], cell_s: float, may_work_s: float) -> int:
    """Return the lowest priority that is planned first; 0 if all floor is planned.

    Args:
        counts: int64 (101,), number of cells of each priority.
        cell_s: time per cell [s].
        may_work_s: time left [s].
    """
    above = np.cumsum(counts[::-1])[::-1]
    levels = np.flatnonzero(counts)[1:]
    if above[0] * cell_s <= may_work_s or not levels.size:
        return 0
    fitting = levels[above[levels] * cell_s <= SHARE * may_work_s]
    return int(fitting[0] if fitting.size else levels[-1])


class WorthFirst:
    """Decides which cells of the present zone are planned first.

    Attributes:
        least: lowest priority of the cells planned now; 0 for all cells.
        may_work_s: time left until the robot has to turn back [s].
        given: priorities received as a message; None for none.
    """

    def __init__(
        self,
        cell_m: float,
        step_s: float,
        zone: Callable[[], Zone | None],
        frame: Callable[[], str],
    ) -> None:
        """Start without a limit; ``zone`` returns the present zone, ``frame`` the map's frame."""
        self.least = 0
        self.may_work_s = float("inf")
        self.given: OccupancyGrid | None = None
        self._cell_m, self._zone, self._frame = cell_m, zone, frame
        # The received priorities on the cells of a window, int8 (rows, cols); -1 for none.
        self._on_cells: tuple[Window, NDArray[np.int8]] | None = None
        # Lower bound of the time per cell [s], so that floor which fits is never put off.
        self._cell_s = step_s
        self._is_given_up = False

    def begin_pass(self) -> None:
        """Begin a pass with all floor."""
        self.least, self._is_given_up = 0, False

    def receive(self, given: OccupancyGrid | None) -> bool:
        """Take priorities from a message; return whether a new plan is needed.

        Equal priorities change nothing.
        """
        before = self.given
        if before is not None and given is not None:
            is_placed_alike = (before.geometry, before.frame) == (given.geometry, given.frame)
            if is_placed_alike and np.array_equal(before.cells, given.cells):
                return False
        self.given, self._on_cells = given, None
        return self.choose_again()

    def choose_again(self) -> bool:
        """Drop the choice; return whether a new plan is needed to choose again."""
        was_chosen, self.least = self.least > 0, 0
        return was_chosen

    def allow(self, seconds: float) -> None:
        """Note the time left until the robot has to turn back [s]."""
        self.may_work_s = seconds

    def give_up(self) -> None:
        """Plan all floor for the rest of this pass, as cells planned first cannot be reached."""
        self.least, self._is_given_up = 0, True

    def are_too_many(self, cells: int) -> bool:
        """Return whether the time left is too short for a number of cells."""
        return cells * self._cell_s > self.may_work_s

    def first(self, cells: NDArray[np.bool_], window: Window) -> NDArray[np.bool_]:
        """Return which of some cells, bool (rows, cols) of a window, are planned now."""
        priorities = self._priorities(window) if self.least else None
        return cells if priorities is None else cells & (priorities >= self.least)

    @property
    def is_limited(self) -> bool:
        """Whether time may be too short for all floor."""
        return self.least > 0 or self.may_work_s < float("inf")

    def choose(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Choose the next plan's cells among ``cells``, those still to cover, bool (rows, cols)."""
        is_alike = self._priorities(window) is None
        if is_alike or not self.first(cells, window).any():
            self.least = 0
        if not (is_alike or self.least):
            self.least = self._least_of(cells, window)

    def puts_other_first(self, cells: NDArray[np.bool_], window: Window, ahead_s: float) -> bool:
        """Choose again if the path ahead takes too long; return whether the choice changed.

        Args:
            cells: the cells to cover, bool (rows, cols) of the window.
            window: the lattice's window.
            ahead_s: time of the path ahead, which covers the cells planned now [s].
        """
        cells = self.first(cells, window)
        planned = int(np.count_nonzero(cells))
        if not planned or ahead_s <= self.may_work_s:
            return False
        least = self._least_of(cells, window, ahead_s / planned)
        if not least:
            return False
        self.least = least
        return True

    def _least_of(
        self, cells: NDArray[np.bool_], window: Window, cell_s: float | None = None
    ) -> int:
        priorities = None if self._is_given_up else self._priorities(window)
        if priorities is None:
            return 0
        found = priorities[cells]
        parts = np.array_split(found, 1 + found.size // BLOCK)
        counts: NDArray[np.int64] = np.sum(
            [np.bincount(part, minlength=MOST_PRIORITY + 1) for part in parts], axis=0
        )
        return least_priority(counts, cell_s or self._cell_s, self.may_work_s)

    def _priorities(self, window: Window) -> NDArray[np.uint8] | None:
        """Return the priority of each cell, uint8 (rows, cols); None if all are alike."""
        zone, on_cells = self._zone(), None
        if zone is not None and self.given is not None and self.given.frame == self._frame():
            on_cells = self._given_on(window, self.given)
        if zone is None or not (zone.ranked or on_cells is not None):
            return None
        rooms = room_priorities(zone.ranked, zone.worth, window, self._cell_m)
        return rooms if on_cells is None else np.where(on_cells < 0, rooms, on_cells.view(np.uint8))

    def _given_on(self, window: Window, given: OccupancyGrid) -> NDArray[np.int8]:
        if self._on_cells is None or self._on_cells[0] != window:
            # Computed in blocks of rows, as coordinates take far more memory than cells.
            on_cells = np.empty((window.rows, window.cols), np.int8)
            for part in window.strips(BLOCK):
                values = given.geometry.values_at(given.cells, centres(part, self._cell_m), -1)
                on_cells[part.slices_in(window)] = values.reshape(part.rows, part.cols)
            self._on_cells = window, on_cells
        return self._on_cells[1]
