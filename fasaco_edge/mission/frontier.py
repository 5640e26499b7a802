"""The frontier: cells the robot can come to, beside what the map does not know yet."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fasaco_edge.grid.lattice import UNKNOWN, Cell
from fasaco_edge.mission.ground import Ground
from fasaco_edge.mission.polygons import Polygon

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
