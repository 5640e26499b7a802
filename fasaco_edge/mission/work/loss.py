"""Loss: how many covered cells a command would forget."""

from __future__ import annotations

import numpy as np

from fasaco_edge.errors import WouldForget
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.floor_tiles import window_of
from fasaco_edge.mission.coverage.ledger import TILE, LedgerSnapshot
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones


def check_loss(command: str, zones: tuple[Zone, ...], ledger: MissionLedger, on: MapState) -> None:
    """Refuse a command that would forget covered cells in zones; without a map, anywhere.

    Cells under the tool stay covered, and do not count.

    Raises:
        WouldForget: there are such cells; the text gives their number, their area, and their share
            of the reachable cells.
    """
    if not zones:
        return
    lattice, own = on.ground.lattice, ledger.current.snapshot()
    cells, share = max(own.cells - len(own.under_tool), 0), ""
    if lattice is not None:
        window = lattice.window
        covered = (ledger.visits(window) > 0) & in_zones(zones, window, lattice.cell_m)
        for cell in own.under_tool:
            if lattice.contains(cell):
                covered[lattice.local(cell)] = False
        cells = int(np.count_nonzero(covered)) + _beyond(window, zones, own)
        if on.area is not None:
            reachable = on.area.reachable
            inside, whole = (
                int(np.count_nonzero(each)) for each in (covered & reachable, reachable)
            )
            percent = 100 * inside / max(whole, 1)
            words = "less than 1 %" if percent < 1 else f"{percent:.0f} %"
            share = f", {words} of the floor in reach"
    if cells:
        cells_m2, noun = cells * own.cell_m**2, "cell" if cells == 1 else "cells"
        raise WouldForget(f"{command} forgets {cells} covered {noun} ({cells_m2:.1f} m2){share}")


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
