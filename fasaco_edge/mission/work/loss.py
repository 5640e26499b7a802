"""Loss: how many covered cells a command would forget."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fasaco_edge.errors import WouldForget
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.floor_tiles import window_of
from fasaco_edge.mission.coverage.ledger import TILE, LedgerSnapshot
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones


@dataclass(frozen=True, slots=True)
class Loss:
    """Covered cells that a command would forget.

    Attributes:
        cells: their number, without cells under the tool, which stay covered.
        m2: their area [m2].
        share: their share of the reachable cells; None if the reachable cells are unknown.
    """

    cells: int
    m2: float
    share: float | None = None

    def __str__(self) -> str:
        cells = "cell" if self.cells == 1 else "cells"
        percent = "" if self.share is None else f", {percents(self.share)} of the floor in reach"
        return f"{self.cells} covered {cells} ({self.m2:.1f} m2){percent}"

    def check(self, command: str) -> None:
        """Refuse a command that would lose these cells.

        Raises:
            WouldForget: there is a loss; the text gives its size.
        """
        if self.cells:
            raise WouldForget(f"{command} forgets {self}")


def percents(share: float) -> str:
    """Return a share in words; never 0 % for a share above 0."""
    return "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def loss_in(zones: tuple[Zone, ...], ledger: MissionLedger, on: MapState) -> Loss:
    """Return the covered cells in zones; without a map, all covered cells."""
    if not zones:
        return Loss(0, 0.0)
    lattice, own = on.lattice, ledger.current.snapshot()
    cells = max(own.cells - len(own.under_tool), 0)
    if lattice is None:
        return Loss(cells, cells * own.cell_m**2)
    window = lattice.window
    covered = (ledger.visits(window) > 0) & in_zones(zones, window, lattice.cell_m)
    for cell in own.under_tool:
        if lattice.contains(cell):
            covered[lattice.local(cell)] = False
    cells = int(np.count_nonzero(covered)) + _beyond(window, zones, own)
    if on.area is None:
        return Loss(cells, cells * lattice.cell_m**2)
    reachable = on.area.reachable
    all_cells = int(np.count_nonzero(reachable))
    share = int(np.count_nonzero(covered & reachable)) / all_cells if all_cells else 0.0
    return Loss(cells, cells * lattice.cell_m**2, share)


def _beyond(window: Window, zones: tuple[Zone, ...], own: LedgerSnapshot) -> int:
    """Return the number of covered cells in zones outside the map's window.

    The map may have been larger before the mapper was restarted.
    """
    cells = 0
    for place in own.tiles:
        for part in window_of(place, TILE).without(window):
            covered = (own.visits(part) > 0) & in_zones(zones, part, own.cell_m)
            for row, col in own.under_tool:
                if part.contains(Window(row, col, row + 1, col + 1)):
                    covered[row - part.row0, col - part.col0] = False
            cells += int(np.count_nonzero(covered))
    return cells
