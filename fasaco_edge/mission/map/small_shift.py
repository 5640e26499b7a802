"""Small shifts of the map: by a few pixels, found by its walls alone.

A loop closure that moves the map by less than a cell changes too few cells to count as a motion
(``loop_closure.has_moved``), and by less than poses differ while the robot drives. Its walls show
it: pixels at the border of occupied and free lie in the walls before, once they are moved back.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.map.loop_closure import Motion

# Maps that close fewer cells are not compared: nothing is lost by them.
LEAST_CLOSED = 3
# Largest shift along each axis [pixels], and number of pixels compared.
FARTHEST_PX, MOST_PIXELS = 4, 2000
# Least share of these pixels that a shift moves into the previous walls; least gain over no shift.
LEAST_ALIKE, BETTER = 0.5, 0.2
# Of shifts that differ by less, the smallest is taken: along a corridor all are alike.
ALIKE = 0.03


def closes_cells(change: LatticeChange | None) -> bool:
    """Return whether a change of the lattice closes cells, as a shift of the map does."""
    if change is None or change.before is None:
        return False
    then, now = (
        lattice.window.values_at(lattice.states, change.cells, UNKNOWN)
        for lattice in (change.before, change.after)
    )
    closed = (then == COVERABLE) & (now == BLOCKED)
    return bool(np.count_nonzero(closed) >= LEAST_CLOSED)


def small_shift(before: OccupancyGrid, after: OccupancyGrid, footprint: Footprint) -> Motion | None:
    """Return the shift of a map since the previous one; None for none."""
    rows, cols = np.nonzero(_wall_faces(after.cells, footprint))
    stride = 1 + len(rows) // MOST_PIXELS
    rows, cols = rows[::stride], cols[::stride]
    if not len(rows):
        return None
    x, y = after.geometry.to_map(cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
    occupied, unit = before.cells >= footprint.occupied_at_least, after.geometry.resolution
    steps = range(-FARTHEST_PX, FARTHEST_PX + 1)
    shifts = sorted(product(steps, steps), key=lambda shift: (math.hypot(*shift), shift))
    alike = np.zeros(len(shifts))
    for index, (right, up) in enumerate(shifts):
        at_col, at_row = before.geometry.to_pixels(x - right * unit, y - up * unit)
        row, col = np.floor(at_row).astype(np.int64), np.floor(at_col).astype(np.int64)
        inside = (row >= 0) & (col >= 0) & (row < occupied.shape[0]) & (col < occupied.shape[1])
        alike[index] = np.count_nonzero(occupied[row[inside], col[inside]]) / len(rows)
        if alike[0] > 1.0 - BETTER:
            return None
    best = int(np.argmax(alike >= alike.max() - ALIKE))
    if alike[best] < max(LEAST_ALIKE, alike[0] + BETTER):
        return None
    right, up = shifts[best]
    return Motion(Pose2D(0.0, 0.0), Pose2D(right * unit, up * unit))


def _wall_faces(cells: NDArray[np.int8], footprint: Footprint) -> NDArray[np.bool_]:
    """Return which pixels are occupied, with a free one beside them, bool (rows, cols)."""
    free = np.pad((cells >= 0) & (cells <= footprint.free_at_most), 1)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    faces: NDArray[np.bool_] = beside & (cells >= footprint.occupied_at_least)
    return faces
