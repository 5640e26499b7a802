"""Truth of a mission: the floor that can be swept, and that was, by the true poses alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from tests.campaigns.lab.building import Building, Mask
from tests.campaigns.lab.settings import RESOLUTION_M

# Largest pixel [m].
FINE_M = 0.0125
# Distances of whole pixels are reached [pixels].
ROUNDING_PX = 1e-6
# Patches below this are left out [m2].
LEAST_M2 = 0.01
# The floor is published as percent swept; from here on it is claimed.
CLAIMED_AT = 50


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A building's floor on fine pixels.

    Attributes:
        geometry: placement of the pixels.
        occupied: walls, bool (rows, cols).
        free: known free.
        reachable: the floor that the tool's disc touches where the robot's disc fits and comes to
            from its start.
        clear: the same for a disc that is larger by a pixel of the robot's map: what lies nearer to
            walls no map of such pixels shows for certain.
        swept: the floor that the tool's disc passed over.
        claimed: the floor that the product says was swept.
    """

    geometry: GridGeometry
    occupied: Mask
    free: Mask
    reachable: Mask
    clear: Mask
    swept: Mask
    claimed: Mask

    @classmethod
    def of(
        cls,
        building: Building,
        radius_m: float,
        tool_m: float,
        xy: NDArray[np.float64],
        floor: OccupancyGrid | None,
    ) -> Truth:
        """Return the truth of a mission.

        Args:
            building: where it was.
            radius_m, tool_m: radius of the robot's disc, and width of its tool [m].
            xy: float64 (n, 2), the true positions.
            floor: the floor swept as the product says, percent; None for none.
        """
        rough, split = building.geometry, building.split(FINE_M)
        pixel_m = rough.resolution / split
        shape = rough.rows * split, rough.cols * split
        geometry = GridGeometry(*shape, pixel_m, rough.origin)
        occupied = building.fine(building.occupied, FINE_M)
        free = ~(occupied | building.fine(building.unknown, FINE_M))
        # A wall begins half a pixel before the centre of its first one.
        room_m = (ndimage.distance_transform_edt(free) - 0.5) * pixel_m
        tool_px = 0.5 * tool_m / pixel_m
        reachable, clear = (
            _touched(_connected(room_m > disc_m, geometry, xy[0]), tool_px) & free
            for disc_m in (radius_m, radius_m + RESOLUTION_M)
        )
        swept = _within(geometry, xy, tool_px)
        return cls(geometry, occupied, free, reachable, clear, swept, claimed_on(geometry, floor))

    def m2(self, mask: Mask) -> float:
        """Return the area of a mask [m2]."""
        return float(np.count_nonzero(mask)) * self.geometry.resolution**2

    def share(self, floor: Mask) -> float:
        """Return the swept share of some floor."""
        return self.m2(self.swept & floor) / max(self.m2(floor), self.geometry.resolution**2)

    def missed(self, most: int) -> list[tuple[float, float, float]]:
        """Return the largest patches that were not swept: area [m2], x, y [m]; no tiny ones."""
        patches, count = ndimage.label(self.reachable & ~self.swept)
        if not count:
            return []
        numbers = np.arange(1, count + 1)
        pixels = ndimage.sum_labels(np.ones(patches.shape), patches, numbers)
        largest = np.argsort(-pixels, kind="stable")[:most]
        largest = largest[pixels[largest] * self.geometry.resolution**2 >= LEAST_M2]
        centres = ndimage.center_of_mass(patches > 0, patches, numbers[largest])
        found = []
        for i, (row, col) in zip(largest, centres, strict=True):
            x, y = self.geometry.to_map(col + 0.5, row + 0.5)
            m2 = float(pixels[i]) * self.geometry.resolution**2
            found.append((round(m2, 3), round(x, 2), round(y, 2)))
        return found


def _within(geometry: GridGeometry, xy: NDArray[np.float64], pixels: float) -> Mask:
    """Return the pixels whose centres are at most so far from a track [pixels]."""
    between = 0.5 * (xy[1:] + xy[:-1])
    cols, rows = geometry.to_pixels(*np.concatenate([xy, between]).T)
    at = rows.astype(int), cols.astype(int)
    off = np.ones((geometry.rows, geometry.cols), bool)
    off[at] = False
    # Where in its pixel the track is.
    there = np.zeros((2, geometry.rows, geometry.cols), np.float32)
    there[:, *at] = rows - at[0] - 0.5, cols - at[1] - 0.5
    nearest = ndimage.distance_transform_edt(off, return_distances=False, return_indices=True)
    down, right = (
        nearest[axis] + there[axis][tuple(nearest)] - place
        for axis, place in enumerate(np.ogrid[0 : geometry.rows, 0 : geometry.cols])
    )
    near: Mask = np.hypot(down, right) <= pixels
    return near


def _touched(stands: Mask, pixels: float) -> Mask:
    """Return what lies at most so far from where the robot can stand [pixels]."""
    if not stands.any():
        return stands
    touched: Mask = ndimage.distance_transform_edt(~stands) <= pixels + ROUNDING_PX
    return touched


def _connected(fits: Mask, geometry: GridGeometry, start: NDArray[np.float64]) -> Mask:
    """Return the part of ``fits`` that is connected with the place nearest to ``start``."""
    labels, _ = ndimage.label(fits)
    rows, cols = np.nonzero(labels)
    if not len(rows):
        return fits
    col, row = geometry.to_pixels(float(start[0]), float(start[1]))
    nearest = int(np.argmin(np.hypot(rows + 0.5 - row, cols + 0.5 - col)))
    part: Mask = labels == labels[rows[nearest], cols[nearest]]
    return part


def values_on(geometry: GridGeometry, grid: OccupancyGrid) -> NDArray[np.int8]:
    """Return a grid's values at the centres of other pixels; UNKNOWN beyond it."""
    values = np.full((geometry.rows, geometry.cols), UNKNOWN, np.int8)
    rows, cols = np.mgrid[0 : geometry.rows, 0 : geometry.cols]
    x = geometry.origin.x + (cols + 0.5) * geometry.resolution
    y = geometry.origin.y + (rows + 0.5) * geometry.resolution
    there_cols, there_rows = (np.floor(axis) for axis in grid.geometry.to_pixels(x, y))
    inside = (there_cols >= 0) & (there_rows >= 0)
    inside &= (there_cols < grid.geometry.cols) & (there_rows < grid.geometry.rows)
    at = there_rows[inside].astype(int), there_cols[inside].astype(int)
    values[inside] = grid.cells[at]
    return values


def claimed_on(geometry: GridGeometry, floor: OccupancyGrid | None) -> Mask:
    """Return which pixels the product says were swept, in the map frame."""
    if floor is None:
        return np.zeros((geometry.rows, geometry.cols), bool)
    claimed: Mask = values_on(geometry, floor) >= CLAIMED_AT
    return claimed


def turns_between(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turns from each heading to the next, float64 (n - 1,), in [-pi, pi) [rad]."""
    turned: NDArray[np.float64] = (np.diff(yaw) + math.pi) % math.tau - math.pi
    return turned
