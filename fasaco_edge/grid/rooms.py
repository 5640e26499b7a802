"""Rooms of an occupancy grid: regions of free floor that doors and other narrow places part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point
from fasaco_edge.grid.occupancy import FREE, OccupancyGrid, coarser
from fasaco_edge.kernels.lattice.areas import find_areas

# A place is narrow where walls are nearer than this on both sides [m].
NARROW_M = 0.5
MOST_OCCUPIED = 50
MOST_PIXELS = 500_000


@dataclass(frozen=True, slots=True, eq=False)
class FoundRooms:
    """Regions of a map.

    Attributes:
        geometry: placement of the labels' pixels.
        labels: int32 (rows, cols); 0 none, 1..count.
        count: number of regions.
    """

    geometry: GridGeometry
    labels: NDArray[np.int32]
    count: int


def find_rooms(grid: OccupancyGrid, cuts: Sequence[tuple[Point, Point]] = ()) -> FoundRooms:
    """Return the rooms of a map; cuts are segments [m] in the map frame that count as walls."""
    grid = coarser(grid, MOST_PIXELS)
    free = (grid.cells >= FREE) & (grid.cells < MOST_OCCUPIED)
    for (x0, y0), (x1, y1) in cuts:
        steps = 4 * math.ceil(math.hypot(x1 - x0, y1 - y0) / grid.geometry.resolution) + 1
        share = np.linspace(0.0, 1.0, steps)
        col, row = grid.geometry.to_pixels(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
        inside = (row >= 0) & (col >= 0) & (row < free.shape[0]) & (col < free.shape[1])
        free[row[inside].astype(int), col[inside].astype(int)] = False
    reach = max(round(NARROW_M / grid.geometry.resolution), 1)
    taken = np.pad(~free, reach, constant_values=True)
    sums = np.pad(np.cumsum(np.cumsum(taken, 0), 1), ((1, 0), (1, 0)))
    side = 2 * reach + 1
    near = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    areas = find_areas((free & (near == 0)).astype(np.uint8))
    labels = np.pad(areas.labels, 1)
    free = np.pad(free, 1)
    for _ in range(3 * reach):
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            beside = np.roll(labels, step, axis)
            labels = np.where(free & (labels == 0), beside, labels)
    labels = np.ascontiguousarray(labels[1:-1, 1:-1].astype(np.int32))
    return FoundRooms(grid.geometry, labels, len(areas.cells))
