"""Exploration: cells visited to look for a path to an unreachable zone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell, beside, mask_of
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.zones import in_zones

# A shorter edge of the map is not worth reporting [m].
LEAST_EDGE_M = 1.0
# Distance from a visited viewpoint within which the robot tries no other viewpoint [cells].
SEEN_AROUND = 1
# Period between searches for a way past robots that block it [s].
SEARCH_PERIOD_S = 1.0
# The robot waits this long at the edge of its map, as a new map may come late [s].
LOOK_S = 6.0


def frontier(area: ReachableArea) -> NDArray[np.bool_]:
    """Return the reachable cells that have an unknown neighbour, bool (rows, cols)."""
    # Everything outside the lattice is unknown.
    return area.reachable & beside(area.lattice.states == UNKNOWN, beyond=True)


def open_edge(area: ReachableArea) -> str:
    """Return that the reachable floor ends at the map's edge, as the end of a sentence, or ""."""
    edge_m = float(np.count_nonzero(frontier(area))) * area.lattice.cell_m
    if edge_m < LEAST_EDGE_M:
        return ""
    return f"; the map ends without a wall along {edge_m:.0f} m: there may be more floor beyond"


def next_frontier(area: ReachableArea, polygon: Polygon, looked: Iterable[Cell]) -> Cell | None:
    """Return the frontier cell (row, col) nearest to a corner of a polygon; None for none.

    Args:
        area: the reachable area.
        polygon: destination, corners (x, y) [m].
        looked: viewpoints already visited; cells around them are left out.
    """
    lattice, window = area.lattice, area.lattice.window
    rows, cols = np.nonzero(frontier(area))
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
    """Viewpoints: cells to drive to in search of a path to a zone, or to look into closed areas.

    Attributes:
        viewpoints: cells (row, col) to look from, not yet reached.
        reached: number of viewpoints that were reached.
        looked: viewpoints already visited for this zone, or for ground beyond the map.
        seeks_zone: whether the viewpoints are for a zone.
        is_shut: whether other robots block the way to all viewpoints for the zone.
    """

    viewpoints: set[Cell] = field(default_factory=set)
    looked: set[Cell] = field(default_factory=set)
    reached: int = 0
    seeks_zone: bool = False
    is_shut: bool = False
    # The last viewpoint for ground beyond the map, why, and the time of arrival there [s].
    _beyond: Cell | None = None
    _why_beyond: str = ""
    _there_since: float | None = None
    # Start of the wait for the robots in the way, and time of the last search for a way [s].
    _shut_since: float | None = None
    _shut_looked: float = float("-inf")

    def begin_zone(self) -> None:
        """Begin another zone."""
        self.looked.clear()
        self.is_shut, self._shut_since = False, None

    def aim_at(self, viewpoints: set[Cell]) -> None:
        """Replace the viewpoints."""
        self.viewpoints = viewpoints

    def record_cell(self, cell: Cell) -> None:
        """Record that the robot is in ``cell``."""
        if cell in self.viewpoints:
            self.viewpoints.discard(cell)
            self.reached += 1

    def seek(
        self, zone: Zone | None, area: ReachableArea | None, free: ReachableArea | None, cell: Cell
    ) -> str:
        """Look for a path to an unreachable zone; return why a plan is wanted, or "".

        The robot visits frontier cells, nearest to the zone's corners first, until the zone is
        reachable or all were visited. Frontier cells behind other robots come last.

        Args:
            zone: the zone.
            area: the reachable area.
            free: the part of ``area`` reachable past robots that are in the way.
            cell: the robot's cell.
        """
        self.is_shut = False
        if zone is None or zone.polygon is None or area is None or is_in_reach(zone, area):
            return ""
        self.looked |= {cell}
        goal = next_frontier(free or area, zone.polygon, self.looked)
        if goal is None:
            self.is_shut = next_frontier(area, zone.polygon, self.looked) is not None
            return ""
        self.looked.add(goal)
        self._shut_since = None
        self.viewpoints, self.seeks_zone = {goal}, True
        return f"looking for a way to zone {zone.name!r}"

    def waits_for_way(self, now: float, patience_s: float) -> bool:
        """Return whether the robot waits, up to ``patience_s`` [s], for others to clear the way."""
        if not self.is_shut:
            self._shut_since = None
            return False
        if self._shut_since is None:
            self._shut_since = now
        self._shut_looked = now
        return now - self._shut_since <= patience_s

    def is_shut_still(self, now: float) -> bool:
        """Return whether it is too soon to look again for a way past others."""
        return self._shut_since is not None and now - self._shut_looked < SEARCH_PERIOD_S

    def look_beyond(self, viewpoint: Cell, cell: Cell, why: str) -> str:
        """Aim at ground beyond the map; return ``why`` if a plan is wanted, else "".

        Each viewpoint is used once: maps of others may be wrong, or the way too narrow.
        """
        if any(_is_beside(viewpoint, at) for at in (cell, *self.looked)):
            return ""
        self.looked.add(viewpoint)
        self.viewpoints, self.seeks_zone = {viewpoint}, False
        self._beyond, self._why_beyond, self._there_since = viewpoint, why, None
        return why

    def why_looking(self, cell: Cell, now: float) -> str:
        """Return why the robot stands and looks beyond its map, or ""."""
        if self._beyond is None or not _is_beside(self._beyond, cell):
            return ""
        if self._there_since is None:
            self._there_since = now
        return self._why_beyond if now - self._there_since <= LOOK_S else ""

    def end_if_reached(self, zone: Zone | None, area: ReachableArea) -> None:
        """Stop searching for a zone once it is reachable."""
        if zone is not None and self.seeks_zone and is_in_reach(zone, area):
            self.viewpoints.clear()

    def skip_viewpoint(self) -> bool:
        """Give up an unreached viewpoint; return whether another one may show the zone."""
        another = bool(self.looked and self.viewpoints)
        if another:
            self.viewpoints.clear()
        return another

    def mark(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Set the viewpoints in ``cells``, bool (rows, cols) of ``window``."""
        if self.viewpoints:
            cells |= mask_of(self.viewpoints, window)


def _is_beside(cell: Cell, other: Cell) -> bool:
    """Return whether two cells are so close that they have the same view."""
    return max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) <= SEEN_AROUND


def is_in_reach(zone: Zone, area: ReachableArea) -> bool:
    """Return whether any cell of a zone is reachable."""
    inside = in_zones((zone,), area.lattice.window, area.lattice.cell_m)
    return bool((inside & area.reachable).any())
