"""Exploration: cells that the robot is sent to only to look, for a way to a zone out of reach."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones

# Radius around a cell from which nothing new was seen that is not visited either [cells].
SEEN_AROUND = 1


def next_frontier(area: ReachableArea, polygon: Polygon, looked: Iterable[Cell]) -> Cell | None:
    """Return the frontier cell (row, col) nearest to a polygon's corners [m], in a straight line.

    A frontier cell is reachable and beside cells that are unknown to the map.

    Args:
        area: what the robot can reach.
        polygon: where it has to get.
        looked: cells it was sent to already; what is close to them is left out.
    """
    lattice, window = area.lattice, area.lattice.window
    # Beyond the lattice nothing is known.
    unknown = np.pad(lattice.states == UNKNOWN, 1, constant_values=True)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    rows, cols = np.nonzero(area.reachable & beside)
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
class Exploration:
    """Cells the robot is sent to only to look: for a way to a zone, or into closed areas.

    Attributes:
        viewpoints: cells (row, col) to look from, and not yet reached.
        looked: cells from which a way to the zone was looked for.
    """

    viewpoints: set[Cell] = field(default_factory=set)
    looked: set[Cell] = field(default_factory=set)

    def seek(self, zone: Zone | None, area: ReachableArea | None, cell: Cell) -> str:
        """Look for a way to a zone out of reach; return why a plan is wanted, or "".

        From frontier cell to frontier cell, nearest to the zone's corners first, until the zone
        is in reach or all were looked at.
        """
        if zone is None or zone.polygon is None or area is None or is_in_reach(zone, area):
            return ""
        self.looked |= {cell}
        goal = next_frontier(area, zone.polygon, self.looked)
        if goal is None:
            return ""
        self.looked.add(goal)
        self.viewpoints = {goal}
        return f"looking for a way to zone {zone.name!r}"

    def aim_at(self, viewpoints: set[Cell]) -> None:
        """Look from these cells."""
        self.viewpoints = viewpoints

    def end_if_reached(self, zone: Zone | None, area: ReachableArea) -> None:
        """Stop looking for a zone that can be reached now."""
        if zone is not None and self.viewpoints and is_in_reach(zone, area):
            self.viewpoints.clear()

    def skip_viewpoint(self) -> bool:
        """Note that a viewpoint was not reached; tell whether others may show the zone."""
        another = bool(self.looked and self.viewpoints)
        if another:
            self.viewpoints.clear()
        return another

    def mark(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Set the viewpoints in ``cells``, bool (rows, cols) of ``window``."""
        for row, col in self.viewpoints:
            if window.row0 <= row < window.row1 and window.col0 <= col < window.col1:
                cells[row - window.row0, col - window.col0] = True


def is_in_reach(zone: Zone, area: ReachableArea) -> bool:
    """Tell whether the robot can reach any cell of a zone."""
    inside = in_zones((zone,), area.lattice.window, area.lattice.cell_m)
    return bool((inside & area.reachable).any())
