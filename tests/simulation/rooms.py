"""Hand-made buildings, and paths through them."""

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid

RESOLUTION = 0.05
CELL = 0.4


def building(width_m, height_m, *walls, origin=None):
    """A walled room [m]; walls are blocks (x0, y0, x1, y1) [m] from its lower left corner."""
    rows, cols = round(height_m / RESOLUTION), round(width_m / RESOLUTION)
    cells = np.zeros((rows, cols), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    for wall in walls:
        col0, row0, col1, row1 = (round(edge / RESOLUTION) for edge in wall)
        cells[row0:row1, col0:col1] = 100
    geometry = GridGeometry(rows, cols, RESOLUTION, origin or Pose2D(0.0, 0.0))
    return OccupancyGrid(geometry, cells)


def centres(*cells):
    """Waypoints at the centres of cells (row, col)."""
    return (np.array(cells, np.float64).reshape(-1, 2)[:, ::-1] + 0.5) * CELL


def serpentine(rows, cols):
    """A walk over all cells of rows x cols, lane by lane."""
    lanes = [[(row, col) for col in cols] for row in rows]
    return centres(
        *(cell for index, lane in enumerate(lanes) for cell in (lane[::-1] if index % 2 else lane))
    )


def distances_to(polyline, points):
    """How far each point is from a polyline: the nearest of its segments."""
    begin, step = polyline[:-1], np.diff(polyline, axis=0)
    length2 = (step**2).sum(axis=1)
    nearest = np.full(len(points), np.inf)
    for point, square, vector in zip(begin, length2, step, strict=True):
        along = np.clip(((points - point) @ vector) / square, 0, 1)
        off = points - point - along[:, np.newaxis] * vector
        nearest = np.minimum(nearest, np.hypot(off[:, 0], off[:, 1]))
    return nearest
