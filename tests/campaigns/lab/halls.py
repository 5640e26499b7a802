"""A hall without furniture, for tests of the lab's parts."""

from __future__ import annotations

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from tests.campaigns.lab.building import Building

PIXEL_M = 0.05


def hall(length_m: float = 4.0, width_m: float = 1.0, yaw: float = 0.0) -> Building:
    """Return a hall with its corner at the origin, and walls of a pixel; start at 0.5, 0.5."""
    shape = round(width_m / PIXEL_M) + 2, round(length_m / PIXEL_M) + 2
    occupied = np.zeros(shape, bool)
    occupied[[0, -1], :] = occupied[:, [0, -1]] = True
    geometry = GridGeometry(*shape, PIXEL_M, Pose2D(-PIXEL_M, -PIXEL_M))
    start = Pose2D(0.5, 0.5, yaw)
    return Building("hall", geometry, occupied, np.zeros(shape, bool), start)
