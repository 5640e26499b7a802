"""Zones beyond reach: zones of an order in which the robot can reach no cell, and their area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, polygon_bounds
from fasaco_edge.grid.lattice import BLOCKED, CoverageLattice
from fasaco_edge.grid.polygons import area_m2
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.exploration import is_in_reach
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.zones import cells_inside


def zones_beyond(
    order: MissionOrder, area: ReachableArea, free: CoverageLattice, visits: NDArray[np.uint16]
) -> str:
    """Return zones with their areas as text that follows another; "" for none.

    A zone that was covered before its way was closed does not count.

    Args:
        order: the order.
        area: the reachable area.
        free: the lattice without keep-out zones.
        visits: of its cells, uint16 (rows, cols).
    """
    beyond = []
    for zone in order.zones:
        if zone.polygon is None or is_in_reach(zone, area):
            continue
        inside = cells_inside(zone.polygon, free.window, free.cell_m)
        visited = inside & (visits > 0)
        left = inside & ~visited & (free.states != BLOCKED)
        left_m2 = np.count_nonzero(left) * free.cell_m**2
        if _sticks_out(zone.polygon, free):
            left_m2 += max(area_m2(zone.polygon) - np.count_nonzero(inside) * free.cell_m**2, 0.0)
        if left_m2 or not visited.any():
            beyond.append(f"{zone.name!r} ({left_m2:.1f} m2)")
    return f"; not reached: {', '.join(beyond)}" if beyond else ""


def _sticks_out(polygon: Polygon, lattice: CoverageLattice) -> bool:
    """Return whether part of a polygon lies beyond the map."""
    x0, y0, x1, y1 = (edge / lattice.cell_m for edge in polygon_bounds(polygon))
    window = lattice.window
    return x0 < window.col0 or y0 < window.row0 or x1 > window.col1 or y1 > window.row1
