"""Flows: runs of cells whose trail has the same direction, drawn as arrows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.rotation import rotated_points
from fasaco_edge.kernels import COL_STEP, EAST, NORTH, ROW_STEP

# A run ends where the share of its direction changes by more than this from one cell to the next.
DECIDED_APART = 0.2
# Bytes of an arrow in the file: origin, vector, colour.
ARROW_BYTES = 2 * 12 + 4


@dataclass(frozen=True, slots=True, eq=False)
class Flows:
    """Arrows along a trail.

    Attributes:
        origins: float64 (n, 2) [m].
        vectors: float64 (n, 2) [m].
        share: float64 (n,), mean share of a cell's pheromone in the arrow's direction.
    """

    origins: NDArray[np.float64]
    vectors: NDArray[np.float64]
    share: NDArray[np.float64]

    @property
    def size_bytes(self) -> int:
        """Size in a file [bytes]."""
        return ARROW_BYTES * len(self.origins)


def flows_of(
    geometry: GridGeometry, pointed: NDArray[np.int8], share: NDArray[np.float32]
) -> Flows:
    """Return an arrow for each straight run of cells with the same direction.

    An arrow leads from the centre of the first cell to the centre of the cell after the last one.
    A cell with four equal directions has no arrow.

    Args:
        geometry: size and place of the grid of cells.
        pointed: int8 (rows, cols), direction 0..3 of the trail, -1 for none.
        share: float32 (rows, cols), share of the cell's pheromone in that direction.
    """
    rows, cols = pointed.shape
    begins: list[tuple[int, int, int, int, float]] = []
    for direction in (EAST, NORTH, EAST + 2, NORTH + 2):
        up, right = ROW_STEP[direction], COL_STEP[direction]
        # A cell begins a run if the cell behind it has another direction.
        marked = np.pad((pointed == direction) & (share > 0.25 + 1e-6), 1)
        decided = np.pad(share, 1)
        before = (slice(1 - up, rows + 1 - up), slice(1 - right, cols + 1 - right))
        inner = slice(1, rows + 1), slice(1, cols + 1)
        apart = np.abs(decided[inner] - decided[before]) > DECIDED_APART
        first = marked[inner] & (~marked[before] | apart)
        for row, col in np.argwhere(first).tolist():
            length, at_row, at_col, total = 0, row, col, 0.0
            while True:
                total += float(share[at_row, at_col])
                length, at_row, at_col = length + 1, at_row + up, at_col + right
                inside = 0 <= at_row < rows and 0 <= at_col < cols
                if not inside or not marked[at_row + 1, at_col + 1] or first[at_row, at_col]:
                    break
            begins.append((row, col, up * length, right * length, total / length))
    found = np.array(begins, np.float64).reshape(-1, 5)
    edge, origin = geometry.resolution, geometry.origin
    yaw_deg = math.degrees(origin.yaw)
    centres = rotated_points((found[:, 1::-1] + 0.5) * edge, yaw_deg)
    centres += (origin.x, origin.y)
    return Flows(centres, rotated_points(found[:, 3:1:-1] * edge, yaw_deg), found[:, 4])
