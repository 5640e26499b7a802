"""Unreached areas: cells of an order that stay uncovered, why, and viewpoints to check again."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, Cell
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.order_state import OrderState, Stage
from fasaco_edge.mission.orders.zones import in_zones

# Limit on the areas listed, the largest first; the others are counted.
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
    Cause.CLOSED: "blocked by an obstacle that was not there before",
    Cause.UNKNOWN: "unknown to the map",
}


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

    An area without a square of two by two cells is left out: rows of cells along walls come and go
    with the map's noise. At most MOST_VIEWPOINTS, for the largest areas.
    """
    areas = find_areas(closed.view(np.uint8))
    beside = cells_beside(areas, reachable)
    seen = np.flatnonzero(beside[:, 0] >= 0)
    largest = seen[np.argsort(-areas.cells[seen], kind="stable")][:MOST_VIEWPOINTS]
    return [(row, col) for row, col in beside[largest].tolist()]


class UnreachedFinder:
    """Finds the uncovered cells of an order; remembers which cells were reachable since it began.

    Masks are bool (rows, cols) on the lattice of the area.
    """

    def __init__(self, map_state: MapState, ledger: MissionLedger) -> None:
        self._map = map_state
        self._ledger = ledger
        # Number of paths that left cells over.
        self._failures = 0
        # The newest area, and which cells of its lattice have ever been reachable.
        self._newest: ReachableArea | None = None
        self._once_reachable: NDArray[np.bool_] | None = None
        self._found: tuple[object, Unreached] = (None, Unreached())

    def restart(self) -> None:
        """Begin another order."""
        self._failures, self._newest, self._once_reachable = 0, None, None
        self.note_area()

    def note_area(self) -> None:
        """Remember the cells that are reachable now."""
        area = self._map.area
        if area is not None and area is not self._newest:
            self._once_reachable = self._reached_on(area) | area.reachable
            self._newest = area

    def note_failure(self) -> None:
        """Note that a path left cells over."""
        self._failures += 1

    def unreached(self, state: OrderState) -> Unreached:
        """Return what stays uncovered; the last result while the robot is on no coverable cell."""
        area = self._map.area
        if state.order is None:
            return Unreached()
        key = (area, self._ledger.version, state)
        if area is not None and key != self._found[0]:
            self._found = key, self._list_areas(state.order, area, state.stage)
        return self._found[1]

    def viewpoints(self, order: MissionOrder, area: ReachableArea) -> set[Cell]:
        """Return the cells (row, col) from which to look at areas that were closed."""
        assert self._map.free is not None
        window = area.lattice.window
        kept_out = self._map.free.coverable & ~area.lattice.coverable
        closed = self._uncovered(order, area) & self._reached_on(area) & ~area.reachable & ~kept_out
        found = viewpoints(closed, area.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _list_areas(self, order: MissionOrder, area: ReachableArea, stage: Stage) -> Unreached:
        window = area.lattice.window
        areas = find_areas(self._causes(order, area, stage))
        largest = np.argsort(-areas.cells, kind="stable")[:MOST_AREAS]
        listed = []
        for index in largest.tolist():
            row, col = areas.inner[index].tolist()
            cause = Cause(int(areas.kinds[index]))
            reason = REASONS.get(cause, f"left over after {self._failures} tries")
            cell = row + window.row0, col + window.col0
            listed.append(UnreachedArea(int(areas.cells[index]), cell, reason))
        cells = int(areas.cells.sum(dtype=np.int64))
        return Unreached(tuple(listed), cells, len(areas.cells) - len(listed))

    def _causes(self, order: MissionOrder, area: ReachableArea, stage: Stage) -> NDArray[np.uint8]:
        """Return the cause of each cell, uint8 (rows, cols); a later one overrides."""
        lattice, reachable, free = area.lattice, area.reachable, self._map.free
        assert free is not None
        causes = np.zeros(lattice.states.shape, np.uint8)
        if order.zones[0].polygon is not None:
            # An order for everything does not ask for unknown cells.
            causes[lattice.states == UNKNOWN] = Cause.UNKNOWN
        causes[self._reached_on(area) & ~lattice.coverable] = Cause.CLOSED
        causes[lattice.coverable & ~reachable] = Cause.BEHIND_OBSTACLES
        if free is not lattice:
            causes[free.coverable & (lattice.states == BLOCKED)] = Cause.KEPT_OUT
        if free is not lattice and reachable.any():
            row, col = divmod(int(np.argmax(reachable)), reachable.shape[1])
            cell = row + lattice.window.row0, col + lattice.window.col0
            without_zones = ReachableArea.around(free, cell).reachable
            causes[without_zones & lattice.coverable & ~reachable] = Cause.BEHIND_KEEP_OUT
        if stage is not Stage.COVERING:
            # In earlier stages they are still to come.
            causes[reachable] = Cause.LEFT_OVER
        causes[~self._uncovered(order, area)] = 0
        return causes

    def _uncovered(self, order: MissionOrder, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells that are asked for and not covered."""
        window = area.lattice.window
        uncovered: NDArray[np.bool_] = in_zones(order.zones, window, area.lattice.cell_m) & (
            self._ledger.visits(window) == 0
        )
        return uncovered

    def _reached_on(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells that have ever been reachable."""
        if self._newest is None or self._once_reachable is None:
            return area.reachable
        return carried(self._once_reachable, self._newest.lattice.window, area.lattice.window)
