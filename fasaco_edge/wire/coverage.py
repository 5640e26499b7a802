"""How far the mission is, as an occupancy grid on the lattice: any map viewer shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels import cells as cell

UNKNOWN = -1
TO_COVER = 0
COVERED = 50
RECOVERED = 75
BLOCKED = 100


def lattice_geometry(window: Window, cell_m: float) -> GridGeometry:
    """Return the placement of a window of the coverage lattice, cells ``cell_m`` [m] wide."""
    corner = Pose2D(window.col0 * cell_m, window.row0 * cell_m)
    return GridGeometry(window.rows, window.cols, cell_m, corner)


def coverage_grid(
    window: Window,
    cell_m: float,
    states: NDArray[np.uint8],
    visits: NDArray[np.uint16],
    frame: str = "map",
    stamp_ns: int = 0,
) -> OccupancyGrid:
    """Return the coverage of ``window``, to be sent by ``encode_occupancy_grid``.

    Args:
        window: which cells of the lattice.
        cell_m: edge of a cell [m].
        states: uint8 (rows, cols), the lattice's: UNKNOWN, BLOCKED or COVERABLE.
        visits: uint16 (rows, cols), how often the robot has been in each cell.
        frame: name of the map frame.
        stamp_ns: time of the coverage [ns].
    """
    values = np.full(states.shape, UNKNOWN, np.int8)
    values[states == cell.BLOCKED] = BLOCKED
    coverable = states == cell.COVERABLE
    values[coverable] = TO_COVER
    values[coverable & (visits == 1)] = COVERED
    values[coverable & (visits > 1)] = RECOVERED
    return OccupancyGrid(lattice_geometry(window, cell_m), values, frame, stamp_ns)
