"""Uncovered cells of an order: areas, causes, and viewpoints to look at them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.work.order_reach import OrderReach
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.mission.work.present_order import PresentOrder

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
    # The reason may be an obstacle, a wall that has moved, or a wall drawn a pixel thicker.
    Cause.CLOSED: "no longer free on the map",
    Cause.UNKNOWN: "unknown to the map",
}
LEFT_OVER, NO_TIME = "left over after", "no time left"


@dataclass(frozen=True, slots=True)
class UncoveredArea:
    """Connected cells that stay uncovered for one reason.

    Attributes:
        cells: number of cells.
        cell: a cell of the area, (row, col) on the lattice.
        reason: why they stay uncovered.
    """

    cells: int
    cell: Cell
    reason: str


@dataclass(frozen=True, slots=True)
class UncoveredAreas:
    """The uncovered cells of an order.

    Attributes:
        areas: the areas, the largest first; at most MOST_AREAS.
        cells: number of cells in all areas.
        areas_left_out: number of areas that are not listed.
    """

    areas: tuple[UncoveredArea, ...] = ()
    cells: int = 0
    areas_left_out: int = 0


def viewpoints_beside(closed: NDArray[np.bool_], reachable: NDArray[np.bool_]) -> list[Cell]:
    """Return a reachable cell beside each closed area, to look at it; array indices.

    Areas without a square of two by two cells are left out, as single rows of cells along walls are
    noise of the map. There are at most MOST_VIEWPOINTS, for the largest areas.
    """
    areas = find_areas(closed.view(np.uint8))
    beside = cells_beside(areas, reachable)
    seen = np.flatnonzero(beside[:, 0] >= 0)
    largest = seen[np.argsort(-areas.cells[seen], kind="stable")][:MOST_VIEWPOINTS]
    return [(row, col) for row, col in beside[largest].tolist()]


@dataclass(slots=True, eq=False)
class UncoveredCells:
    """Finds the cells of an order that stay uncovered, and why.

    Masks are bool (rows, cols) on the lattice of the area.
    """

    _map: MapState
    _ledger: MissionLedger
    _reach: OrderReach
    _order: PresentOrder
    # Number of paths that left cells over, and why the last path did; "" if unknown.
    _failures: int = field(default=0, init=False)
    _why_left: str = field(default="", init=False)
    _found: tuple[object, UncoveredAreas] = field(default=(None, UncoveredAreas()), init=False)

    def begin_order(self) -> None:
        """Start another order."""
        self._failures, self._why_left = 0, ""

    def continue_from(self, before: UncoveredCells) -> None:
        """Take over the failures of another mission with the same order."""
        self._failures, self._why_left = before._failures, before._why_left

    def record_failure(self, why: str) -> None:
        """Record that a path left cells over, and why."""
        self._failures, self._why_left = self._failures + 1, why

    def found(self) -> UncoveredAreas:
        """Return the cells that stay uncovered on the present map.

        While the robot is on no coverable cell, the last result is returned.
        """
        area, state = self._map.area, self._order.state
        if state.order is None:
            return UncoveredAreas()
        key = (area, self._ledger.version, state)
        if area is not None and key != self._found[0]:
            self._found = key, self._list_areas(state.order, area)
        return self._found[1]

    def reached_m2(self, area: ReachableArea) -> tuple[float, float]:
        """Return the size of an area, and of all cells that were ever reachable [m2].

        Covered cells count as ever reachable: after a restart no other cells are known. Cells
        unknown on the present map do not count: the mapper may have been restarted.
        """
        once = self._reach.known(area.lattice) | (self._ledger.visits(area.lattice.window) > 0)
        once &= area.lattice.states != UNKNOWN
        cell_m2 = area.lattice.cell_m**2
        return np.count_nonzero(area.reachable) * cell_m2, np.count_nonzero(once) * cell_m2

    def outcome(self) -> str:
        """Return as text how much of the order is covered, and why the rest is not."""
        order, area, lattice = self._order.state.order, self._map.area, self._map.ground.lattice
        if order is None or lattice is None:
            return "the order was carried out"
        zones = "" if order.zones[0].polygon is None else " of the zones"
        whole, cell_m = self._reach.around(lattice.window), lattice.cell_m
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
        by_size = np.argsort(-counts, kind="stable")
        why = [
            f"{self._reason(Cause(n + 1))} ({counts[n] * cell_m2:.1f} m2)"
            for n in by_size.tolist()
            if counts[n]
        ]
        return f"{ending}: {', '.join(why)}" if why else ending

    def is_any_left(self) -> bool:
        """Return whether any ordered cell is left that was ever reachable."""
        lattice, state = self._map.ground.lattice, self._order.state
        if state.order is None or state.next_pass() is not state:
            return True
        assert lattice is not None
        whole = self._reach.around(lattice.window)
        asked = self._asked(state.order, lattice, whole)
        return bool((asked & (self._ledger.visits(whole) == 0)).any())

    def _asked(
        self, order: MissionOrder, lattice: CoverageLattice, whole: Window
    ) -> NDArray[np.bool_]:
        """Return the ordered cells that were ever reachable, bool (rows, cols) of a window.

        Cells outside the present map count, too.
        """
        asked = self._reach.on(whole)
        asked[lattice.window.slices_in(whole)] = self._reach.known(lattice)
        asked &= in_zones(order.zones, whole, lattice.cell_m)
        return asked

    def _reason(self, cause: Cause) -> str:
        if self._order.state.late and cause is Cause.LEFT_OVER:
            return NO_TIME
        tries = "1 try" if self._failures == 1 else f"{self._failures} tries"
        why = f", {self._why_left}" if self._why_left else ""
        return REASONS.get(cause, f"{LEFT_OVER} {tries}{why}")

    def viewpoints(self) -> set[Cell]:
        """Return the cells (row, col) from which the robot can look at closed areas."""
        order, area = self._order.state.order, self._map.area
        if order is None or area is None:
            return set()
        window = area.lattice.window
        closed = self._uncovered(order, area) & self._reach.lost(area)
        found = viewpoints_beside(closed, area.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _list_areas(self, order: MissionOrder, area: ReachableArea) -> UncoveredAreas:
        window = area.lattice.window
        areas = find_areas(self._causes(order, area))
        largest = np.argsort(-areas.cells, kind="stable")[:MOST_AREAS]
        listed = []
        for index in largest.tolist():
            row, col = areas.inner[index].tolist()
            cause = Cause(int(areas.kinds[index]))
            cell = row + window.row0, col + window.col0
            listed.append(UncoveredArea(int(areas.cells[index]), cell, self._reason(cause)))
        cells = int(areas.cells.sum(dtype=np.int64))
        return UncoveredAreas(tuple(listed), cells, len(areas.cells) - len(listed))

    def _causes(self, order: MissionOrder, area: ReachableArea) -> NDArray[np.uint8]:
        """Return the cause of each uncovered cell, uint8 (rows, cols); later causes override."""
        lattice, reachable, free = area.lattice, area.reachable, self._map.ground.free
        assert free is not None
        causes, once = np.zeros(lattice.states.shape, np.uint8), self._reach.on(lattice.window)
        causes[once & ~lattice.coverable] = Cause.CLOSED
        # An order for everything does not include cells that were never known.
        is_asked = once if order.zones[0].polygon is None else True
        causes[is_asked & (lattice.states == UNKNOWN)] = Cause.UNKNOWN
        causes[lattice.coverable & ~reachable] = Cause.BEHIND_OBSTACLES
        if free is not lattice:
            causes[free.coverable & (lattice.states == BLOCKED)] = Cause.KEPT_OUT
        behind = self._reach.without_keep_outs(area) & lattice.coverable & ~reachable
        causes[behind] = Cause.BEHIND_KEEP_OUT
        if self._order.state.stage is not Stage.COVERING:
            # While covering, reachable cells are still to come.
            causes[reachable] = Cause.LEFT_OVER
        causes[~self._uncovered(order, area)] = 0
        return causes

    def _uncovered(self, order: MissionOrder, area: ReachableArea) -> NDArray[np.bool_]:
        window = area.lattice.window
        asked = in_zones(order.zones, window, area.lattice.cell_m)
        uncovered: NDArray[np.bool_] = asked & (self._ledger.visits(window) == 0)
        return uncovered
