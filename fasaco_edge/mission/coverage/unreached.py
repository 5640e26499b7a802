"""What of an order stays uncovered, area by area, and why; and where to look at it again.

What of an order is left uncovered on the map as it is: found out anew when something changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.mission.coverage.ledger_keeper import LedgerKeeper
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.order_state import OrderState, Stage
from fasaco_edge.mission.orders.zones import in_zones

# So many areas are named, the largest first; the others are counted.
MOST_AREAS = 20
# A robot drives by so many in the end, and no more.
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
class Sighted:
    """Which cells the robot could come to at some time, bool (rows, cols) of ``window``."""

    window: Window
    mask: NDArray[np.bool_]

    @classmethod
    def of(cls, ground: ReachableArea) -> Sighted:
        """Return what can be reached now."""
        return cls(ground.lattice.window, ground.reachable)

    def on(self, window: Window) -> NDArray[np.bool_]:
        """Return the mask on another window, bool (rows, cols)."""
        if window == self.window:
            return self.mask
        mask = np.zeros((window.rows, window.cols), bool)
        if common := window.intersection(self.window):
            mask[common.slices_in(window)] = self.mask[common.slices_in(self.window)]
        return mask

    def and_now(self, ground: ReachableArea) -> Sighted:
        """Return what could be reached before, or can be now."""
        window = ground.lattice.window
        return Sighted(window, self.on(window) | ground.reachable)


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """All that decides what stays uncovered; arrays are bool (rows, cols) on one window.

    Attributes:
        free: the lattice without any keep-out zone.
        ground: the lattice with them, and what can be reached on it.
        uncovered: cells that were to be covered, and are not.
        sighted: cells that could be reached at some time.
        zoned: whether the order names zones; else unknown cells are nobody's.
        given_up: whether reachable cells will not be tried again; else they are still to come.
        tries: how often they were tried.
    """

    free: CoverageLattice
    ground: ReachableArea
    uncovered: NDArray[np.bool_]
    sighted: NDArray[np.bool_]
    zoned: bool
    given_up: bool
    tries: int

    def unreached(self) -> Unreached:
        """Return what stays uncovered."""
        window = self.ground.lattice.window
        areas = find_areas(self._causes())
        largest = np.argsort(-areas.cells, kind="stable")[:MOST_AREAS]
        named = []
        for area in largest.tolist():
            row, col = areas.inner[area].tolist()
            cause = Cause(int(areas.kinds[area]))
            reason = REASONS.get(cause, f"left over after {self.tries} tries")
            cell = row + window.row0, col + window.col0
            named.append(UnreachedArea(int(areas.cells[area]), cell, reason))
        cells = int(areas.cells.sum(dtype=np.int64))
        return Unreached(tuple(named), cells, len(areas.cells) - len(named))

    def closed(self) -> NDArray[np.bool_]:
        """Return the uncovered cells that could be reached once, bool (rows, cols)."""
        kept_out = self.free.coverable & ~self.ground.lattice.coverable
        return self.uncovered & self.sighted & ~self.ground.reachable & ~kept_out

    def _causes(self) -> NDArray[np.uint8]:
        states, reachable = self.ground.lattice.states, self.ground.reachable
        coverable = self.ground.lattice.coverable
        causes = np.zeros(states.shape, np.uint8)
        if self.zoned:
            causes[states == UNKNOWN] = Cause.UNKNOWN
        causes[self.sighted & ~coverable] = Cause.CLOSED
        causes[coverable & ~reachable] = Cause.BEHIND_OBSTACLES
        if self.free is not self.ground.lattice:
            self._blame_keep_out(causes)
        if self.given_up:
            causes[reachable] = Cause.LEFT_OVER
        causes[~self.uncovered] = 0
        return causes

    def _blame_keep_out(self, causes: NDArray[np.uint8]) -> None:
        lattice, reachable = self.ground.lattice, self.ground.reachable
        causes[self.free.coverable & (lattice.states == BLOCKED)] = Cause.KEPT_OUT
        if reachable.any():
            row, col = divmod(int(np.argmax(reachable)), reachable.shape[1])
            somewhere = row + lattice.window.row0, col + lattice.window.col0
            behind = (
                ReachableArea.around(self.free, somewhere).reachable
                & lattice.coverable
                & ~reachable
            )
            causes[behind] = Cause.BEHIND_KEEP_OUT


def viewpoints(closed: NDArray[np.bool_], reachable: NDArray[np.bool_]) -> list[Cell]:
    """Return a cell beside each closed area to look at it from; indices of the arrays.

    An area without a square of two by two cells is left out: rows of cells along the walls
    come and go with a map's noise, and nobody wants a robot to drive along all of them again.
    Of very many the largest are looked at.
    """
    areas = find_areas(closed.view(np.uint8))
    beside = cells_beside(areas, reachable)
    seen = np.flatnonzero(beside[:, 0] >= 0)
    largest = seen[np.argsort(-areas.cells[seen], kind="stable")][:MOST_VIEWPOINTS]
    return [(row, col) for row, col in beside[largest].tolist()]


class Leftovers:
    """Remembers what could be reached since an order began.

    Attributes:
        failures: paths after which cells were left over.
    """

    def __init__(self, site: MapState, log: LedgerKeeper) -> None:
        self.failures = 0
        self._site = site
        self._log = log
        self._sighted: Sighted | None = None
        self._seen: ReachableArea | None = None
        self._found: tuple[object, Unreached] = (None, Unreached())

    def begin_anew(self) -> None:
        """Begin with another order."""
        self.failures, self._sighted, self._seen = 0, None, None
        self.see()

    def see(self) -> None:
        """Remember what can be reached now."""
        ground, before = self._site.ground, self._sighted
        if ground is not None and ground is not self._seen:
            self._sighted = before.and_now(ground) if before else Sighted.of(ground)
            self._seen = ground

    def unreached(self, assignment: OrderState) -> Unreached:
        """Return what is not reached.

        While the robot stands where it cannot be, what was so before is all there is to say.
        """
        ground = self._site.ground
        if assignment.order is None:
            return Unreached()
        key = (ground, self._log.ledger.total, assignment)
        if ground is not None and key != self._found[0]:
            given_up = assignment.stage is not Stage.COVERING
            self._found = key, self._situation(assignment.order, ground, given_up).unreached()
        return self._found[1]

    def viewpoints(self, order: MissionOrder, ground: ReachableArea) -> set[Cell]:
        """Return the cells (row, col) to look at areas from that were closed."""
        window = ground.lattice.window
        situation = self._situation(order, ground, given_up=True)
        found = viewpoints(situation.closed(), ground.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _situation(self, order: MissionOrder, ground: ReachableArea, given_up: bool) -> Situation:
        window = ground.lattice.window
        assert self._site.free is not None
        uncovered = in_zones(order.zones, window, ground.lattice.cell_m)
        return Situation(
            free=self._site.free,
            ground=ground,
            uncovered=uncovered & (self._log.ledger.visits(window) == 0),
            sighted=self._sighted.on(window) if self._sighted else ground.reachable,
            zoned=order.zones[0].polygon is not None,
            given_up=given_up,
            tries=self.failures,
        )
