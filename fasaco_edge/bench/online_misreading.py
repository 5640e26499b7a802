"""A scanner that takes some cells for the opposite of what they are, until it is near.

A free cell drawn for it has a speck in its middle that no robot gets past; an obstacle is
clear as far as a robot needs it to be. Which cells these are is drawn before the mission;
what is once seen from near by is never misread again.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from fasaco_edge.bench.online_buildings import Building
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN
from fasaco_edge.grid.occupancy import FREE, OCCUPIED
from fasaco_edge.grid.occupancy import UNKNOWN as UNSEEN

# What is nearer than this is seen as it is [m].
SURE_M = 1.0

Part = tuple[slice, slice]


class Misreading:
    """What a robot believes of a building's pixels.

    Attributes:
        far: the truth as far as it is in reach so far, int8 (rows, cols).
        near: the truth that was seen from near by, int8 (rows, cols).
    """

    def __init__(self, building: Building, share: float, seed: int) -> None:
        truth = building.truth.cells
        self.far, self.near = np.full_like(truth, UNSEEN), np.full_like(truth, UNSEEN)
        self._wrong = truth.copy()
        lattice, geometry = building.lattice, building.truth.geometry
        cell_px = building.footprint.cell_m / geometry.resolution
        lane_px = 0.5 * cell_px + building.footprint.robot_radius_m / geometry.resolution
        drawn = Generator(PCG64(seed)).random(lattice.states.shape) < share
        corner = (lattice.window.row0, lattice.window.col0)
        cells = np.argwhere(drawn & (lattice.states != UNKNOWN))
        centres = lattice.centres((cells + corner).astype(np.int32))
        for (row, col), centre in zip(cells.tolist(), centres.tolist(), strict=True):
            x, y = geometry.to_pixels(*centre)
            if lattice.states[row, col] == BLOCKED:
                self._wrong[_square(x, y, lane_px)] = FREE
            else:
                self._wrong[_square(x, y, 0.5)] = OCCUPIED

    def believed(self, part: Part) -> NDArray[np.int8]:
        """Return what the robot takes a part of the building for, int8."""
        near = self.near[part]
        far = np.where(self.far[part] == UNSEEN, UNSEEN, self._wrong[part])
        believed: NDArray[np.int8] = np.where(near == UNSEEN, far, near).astype(np.int8)
        return believed


def _square(x: float, y: float, reach: float) -> Part:
    """Return the pixels within ``reach`` of a point in both directions."""
    return (
        slice(max(math.floor(y - reach), 0), max(math.ceil(y + reach), 0)),
        slice(max(math.floor(x - reach), 0), max(math.ceil(x + reach), 0)),
    )
