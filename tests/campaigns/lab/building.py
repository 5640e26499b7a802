"""Buildings that the lab's robot drives in: the walls as they are, and where it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.map_files import find_map, read_map, suggested_start
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Building:
    """A building: its true map.

    Attributes:
        name: its name.
        geometry: placement of its pixels; without yaw.
        occupied, unknown: bool (rows, cols), row 0 has the smallest y.
        start: where the robot starts.
    """

    name: str
    geometry: GridGeometry
    occupied: Mask
    unknown: Mask
    start: Pose2D

    @classmethod
    def read(
        cls, name: str, folder: Path | None = None, start: Sequence[float] | None = None
    ) -> Building:
        """Read a building.

        Args:
            name: of a built-in map, a file, or a map of ``folder``.
            folder: further maps; None for none.
            start: x, y [m], yaw [rad]; None for the suggested place, or else the widest one.

        Raises:
            MapFileError: there is no such map.
        """
        beside = folder / f"{name}.yaml" if folder else None
        path = beside if beside is not None and beside.is_file() else find_map(name)
        grid = read_map(path)
        occupied, unknown = grid.cells == OCCUPIED, grid.cells == UNKNOWN
        if start is None:
            start = suggested_start(path) or _widest_place(grid.geometry, grid.cells == FREE)
        x, y, yaw = (*start, 0.0)[:3]
        return cls(path.stem, grid.geometry, occupied, unknown, Pose2D(x, y, yaw))

    @property
    def free_m2(self) -> float:
        """Return the area of its free floor [m2]."""
        free = ~(self.occupied | self.unknown)
        return float(np.count_nonzero(free)) * self.geometry.resolution**2

    def fine(self, mask: Mask, pixel_m: float) -> Mask:
        """Return one of its masks on pixels of at most ``pixel_m`` [m]."""
        split = self.split(pixel_m)
        return mask.repeat(split, axis=0).repeat(split, axis=1)

    def split(self, pixel_m: float) -> int:
        """Return by how much its pixels are divided to be of at most ``pixel_m`` [m]."""
        return max(int(np.ceil(self.geometry.resolution / pixel_m - 1e-9)), 1)


def _widest_place(geometry: GridGeometry, free: Mask) -> tuple[float, float]:
    """Return the free place that is furthest from all that is not."""
    distance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(int(np.argmax(distance)), free.shape)
    return geometry.to_map(float(col) + 0.5, float(row) + 0.5)
