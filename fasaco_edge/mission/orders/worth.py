"""Worth: which floor is planned first where time or battery do not allow all, by its priority.

Floor of the priorities that fit is one plan, so that its way is short; the rest comes after it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.map.room_raster import BLOCK, centres
from fasaco_edge.mission.orders.order import RoomArea, Zone
from fasaco_edge.mission.orders.zones import cells_of

MOST_PRIORITY = 100
# Share of the time left that floor planned first may take, as lines are longer than estimated.
SHARE = 0.8


@lru_cache(maxsize=2)
def room_priorities(
    ranked: tuple[RoomArea, ...], others: int, window: Window, cell_m: float
) -> NDArray[np.uint8]:
    """Return the priority of each cell of a window by its room, uint8 (rows, cols), read-only;
    ``others`` is that of other rooms."""
    found = np.full((window.rows, window.cols), others, np.uint8)
    for room in ranked:
        found[cells_of(room.outline, room.holes, window, cell_m)] = room.priority
    found.flags.writeable = False
    return found


def least_priority(counts: NDArray[np.int64], cell_s: float, may_work_s: float) -> int:
    """Return the priority from which on floor is planned first; 0 for all of it.

    Args:
        counts: int64 (101,), number of cells of each priority.
        cell_s: time that a cell takes [s].
        may_work_s: time left [s].
    """
    above = np.cumsum(counts[::-1])[::-1]
    levels = np.flatnonzero(counts)[1:]
    if above[0] * cell_s <= may_work_s or not levels.size:
        return 0
    fitting = levels[above[levels] * cell_s <= SHARE * may_work_s]
    return int(fitting[0] if fitting.size else levels[-1])


class WorthFirst:
    """Decides which cells of the present zone are planned first; owns that decision.

    Attributes:
        least: priority from which on cells are planned now; 0 for all.
        may_work_s: time left until the robot has to turn back [s].
        given: the priorities that came as a message; None for none.
    """

    def __init__(
        self,
        cell_m: float,
        step_s: float,
        zone: Callable[[], Zone | None],
        frame: Callable[[], str],
    ) -> None:
        """Start without a limit; ``zone`` and ``frame`` return the zone being covered, and the
        frame of the map."""
        self.least = 0
        self.may_work_s = float("inf")
        self.given: OccupancyGrid | None = None
        self._cell_m, self._zone, self._frame = cell_m, zone, frame
        # The priorities given by a message on the cells of a window, int8; -1 for none.
        self._on_cells: tuple[Window, NDArray[np.int8]] | None = None
        # The least time that a cell takes, by which too much is never put off [s].
        self._cell_s = step_s
        self._is_given_up = False

    def begin(self) -> None:
        """Note that a pass begins."""
        self.least, self._is_given_up = 0, False

    def take(self, given: OccupancyGrid | None) -> bool:
        """Take priorities from a message; return whether a new plan has to follow them.

        The same ones again change nothing.
        """
        before = self.given
        if before is not None and given is not None:
            is_placed_alike = (before.geometry, before.frame) == (given.geometry, given.frame)
            if is_placed_alike and np.array_equal(before.cells, given.cells):
                return False
        self.given, self._on_cells = given, None
        return self.choose_anew()

    def choose_anew(self) -> bool:
        """Choose with the next plan what comes first; return whether a plan is wanted for that."""
        was_chosen, self.least = self.least > 0, 0
        return was_chosen

    def allow(self, seconds: float) -> None:
        """Note the time left until the robot has to turn back [s]."""
        self.may_work_s = seconds

    def give_up(self) -> None:
        """Plan all floor of this pass from now on: cells of those planned first are not reached."""
        self.least, self._is_given_up = 0, True

    def are_too_many(self, cells: int) -> bool:
        """Return whether there is no time for a number of cells."""
        return cells * self._cell_s > self.may_work_s

    def first(self, cells: NDArray[np.bool_], window: Window) -> NDArray[np.bool_]:
        """Return which of some cells, bool (rows, cols) of a window, are planned now."""
        priorities = self._priorities(window) if self.least else None
        return cells if priorities is None else cells & (priorities >= self.least)

    @property
    def is_limited(self) -> bool:
        """Whether there may be something to choose."""
        return self.least > 0 or self.may_work_s < float("inf")

    def choose(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Choose what the next plan covers of the cells that can be, bool (rows, cols)."""
        is_alike = self._priorities(window) is None
        if is_alike or not self.first(cells, window).any():
            self.least = 0
        if not (is_alike or self.least):
            self.least = self._least_of(cells, window)

    def is_other_first(self, cells: NDArray[np.bool_], window: Window, ahead_s: float) -> bool:
        """Return whether other floor is planned first from now on.

        Args:
            cells: the cells that can be covered, bool (rows, cols) of the window.
            window: of the lattice.
            ahead_s: time that the path ahead takes, which covers what was planned [s].
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
            # In blocks of rows: places take far more than cells.
            on_cells = np.empty((window.rows, window.cols), np.int8)
            for part in window.strips(BLOCK):
                values = given.geometry.values_at(given.cells, centres(part, self._cell_m), -1)
                on_cells[part.slices_in(window)] = values.reshape(part.rows, part.cols)
            self._on_cells = window, on_cells
        return self._on_cells[1]
