"""The frontier: cells the robot can come to, beside what the map does not know yet.

Where the robot is sent only to look: for a way to a zone, or into what is closed off.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell
from fasaco_edge.mission.map.reachable_area import Ground
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.polygons import Polygon
from fasaco_edge.mission.orders.zones import in_zones

# Around a cell from which nothing new was seen, others show nothing new either [cells].
SEEN_AROUND = 1


def next_frontier(ground: Ground, polygon: Polygon, looked: Iterable[Cell]) -> Cell | None:
    """Return the frontier cell (row, col) nearest to a polygon's corners [m], in a straight line.

    Args:
        ground: what the robot can come to.
        polygon: where it wants to get.
        looked: cells it has looked from already; what is close to them is left out.
    """
    lattice, window = ground.lattice, ground.lattice.window
    # Beyond the lattice nothing is known.
    unknown = np.pad(lattice.states == UNKNOWN, 1, constant_values=True)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    rows, cols = np.nonzero(ground.reachable & beside)
    rows, cols = rows + window.row0, cols + window.col0
    for row, col in looked:
        away = np.maximum(abs(rows - row), abs(cols - col)) > SEEN_AROUND
        rows, cols = rows[away], cols[away]
    if not len(rows):
        return None
    x, y = (cols + 0.5) * lattice.cell_m, (rows + 0.5) * lattice.cell_m
    nearest = np.min([np.hypot(x - px, y - py) for px, py in polygon], axis=0)
    best = int(np.argmin(nearest))
    return int(rows[best]), int(cols[best])


@dataclass(slots=True)
class Lookout:
    """Cells to look from.

    Attributes:
        viewpoints: cells (row, col) to look from, and not yet driven to.
        looked: cells from which a way to the zone was looked for.
    """

    viewpoints: set[Cell] = field(default_factory=set)
    looked: set[Cell] = field(default_factory=set)

    def seek(self, zone: Zone | None, ground: Ground | None, cell: Cell) -> str:
        """Look for a way to a zone the robot cannot come to; return why a plan is wanted, or "".

        At the border of the known, cell by cell, until the zone is in reach or all was looked at.
        """
        if zone is None or zone.polygon is None or ground is None or is_in_reach(zone, ground):
            return ""
        self.looked |= {cell}
        goal = next_frontier(ground, zone.polygon, self.looked)
        if goal is None:
            return ""
        self.looked.add(goal)
        self.viewpoints = {goal}
        return f"looking for a way to zone {zone.name!r}"

    def note(self, zone: Zone | None, ground: Ground) -> None:
        """Look no more for a zone that can be reached now."""
        if zone is not None and self.viewpoints and is_in_reach(zone, ground):
            self.viewpoints.clear()

    def gives_up(self) -> bool:
        """Note that a viewpoint was not come to; tell whether the zone may be seen from others."""
        another = bool(self.looked and self.viewpoints)
        if another:
            self.viewpoints.clear()
        return another

    def mark(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Set the viewpoints in ``cells``, bool (rows, cols) of ``window``."""
        for row, col in self.viewpoints:
            if window.row0 <= row < window.row1 and window.col0 <= col < window.col1:
                cells[row - window.row0, col - window.col0] = True


def is_in_reach(zone: Zone, ground: Ground) -> bool:
    """Tell whether the robot can come to any cell of a zone."""
    inside = in_zones((zone,), ground.lattice.window, ground.lattice.cell_m)
    return bool((inside & ground.reachable).any())
