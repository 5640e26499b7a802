"""Possible floor: the floor that the tool would reach if walls were thinner than on the map.

A pixel of a map is occupied if a wall passes through it, or by noise of scans and poses. So walls
and furniture are thicker on a map than in the building, by about a pixel on the maps of a scan
matcher. The map does not show the floor that they hide; this module estimates its upper limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor import tool_reach
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Point
from fasaco_edge.kernels.floor.bits import Bits, packed, unpacked
from fasaco_edge.kernels.floor.places import connected, disc_rows, keep_in_cells, places_of

# Largest raster for the estimate [pixels]; a larger one would take more than a quarter of a second.
MOST_PIXELS = 8_000_000


def possible_m2(
    floor: FloorMap,
    thinner_m: float,
    at: Point,
    asked: NDArray[np.bool_],
    cut_off: NDArray[np.bool_],
) -> float | None:
    """Return the area that the tool would reach if walls were thinner on each side [m2].

    None on a raster of more than ``MOST_PIXELS``, or if the robot would fit nowhere.

    Args:
        floor: the floor of the newest map.
        thinner_m: reduction of walls on each side, the edge of a pixel of the map [m].
        at: the robot's position x, y [m].
        asked: bool (rows, cols) of the lattice: the cells whose floor counts.
        cut_off: bool (rows, cols): cells no longer reachable; floor connected to them counts, too.
    """
    geometry = floor.geometry
    if geometry.rows * geometry.cols > MOST_PIXELS:
        return None
    unit = geometry.resolution
    # No disc is smaller than the pixel that its centre is in.
    radius = max((floor.discs.radius_m - thinner_m) / unit, 1.0)
    fits = unpacked(places_of(floor.blocked, disc_rows(radius)), geometry.cols)
    found = np.argwhere(fits)
    if not len(found):
        return None
    col, row = geometry.to_pixels(*at)
    nearest = found[np.argmin(((found + 0.5 - np.array((row, col))) ** 2).sum(axis=1))]
    row, col = nearest.tolist()
    reachable = connected(fits, row, col)
    if cut_off.any():
        lost = packed(fits & ~reachable, beyond=False)
        _keep_in(lost, floor, cut_off)
        left = unpacked(lost, geometry.cols)
        while left.any():
            more = connected(fits, *divmod(int(np.argmax(left)), geometry.cols))
            reachable |= more
            left &= ~more
    places = packed(reachable, beyond=False)
    if not asked.all():
        _keep_in(places, floor, asked)
    reached = tool_reach(places, floor.blocked, radius, floor.discs.tool_m / 2 / unit)
    return int(np.count_nonzero(unpacked(reached, geometry.cols))) * unit**2


def _keep_in(pixels: Bits, floor: FloorMap, cells: NDArray[np.bool_]) -> None:
    """Keep only the pixels, uint64 (rows, words) of a floor, in cells, bool (rows, cols)."""
    window = floor.stands.lattice.window
    # The kernel is compiled for cells that may be written to.
    cells = np.require(cells, requirements="W")
    keep_in_cells(pixels, floor.placement, cells, (window.row0, window.col0), (0, 0))
