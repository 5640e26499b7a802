"""Cells left of an order: cells that need a visit, floor that opened, zones out of reach."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.geometry import Polygon, Window, polygon_bounds
from fasaco_edge.grid.lattice import BLOCKED, Cell, CoverageLattice
from fasaco_edge.grid.polygons import area_m2
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import MissionOrder, Zone
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.work.exploration import frontier, is_in_reach
from fasaco_edge.mission.work.present_order import PresentOrder
from fasaco_edge.planners.passes import Covers, edge_cells, wanted_by

NO_AREA = None, np.empty((0, 0), np.bool_)
NO_CELLS = Window(0, 0, 0, 0), np.empty((0, 0), np.bool_)


@dataclass(slots=True, eq=False)
class CellsLeft:
    """Derives the cells left from map, ledger, company and order; owns those given up."""

    _config: MissionConfig
    _map: MapState
    _ledger: MissionLedger
    _company: Company
    _order: PresentOrder
    # The last area, and its edge cells.
    _edge: tuple[ReachableArea | None, NDArray[np.bool_]] = field(default=NO_AREA, init=False)
    # Cells tried in vain; cells of an area out of reach, although another map may show a way.
    _tried: tuple[Window, NDArray[np.bool_]] = field(default=NO_CELLS, init=False)
    _shut: tuple[ReachableArea | None, NDArray[np.bool_]] = field(default=NO_AREA, init=False)

    def open_cells(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` still need a visit, coverable or not."""
        open_cells = self.unswept(window)
        self._order.exploration.mark(open_cells, window)
        return open_cells

    def untried(self, window: Window) -> NDArray[np.bool_]:
        """Return which of the ``open_cells`` this robot has not given up."""
        return self.open_cells(window) & ~self._given_up(window)

    def unswept(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` are asked for and not visited."""
        asked = self.asked_for(window)
        unswept: NDArray[np.bool_] = asked & (self._ledger.current.visits(window) == 0)
        return unswept

    def open_to_me(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells that this robot (in a fleet: in its part) still has to visit."""
        cells, part = self._divided(area)
        if part is not None:
            cells &= part
        self._order.exploration.mark(cells, area.lattice.window)
        return cells

    def _divided(self, area: ReachableArea) -> tuple[NDArray[np.bool_], NDArray[np.bool_] | None]:
        """Return the unswept cells of an area, and this robot's part; see ``Company.part``.

        If others have a part, the cells that this robot has given up are left to them.
        """
        unswept = self.unswept(area.lattice.window)
        untried = unswept & ~self._given_up(area.lattice.window)
        part = self._company.part(untried, area)
        return unswept if part is None else untried, part

    def _given_up(self, window: Window) -> NDArray[np.bool_]:
        given_up, (area, shut) = carried(self._tried[1], self._tried[0], window), self._shut
        if area is None or area is not self._map.area:
            return given_up
        return given_up | carried(shut, area.lattice.window, window)

    def give_up(self, area: ReachableArea) -> bool:
        """Leave this robot's cells to others until a retry; return whether others have any left."""
        (mine, others), window = self._reachable_parts(area), area.lattice.window
        self._tried = window, mine | carried(self._tried[1], self._tried[0], window)
        return bool(others.any())

    def pass_over(self, area: ReachableArea) -> bool:
        """Leave this robot's cells to others until the next map; return whether there were any."""
        mine, _ = self._reachable_parts(area)
        self._shut = area, mine | (self._shut[1] if self._shut[0] is area else np.False_)
        return bool(mine.any())

    def _reachable_parts(self, area: ReachableArea) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the cells of this robot's part and of others' parts; none without parts."""
        cells, part = self._divided(area)
        cells &= area.reachable & (part is not None)
        return (cells, cells) if part is None else (cells & part, cells & ~part)

    def try_again(self) -> None:
        """Forget which cells were given up."""
        self._tried, self._shut = NO_CELLS, NO_AREA

    @property
    def is_exploring(self) -> bool:
        """Whether a reachable cell is undecided: the map does not show if the robot fits there."""
        area = self._map.area
        decided = None if area is None else self._map.ground.is_decided(area.lattice.window)
        if area is None or decided is None:
            return False
        return bool((area.reachable & ~decided).any())

    @property
    def frontier_cells(self) -> int:
        """Number of reachable cells of the order that border on unknown cells of the map."""
        area = self._map.area
        if area is None:
            return 0
        return int(np.count_nonzero(frontier(area) & self.asked_for(area.lattice.window)))

    def ends_of_map(self, cell: Cell) -> list[Cell]:
        """Return the cells from which to look beyond the map, the nearest to ``cell`` first.

        They border on unknown cells, and were covered before a restart: a mapper that began anew
        may show less than the map before.
        """
        area = self._map.area
        if area is None or self._ledger.before is None:
            return []
        window = area.lattice.window
        ends = frontier(area) & self.asked_for(window) & self._ledger.not_since(window)
        cells = np.argwhere(ends) + np.array((window.row0, window.col0))
        nearest = np.argsort(np.abs(cells - cell).sum(axis=1), kind="stable")
        return [(row, col) for row, col in cells[nearest].tolist()]

    def asked_for(self, window: Window) -> NDArray[np.bool_]:
        """Return the cells of ``window`` that this robot has to cover, or has covered."""
        state = self._order.state
        zone, order = state.current_zone, state.order
        due = (zone,) if zone is not None else order.zones if order is not None else ()
        inside = in_zones(due, window, self._config.footprint.cell_m)
        if self.is_at_edge:
            inside = inside & self.edge(window)
        shared = self._ledger.shared
        return inside & ~shared.swept(window) if shared.version else inside

    @property
    def is_at_edge(self) -> bool:
        """Whether only cells along walls and furniture are due."""
        return self._order.state.current_pass.covers == "edge"

    def edge(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` lie along walls and furniture, bool (rows, cols)."""
        area = self._map.area
        if area is None:
            return np.zeros((window.rows, window.cols), bool)
        if self._edge[0] is not area:
            self._edge = area, edge_cells(area.lattice.steps, area.reachable)
        return carried(self._edge[1], area.lattice.window, window)

    def edge_in(self, window: Window, square_m: float) -> NDArray[np.bool_]:
        """Return which squares of a window, ``square_m`` wide [m], are centred in an edge cell."""
        share = square_m / self._config.footprint.cell_m
        rows, cols = (
            np.floor((np.arange(first, end) + 0.5) * share).astype(np.int64)
            for first, end in ((window.row0, window.row1), (window.col0, window.col1))
        )
        around = Window(int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1)
        edge: NDArray[np.bool_] = self.edge(around)[np.ix_(rows - rows[0], cols - cols[0])]
        return edge

    @property
    def keeps_passed(self) -> bool:
        """Whether this robot's floor includes all cells it has passed, also in parts of others."""
        return self._company.has_members

    def asked_of_me(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells of an area in which this robot has to sweep floor, covered or not."""
        window, (_, part) = area.lattice.window, self._divided(area)
        asked = self.asked_for(window)
        mine = asked if part is None else asked & part
        if self.keeps_passed:
            mine = mine | (self._ledger.passed.inside(window) & asked)
        return mine

    def left(self) -> int:
        """Return the number of reachable cells that still need a visit."""
        area = self._map.area
        if area is None:
            return 0
        return int(np.count_nonzero(self.open_cells(area.lattice.window) & area.reachable))

    def left_to_me(self) -> int:
        """Return the number of cells that this robot has to visit."""
        area = self._map.area
        return 0 if area is None else int(np.count_nonzero(self.open_to_me(area) & area.reachable))


@dataclass(slots=True)
class LeftBehind:
    """Decides whether a robot on its way home turns back, as floor has opened.

    Attributes:
        times: how often it turned back. Callers limit this, as a gap may open after each departure.
    """

    times: int = 0
    # The reachable area when the robot set out; None if unknown, for instance after a restart.
    _area: ReachableArea | None = None

    def set_out(self, area: ReachableArea | None) -> None:
        """Note that the robot sets out for home; ``area``: the reachable area at that time."""
        self._area = area

    def is_open(self, unswept: NDArray[np.bool_], area: ReachableArea) -> bool:
        """Return whether floor has opened since departure: at least a square of two by two cells.

        Single rows of cells along walls are noise of the map. ``unswept``: bool (rows, cols) of the
        area.
        """
        before = self._area = self._area or area
        opened = unswept & area.reachable
        opened &= ~carried(before.reachable, before.lattice.window, area.lattice.window)
        pairs = opened[1:] & opened[:-1]
        return bool((pairs[:, 1:] & pairs[:, :-1]).any())

    def turn_back(self) -> None:
        """Note that the robot turns back."""
        self._area, self.times = None, self.times + 1


def visits_due(zone: Zone, area: ReachableArea, skipped: NDArray[np.bool_]) -> int:
    """Return the number of cells that the passes over a zone cover.

    The first pass leaves out ``skipped``, bool (rows, cols) of the area. If no cell of the zone is
    reachable, the area of its polygon gives the number.
    """
    lattice = area.lattice
    inside = in_zones((zone,), lattice.window, lattice.cell_m) & area.reachable
    if zone.polygon and not inside.any():
        return zone.passes * int(area_m2(zone.polygon) / lattice.cell_m**2)
    number_of = {
        covers: int(np.count_nonzero(wanted_by(covers, lattice.steps, inside)))
        for covers in get_args(Covers)
    }
    covered = [zone.kind(number).covers for number in range(1, zone.passes + 1)]
    first = wanted_by(covered[0], lattice.steps, inside) & skipped
    return sum(number_of[covers] for covers in covered) - int(np.count_nonzero(first))


def zones_beyond(
    order: MissionOrder, area: ReachableArea, free: CoverageLattice, visits: NDArray[np.uint16]
) -> str:
    """Return the zones out of reach, with their areas, as the end of a longer text; "" for none.

    Covered zones that have become unreachable do not count.

    Args:
        order: the order.
        area: the reachable area.
        free: the lattice without keep-out zones.
        visits: visits of the lattice's cells, uint16 (rows, cols).
    """
    beyond = []
    for zone in order.zones:
        if not zone.polygon or is_in_reach(zone, area):
            continue
        inside = in_zones((zone,), free.window, free.cell_m)
        visited = inside & (visits > 0)
        left = inside & ~visited & (free.states != BLOCKED)
        left_m2 = np.count_nonzero(left) * free.cell_m**2
        if _sticks_out(zone.polygon, free):
            all_m2 = area_m2(zone.polygon) - sum(map(area_m2, zone.holes))
            left_m2 += max(all_m2 - np.count_nonzero(inside) * free.cell_m**2, 0.0)
        if left_m2 or not visited.any():
            beyond.append(f"{zone.name!r} ({left_m2:.1f} m2)")
    return f"; not reached: {', '.join(beyond)}" if beyond else ""


def _sticks_out(polygon: Polygon, lattice: CoverageLattice) -> bool:
    x0, y0, x1, y1 = (edge / lattice.cell_m for edge in polygon_bounds(polygon))
    window = lattice.window
    return x0 < window.col0 or y0 < window.row0 or x1 > window.col1 or y1 > window.row1
