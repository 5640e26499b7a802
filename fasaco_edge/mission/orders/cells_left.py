"""Cells left of an order: which still need a visit, by this robot or by others of its fleet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.exploration import Exploration, frontier
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones


class CellsLeft:
    """Derives the cells left from map, ledger and company; owns nothing.

    Args:
        config, map_state, ledger, company: the sources of the cells.
        zones: the zones of the order that are due; None without an order.
        exploration: the viewpoints.
    """

    def __init__(
        self,
        config: MissionConfig,
        map_state: MapState,
        ledger: MissionLedger,
        company: Company,
        zones: Callable[[], tuple[Zone, ...] | None],
        exploration: Callable[[], Exploration],
    ) -> None:
        self._config, self._map, self._ledger, self._company = config, map_state, ledger, company
        self._zones, self._exploration = zones, exploration

    def open_cells(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` still need a visit, coverable or not."""
        open_cells = self.unswept(window)
        self._exploration().mark(open_cells, window)
        return open_cells

    def unswept(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` are asked for and not visited."""
        if self._zones() is None:
            return np.zeros((window.rows, window.cols), bool)
        unswept: NDArray[np.bool_] = self.asked_for(window) & (
            self._ledger.current.visits(window) == 0
        )
        return unswept

    def open_to_me(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells that still need a visit by this robot: its part, in a fleet."""
        window = area.lattice.window
        cells = self._company.mine(self.unswept(window), area).copy()
        self._exploration().mark(cells, window)
        return cells

    @property
    def is_exploring(self) -> bool:
        """Whether for some reachable cells the map does not yet show whether the robot fits."""
        area = self._map.area
        decided = None if area is None else self._map.is_decided(area.lattice.window)
        if area is None or decided is None:
            return False
        return bool((area.reachable & ~decided).any())

    @property
    def frontier_cells(self) -> int:
        """Number of reachable ordered cells that border on unknown cells of the map."""
        area = self._map.area
        if area is None:
            return 0
        return int(np.count_nonzero(frontier(area) & self.asked_for(area.lattice.window)))

    def asked_for(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` this robot has to cover, covered or not."""
        inside = in_zones(self._zones() or (), window, self._config.footprint.cell_m)
        shared = self._ledger.shared
        return inside & ~shared.swept(window) if shared.version else inside

    @property
    def keeps_passed(self) -> bool:
        """Whether floor of cells that this robot has passed stays with it, in any robot's part."""
        return self._company.has_members

    def asked_of_me(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return on which cells of an area this robot has to sweep the floor, covered or not."""
        window = area.lattice.window
        asked = self.asked_for(window)
        mine = self._company.mine_to_sweep(asked, self.unswept(window), area)
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
