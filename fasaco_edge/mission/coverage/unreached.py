"""Unreached areas: what of an order stays uncovered, why, and where to look at it again."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.order_state import OrderState, Stage
from fasaco_edge.mission.orders.zones import in_zones

# This many areas are listed, the largest first; the others are counted.
MOST_AREAS = 20
# A robot drives to this many at most when it tries again.
MOST_VIEWPOINTS = 256


class Cause(IntEnum):
    """Why a cell stays uncovered; 0 is a cell that does not."""

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
    """Cells that hang together and stay uncovered for one reason.

    Attributes:
        cells: how many.
        cell: one of them, (row, col) on the lattice.
        reason: why.
    """

    cells: int
    cell: Cell
    reason: str


@dataclass(frozen=True, slots=True)
class Unreached:
    """What stays uncovered.

    Attributes:
        areas: the largest of them, the largest first; at most MOST_AREAS.
        cells: how many cells all areas have.
        areas_left_out: how many more areas there are.
    """

    areas: tuple[UnreachedArea, ...] = ()
    cells: int = 0
    areas_left_out: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """All that decides what stays uncovered; arrays are bool (rows, cols) on one window.

    Attributes:
        free: the lattice without any keep-out zone.
        area: the lattice with them, and what can be reached on it.
        uncovered: cells that were to be covered, and are not.
        once_reachable: cells that could be reached at some time.
        has_zones: whether the order names zones; else unknown cells are not to be covered.
        given_up: whether reachable cells will not be tried again; else they are still to come.
        tries: how often they were tried.
    """

    free: CoverageLattice
    area: ReachableArea
    uncovered: NDArray[np.bool_]
    once_reachable: NDArray[np.bool_]
    has_zones: bool
    given_up: bool
    tries: int

    def unreached(self) -> Unreached:
        """Return what stays uncovered."""
        window = self.area.lattice.window
        areas = find_areas(self._causes())
        largest = np.argsort(-areas.cells, kind="stable")[:MOST_AREAS]
        listed = []
        for index in largest.tolist():
            row, col = areas.inner[index].tolist()
            cause = Cause(int(areas.kinds[index]))
            reason = REASONS.get(cause, f"left over after {self.tries} tries")
            cell = row + window.row0, col + window.col0
            listed.append(UnreachedArea(int(areas.cells[index]), cell, reason))
        cells = int(areas.cells.sum(dtype=np.int64))
        return Unreached(tuple(listed), cells, len(areas.cells) - len(listed))

    def closed(self) -> NDArray[np.bool_]:
        """Return the uncovered cells that could be reached once, bool (rows, cols)."""
        kept_out = self.free.coverable & ~self.area.lattice.coverable
        return self.uncovered & self.once_reachable & ~self.area.reachable & ~kept_out

    def _causes(self) -> NDArray[np.uint8]:
        lattice, reachable = self.area.lattice, self.area.reachable
        coverable = lattice.coverable
        causes = np.zeros(lattice.states.shape, np.uint8)
        if self.has_zones:
            causes[lattice.states == UNKNOWN] = Cause.UNKNOWN
        causes[self.once_reachable & ~coverable] = Cause.CLOSED
        causes[coverable & ~reachable] = Cause.BEHIND_OBSTACLES
        if self.free is not lattice:
            self._mark_keep_out(causes)
        if self.given_up:
            causes[reachable] = Cause.LEFT_OVER
        causes[~self.uncovered] = 0
        return causes

    def _mark_keep_out(self, causes: NDArray[np.uint8]) -> None:
        lattice, reachable = self.area.lattice, self.area.reachable
        causes[self.free.coverable & (lattice.states == BLOCKED)] = Cause.KEPT_OUT
        if reachable.any():
            row, col = divmod(int(np.argmax(reachable)), reachable.shape[1])
            cell = row + lattice.window.row0, col + lattice.window.col0
            without_zones = ReachableArea.around(self.free, cell).reachable
            causes[without_zones & lattice.coverable & ~reachable] = Cause.BEHIND_KEEP_OUT


def viewpoints(closed: NDArray[np.bool_], reachable: NDArray[np.bool_]) -> list[Cell]:
    """Return a cell beside each closed area to look at it from; indices of the arrays.

    An area without a square of two by two cells is left out: rows of cells along the walls
    come and go with a map's noise. Of very many the largest are taken.
    """
    areas = find_areas(closed.view(np.uint8))
    beside = cells_beside(areas, reachable)
    seen = np.flatnonzero(beside[:, 0] >= 0)
    largest = seen[np.argsort(-areas.cells[seen], kind="stable")][:MOST_VIEWPOINTS]
    return [(row, col) for row, col in beside[largest].tolist()]


class ReachHistory:
    """Remembers what could be reached since an order began, and tells what of it is not covered."""

    def __init__(self, map_state: MapState, ledger: MissionLedger) -> None:
        self._map = map_state
        self._ledger = ledger
        # Paths after which cells were left over.
        self._failures = 0
        # The newest area seen, and which cells of its lattice could be reached at some time.
        self._seen: ReachableArea | None = None
        self._once_reachable: NDArray[np.bool_] | None = None
        self._found: tuple[object, Unreached] = (None, Unreached())

    def restart(self) -> None:
        """Begin with another order."""
        self._failures, self._seen, self._once_reachable = 0, None, None
        self.update()

    def update(self) -> None:
        """Remember what can be reached now."""
        area = self._map.area
        if area is not None and area is not self._seen:
            self._once_reachable = self._before(area) | area.reachable
            self._seen = area

    def note_failure(self) -> None:
        """Note that a path left cells over."""
        self._failures += 1

    def unreached(self, state: OrderState) -> Unreached:
        """Return what is not reached; the last answer while the robot is on no coverable cell."""
        area = self._map.area
        if state.order is None:
            return Unreached()
        key = (area, self._ledger.current.total, state)
        if area is not None and key != self._found[0]:
            given_up = state.stage is not Stage.COVERING
            self._found = key, self._situation(state.order, area, given_up).unreached()
        return self._found[1]

    def viewpoints(self, order: MissionOrder, area: ReachableArea) -> set[Cell]:
        """Return the cells (row, col) to look at areas from that were closed."""
        window = area.lattice.window
        situation = self._situation(order, area, given_up=True)
        found = viewpoints(situation.closed(), area.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _before(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return what could be reached before, on the lattice of ``area``, bool (rows, cols)."""
        if self._seen is None or self._once_reachable is None:
            return np.zeros_like(area.reachable)
        return carried(self._once_reachable, self._seen.lattice.window, area.lattice.window)

    def _situation(self, order: MissionOrder, area: ReachableArea, given_up: bool) -> Situation:
        window = area.lattice.window
        assert self._map.free is not None
        uncovered = in_zones(order.zones, window, area.lattice.cell_m)
        return Situation(
            free=self._map.free,
            area=area,
            uncovered=uncovered & (self._ledger.current.visits(window) == 0),
            once_reachable=area.reachable if self._seen is None else self._before(area),
            has_zones=order.zones[0].polygon is not None,
            given_up=given_up,
            tries=self._failures,
        )
