"""Unreached areas: uncovered cells of an order, the causes, and viewpoints to look at them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried_copy
from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Window
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.mission.coverage.loop_closure import Motion, moved_mask
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState, Stage
from fasaco_edge.mission.work.reached_cells import ReachedCells

# Limit on the areas listed, the largest first; the rest are only counted.
MOST_AREAS = 20
# Limit on the areas visited in a retry.
MOST_VIEWPOINTS = 256


class Cause(IntEnum):
    """Why a cell stays uncovered; 0 for other cells."""

    KEPT_OUT = 1
    BEHIND_KEEP_OUT = 2
    BEHIND_OBSTACLES = 3
    CLOSED = 4
    LEFT_OVER = 5
    UNKNOWN = 6


REASONS = {
    Cause.KEPT_OUT: "in a keep-out zone",
    Cause.BEHIND_KEEP_OUT: "closed off by a keep-out zone",
    Cause.BEHIND_OBSTACLES: "closed off by obstacles",
    # The reason may be an obstacle, a wall that has moved, or one drawn thicker by a pixel.
    Cause.CLOSED: "no longer free on the map",
    Cause.UNKNOWN: "unknown to the map",
}
LEFT_OVER, NO_TIME = "left over after", "no time left"


@dataclass(frozen=True, slots=True)
class UnreachedArea:
    """Connected cells that stay uncovered for one reason.

    Attributes:
        cells: number of cells.
        cell: one of them, (row, col) on the lattice.
        reason: why they stay uncovered.
    """

    cells: int
    cell: Cell
    reason: str


@dataclass(frozen=True, slots=True)
class Unreached:
    """The uncovered cells of an order.

    Attributes:
        areas: the areas, the largest first; at most MOST_AREAS.
        cells: number of cells in all areas.
        areas_left_out: number of areas that are not listed.
    """

    areas: tuple[UnreachedArea, ...] = ()
    cells: int = 0
    areas_left_out: int = 0


def viewpoints(closed: NDArray[np.bool_], reachable: NDArray[np.bool_]) -> list[Cell]:
    """Return a reachable cell beside each closed area, to look at it; array indices.

    Areas without a square of two by two cells are left out, as single rows of cells along walls are
    noise of the map. At most MOST_VIEWPOINTS, for the largest areas.
    """
    areas = find_areas(closed.view(np.uint8))
    beside = cells_beside(areas, reachable)
    seen = np.flatnonzero(beside[:, 0] >= 0)
    largest = seen[np.argsort(-areas.cells[seen], kind="stable")][:MOST_VIEWPOINTS]
    return [(row, col) for row, col in beside[largest].tolist()]


def _widened(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return cells and their eight neighbours, bool (rows, cols)."""
    padded = np.pad(cells, 1)
    rows = padded[:-2] | padded[1:-1] | padded[2:]
    widened: NDArray[np.bool_] = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return widened


def _on(window: Window, cells: tuple[Window, NDArray[np.bool_]] | None) -> NDArray[np.bool_]:
    """Return a copy of cells, given with their window, on another window; None: no cells."""
    if cells is None:
        return np.zeros((window.rows, window.cols), bool)
    return carried_copy(cells[1], cells[0], window)


class OrderReach:
    """Remembers which cells were reachable since an order began; finds cells that stay uncovered.

    Attributes:
        order_state: the order and its progress.

    Masks are bool (rows, cols) on the lattice of the area.
    """

    def __init__(self, map_state: MapState, ledger: MissionLedger) -> None:
        self.order_state = OrderState.idle(NO_ORDER)
        self._map, self._ledger = map_state, ledger
        # Number of paths that left cells over, and why the last path did; "" if unknown.
        self._failures, self._why_left = 0, ""
        self._newest: ReachableArea | None = None
        # A window around all maps received, and which of its cells have ever been reachable.
        self._once: tuple[Window, NDArray[np.bool_]] | None = None
        # ``_once`` before the map moved; and whether its cells have moved since the newest area.
        self._before_motion: tuple[Window, NDArray[np.bool_]] | None = None
        self._have_moved = False
        # Cells that keep-out zones drawn during the order have cut off.
        self._cut_off: tuple[Window, NDArray[np.bool_]] | None = None
        self._found: tuple[object, Unreached] = (None, Unreached())

    def _begin_reach(self, reached: ReachedCells | None) -> None:
        """Start another order, or continue one with the cells reached before a restart."""
        self._failures, self._why_left, self._newest = 0, "", None
        self._once = None if reached is None else (reached.window, reached.mask)
        self._before_motion = self._cut_off = None
        self._have_moved = reached is not None and reached.have_moved
        self.note_area()

    def succeed(self, before: OrderReach) -> None:
        """Take over the reach of another mission with the same order on the same cells."""
        self._failures, self._why_left = before._failures, before._why_left
        self._newest, self._once = before._newest, before._once
        self._cut_off = before._cut_off

    @property
    def reached(self) -> ReachedCells | None:
        """The cells that have been reachable since the order began; None without an open order."""
        return self._reached_cells() if self.order_state.is_open else None

    def _reached_cells(self) -> ReachedCells | None:
        return None if self._once is None else ReachedCells.of(self._once[1], self._once[0])

    def note_area(self) -> None:
        """Remember the cells that are reachable now."""
        area = self._map.area
        if area is not None and area is not self._newest:
            decided = self._map.is_decided(area.lattice.window)
            reachable = area.reachable if decided is None else area.reachable & decided
            window = self._around(area.lattice.window)
            once = self._once_on(window)
            here = once[area.lattice.window.slices_in(window)]
            if self._have_moved:
                # A motion by a fraction of a cell moves some cells into walls: they are not
                # coverable, and lie beside reachable cells.
                here &= area.lattice.coverable | ~_widened(area.reachable)
            here |= reachable
            self._once, self._newest, self._have_moved = (window, once), area, False
            if self._cut_off is not None:
                window = area.lattice.window
                self._cut_off = window, _on(window, self._cut_off) & ~area.reachable

    def note_keep_outs(self, before: ReachableArea | None) -> None:
        """Note that keep-outs have changed; ``before``: the area until then."""
        if before is not None and (area := self._map.area) is not None:
            window = area.lattice.window
            lost = _on(window, (before.lattice.window, before.reachable)) & ~area.reachable
            # Other cells may be behind a door that has shut since then.
            still = _on(window, self._cut_off) & self._without_keep_outs(area)
            self._cut_off = window, lost | still

    def note_map_motion(self) -> None:
        """Note that the newest map has moved; ``move_reached`` follows with the motion."""
        self._before_motion = self._before_motion or self._once

    def move_reached(self, motion: Motion) -> None:
        """Move the cells with the map; drop what was noted since it moved: the pose was old."""
        before, self._before_motion = self._before_motion, None
        if before is not None and not motion.is_still:
            lattice = self._map.lattice
            assert lattice is not None
            self._once = moved_mask(*before, motion, lattice.cell_m)
            self._newest, self._have_moved, self._cut_off = None, True, None
            self.note_area()

    def shift_reached(self, motion: Motion) -> None:
        """Move the cells with the newest map, whose area is not known yet."""
        if self._once is not None and self._map.lattice is not None:
            self._once = moved_mask(*self._once, motion, self._map.lattice.cell_m)
            self._have_moved, self._cut_off = True, None

    def _around(self, window: Window) -> Window:
        """Return the window around all maps received; around the newest alone if too large."""
        whole = Window.around(window, None if self._once is None else self._once[0])
        assert whole is not None
        return whole if whole.rows * whole.cols <= MAX_LATTICE_CELLS else window

    def known(self, lattice: CoverageLattice) -> NDArray[np.bool_]:
        """Return which cells of a lattice are reachable or were before, bool (rows, cols).

        Cells that keep-out zones close now are left out.
        """
        known, area = self._once_on(lattice.window), self._map.area
        if area is not None and area.lattice is lattice:
            known |= area.reachable
        if self._map.free is not None:
            known &= ~(self._map.free.coverable & ~lattice.coverable)
        return known

    def lost(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return which cells were reachable and may be again, bool (rows, cols) of an area.

        Cells that keep-outs close or cut off are left out.
        """
        known = self.known(area.lattice) & ~area.reachable
        return known & ~_on(area.lattice.window, self._cut_off)

    def _note_failure(self, why: str) -> None:
        """Note that a path left cells over, and why."""
        self._failures, self._why_left = self._failures + 1, why

    def unreached(self) -> Unreached:
        """Return the cells that stay uncovered on the present map.

        While the robot is on no coverable cell, the last result is returned.
        """
        area, state = self._map.area, self.order_state
        if state.order is None:
            return Unreached()
        key = (area, self._ledger.version, state)
        if area is not None and key != self._found[0]:
            self._found = key, self._list_areas(state.order, area)
        return self._found[1]

    def reached_m2(self, area: ReachableArea) -> tuple[float, float]:
        """Return the size of an area, and of all cells that were ever reachable [m2].

        Covered cells count as ever reachable: after a restart no others are known. Cells unknown on
        the present map do not count: the mapper may have been restarted.
        """
        once = self.known(area.lattice) | (self._ledger.visits(area.lattice.window) > 0)
        once &= area.lattice.states != UNKNOWN
        cell_m2 = area.lattice.cell_m**2
        return np.count_nonzero(area.reachable) * cell_m2, np.count_nonzero(once) * cell_m2

    def _outcome(self) -> str:
        """Return as text how much of the order is covered, and why the rest is not."""
        order, area, lattice = self.order_state.order, self._map.area, self._map.lattice
        if order is None or lattice is None:
            return "the order was carried out"
        zones = "" if order.zones[0].polygon is None else " of the zones"
        whole, cell_m = self._around(lattice.window), lattice.cell_m
        asked = self._asked(order, lattice, whole)
        left = asked & (self._ledger.visits(whole) == 0)
        asked_cells, left_cells = np.count_nonzero(asked), np.count_nonzero(left)
        if not left_cells:
            return f"every reachable cell{zones} is covered"
        percent, cell_m2 = 100 * (asked_cells - left_cells) // asked_cells, cell_m**2
        ending = (
            f"{percent} % of {asked_cells * cell_m2:.1f} m2{zones} covered; "
            f"{left_cells * cell_m2:.1f} m2 not reached"
        )
        if area is None:
            return ending
        causes = np.full(left.shape, Cause.UNKNOWN, np.uint8)
        causes[lattice.window.slices_in(whole)] = self._causes(order, area)
        counts = np.bincount(causes[left], minlength=len(Cause) + 1)[1:]
        order_of = np.argsort(-counts, kind="stable")
        why = [
            f"{self._reason(Cause(n + 1))} ({counts[n] * cell_m2:.1f} m2)"
            for n in order_of.tolist()
            if counts[n]
        ]
        return f"{ending}: {', '.join(why)}" if why else ending

    def _is_any_left(self) -> bool:
        """Return whether any ordered cell is left that was ever reachable."""
        lattice, state = self._map.lattice, self.order_state
        if state.order is None or state.next_pass() is not state:
            return True
        assert lattice is not None
        whole = self._around(lattice.window)
        asked = self._asked(state.order, lattice, whole)
        return bool((asked & (self._ledger.visits(whole) == 0)).any())

    def _asked(
        self, order: MissionOrder, lattice: CoverageLattice, whole: Window
    ) -> NDArray[np.bool_]:
        """Return the ordered cells that were ever reachable, bool (rows, cols) of a window.

        Cells outside the present map count, too.
        """
        asked = self._once_on(whole)
        asked[lattice.window.slices_in(whole)] = self.known(lattice)
        asked &= in_zones(order.zones, whole, lattice.cell_m)
        return asked

    def _reason(self, cause: Cause) -> str:
        if self.order_state.late and cause is Cause.LEFT_OVER:
            return NO_TIME
        tries = "1 try" if self._failures == 1 else f"{self._failures} tries"
        why = f", {self._why_left}" if self._why_left else ""
        return REASONS.get(cause, f"{LEFT_OVER} {tries}{why}")

    def _viewpoints(self) -> set[Cell]:
        """Return the cells (row, col) from which the robot can look at closed areas."""
        order, area = self.order_state.order, self._map.area
        if order is None or area is None:
            return set()
        window = area.lattice.window
        closed = self._uncovered(order, area) & self.lost(area)
        found = viewpoints(closed, area.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _list_areas(self, order: MissionOrder, area: ReachableArea) -> Unreached:
        window = area.lattice.window
        areas = find_areas(self._causes(order, area))
        largest = np.argsort(-areas.cells, kind="stable")[:MOST_AREAS]
        listed = []
        for index in largest.tolist():
            row, col = areas.inner[index].tolist()
            cause = Cause(int(areas.kinds[index]))
            cell = row + window.row0, col + window.col0
            listed.append(UnreachedArea(int(areas.cells[index]), cell, self._reason(cause)))
        cells = int(areas.cells.sum(dtype=np.int64))
        return Unreached(tuple(listed), cells, len(areas.cells) - len(listed))

    def _causes(self, order: MissionOrder, area: ReachableArea) -> NDArray[np.uint8]:
        """Return the cause of each uncovered cell, uint8 (rows, cols); later causes override."""
        lattice, reachable, free = area.lattice, area.reachable, self._map.free
        assert free is not None
        causes, once = np.zeros(lattice.states.shape, np.uint8), self._once_on(lattice.window)
        causes[once & ~lattice.coverable] = Cause.CLOSED
        # An order for everything does not include cells that were never known.
        is_asked = once if order.zones[0].polygon is None else True
        causes[is_asked & (lattice.states == UNKNOWN)] = Cause.UNKNOWN
        causes[lattice.coverable & ~reachable] = Cause.BEHIND_OBSTACLES
        if free is not lattice:
            causes[free.coverable & (lattice.states == BLOCKED)] = Cause.KEPT_OUT
        behind = self._without_keep_outs(area) & lattice.coverable & ~reachable
        causes[behind] = Cause.BEHIND_KEEP_OUT
        if self.order_state.stage is not Stage.COVERING:
            # While covering, reachable cells are still to come.
            causes[reachable] = Cause.LEFT_OVER
        causes[~self._uncovered(order, area)] = 0
        return causes

    def _without_keep_outs(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return which cells would be reachable without keep-outs, bool (rows, cols) of an area."""
        free, reachable, window = self._map.free, area.reachable, area.lattice.window
        if free is None or free is area.lattice or not reachable.any():
            return reachable
        row, col = divmod(int(np.argmax(reachable)), reachable.shape[1])
        return ReachableArea.around(free, (row + window.row0, col + window.col0)).reachable

    def _uncovered(self, order: MissionOrder, area: ReachableArea) -> NDArray[np.bool_]:
        window = area.lattice.window
        asked = in_zones(order.zones, window, area.lattice.cell_m)
        uncovered: NDArray[np.bool_] = asked & (self._ledger.visits(window) == 0)
        return uncovered

    def _once_on(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window have ever been reachable."""
        return _on(window, self._once)
