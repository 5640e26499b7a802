"""Reach of an order: the cells that have been reachable since it began, on all maps since then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried, carried_copy
from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Window
from fasaco_edge.grid.lattice import UNKNOWN, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.coverage.loop_closure import Motion, moved_mask
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.work.reached_cells import ReachedCells

CellsOn = tuple[Window, NDArray[np.bool_]]
"""Cells, bool (rows, cols), of a window."""


class OrderReach:
    """Remembers which cells have been reachable since an order began.

    Masks are bool (rows, cols) on the lattice of the area.

    Attributes:
        reached: a window around all maps received, and which of its cells have ever been reachable.
    """

    def __init__(self, map_state: MapState) -> None:
        self._map = map_state
        self._newest: ReachableArea | None = None
        self.reached: CellsOn | None = None
        # Whether these cells have moved since the newest area.
        self._have_moved = False
        # Cells that keep-out zones drawn during the order have cut off.
        self._cut_off: CellsOn | None = None

    def begin_order(self, reached: ReachedCells | None) -> None:
        """Start another order, or continue an order with the cells reached before a restart."""
        self._newest = None
        self.reached = None if reached is None else (reached.window, reached.mask)
        self._cut_off = None
        self._have_moved = reached is not None and reached.have_moved
        self.record_area()

    def continue_from(self, before: OrderReach) -> None:
        """Take over the reach of another mission with the same order on the same cells."""
        self._newest, self.reached = before._newest, before.reached
        self._cut_off = before._cut_off

    @property
    def cells(self) -> ReachedCells | None:
        """The cells that have been reachable; None for none."""
        return None if self.reached is None else ReachedCells.of(self.reached[1], self.reached[0])

    def record_area(self) -> None:
        """Remember the cells that are reachable now."""
        area = self._map.area
        if area is not None and area is not self._newest:
            decided = self._map.ground.is_decided(area.lattice.window)
            reachable = area.reachable if decided is None else area.reachable & decided
            window = self.around(area.lattice.window)
            once = self.on(window)
            here = once[area.lattice.window.slices_in(window)]
            if self._have_moved:
                # A motion by a fraction of a cell moves some cells into walls: they are not
                # coverable, and lie beside reachable cells.
                here &= area.lattice.coverable | ~_widened(area.reachable)
            here |= reachable
            self.reached, self._newest, self._have_moved = (window, once), area, False
            if self._cut_off is not None:
                window = area.lattice.window
                self._cut_off = window, _on(window, self._cut_off) & ~area.reachable

    def record_keep_outs(self, before: ReachableArea | None) -> None:
        """Record that keep-outs have changed; ``before``: the area until then."""
        if before is not None and (area := self._map.area) is not None:
            window = area.lattice.window
            lost = _on(window, (before.lattice.window, before.reachable)) & ~area.reachable
            # Other cells may be behind a door that has shut since then.
            still = _on(window, self._cut_off) & self.without_keep_outs(area)
            self._cut_off = window, lost | still

    def move(self, before: CellsOn | None, motion: Motion) -> None:
        """Move the cells with the map; drop cells recorded since then, as their pose was old.

        ``before``: the cells before the map moved.
        """
        if before is not None and not motion.is_still:
            lattice = self._map.ground.lattice
            assert lattice is not None
            self.reached = moved_mask(*before, motion, lattice.cell_m)
            self._newest, self._have_moved, self._cut_off = None, True, None
            self.record_area()

    def shift(self, motion: Motion) -> None:
        """Move the cells with the newest map, whose area is not known yet."""
        if self.reached is not None and self._map.ground.lattice is not None:
            self.reached = moved_mask(*self.reached, motion, self._map.ground.lattice.cell_m)
            self._have_moved, self._cut_off = True, None

    def around(self, window: Window) -> Window:
        """Return the window around all maps received; around the newest map alone if too large."""
        whole = Window.around(window, None if self.reached is None else self.reached[0])
        assert whole is not None
        return whole if whole.rows * whole.cols <= MAX_LATTICE_CELLS else window

    def known(self, lattice: CoverageLattice) -> NDArray[np.bool_]:
        """Return which cells of a lattice are reachable or were before, bool (rows, cols).

        Cells that keep-out zones close now are left out.
        """
        known, area = self.on(lattice.window), self._map.area
        if area is not None and area.lattice is lattice:
            known |= area.reachable
        if self._map.ground.free is not None:
            known &= ~(self._map.ground.free.coverable & ~lattice.coverable)
        return known

    def lost(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return which cells were reachable and may be again, bool (rows, cols) of an area.

        Cells that keep-outs close or cut off are left out.
        """
        known = self.known(area.lattice) & ~area.reachable
        return known & ~_on(area.lattice.window, self._cut_off)

    def on(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window have ever been reachable, bool (rows, cols)."""
        return _on(window, self.reached)

    def without_keep_outs(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return which cells would be reachable without keep-outs, bool (rows, cols) of an area."""
        free, reachable, window = self._map.ground.free, area.reachable, area.lattice.window
        if free is None or free is area.lattice or not reachable.any():
            return reachable
        row, col = divmod(int(np.argmax(reachable)), reachable.shape[1])
        return ReachableArea.around(free, (row + window.row0, col + window.col0)).reachable

    @property
    def is_map_cut(self) -> bool:
        """Whether the newest map lacks cells that were reachable."""
        lattice = self._map.ground.lattice
        if lattice is None or self.reached is None:
            return False
        window, once = self.reached
        shown = carried(lattice.states != UNKNOWN, lattice.window, window)
        return bool((once & ~shown).any())


def _widened(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    padded = np.pad(cells, 1)
    rows = padded[:-2] | padded[1:-1] | padded[2:]
    widened: NDArray[np.bool_] = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return widened


def _on(window: Window, cells: CellsOn | None) -> NDArray[np.bool_]:
    """Return a copy of cells, given with their window, on another window; None: no cells."""
    if cells is None:
        return np.zeros((window.rows, window.cols), bool)
    return carried_copy(cells[1], cells[0], window)
