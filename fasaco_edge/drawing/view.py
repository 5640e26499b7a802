"""Which part of the map frame a picture shows, and at what scale."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import UNKNOWN, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid

MAX_WIDTH, MAX_HEIGHT = 1760, 1600
MAX_CELL = 36
MARGIN_CELLS = 1.0

# Three samples a pixel and axis look better, two need less memory.
FINE, COARSE = 3, 2
FINE_UP_TO = 1_200_000

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class View:
    """A rectangle of the map frame as a rectangle of pixels, y upwards.

    Attributes:
        left, top: map coordinates of the upper left corner [m].
        scale: pixels per metre of the finished picture.
        width, height: size of the finished picture [px].
        oversampling: samples per pixel and axis while it is drawn.
    """

    left: float
    top: float
    scale: float
    width: int
    height: int
    oversampling: int

    @classmethod
    def over(
        cls,
        bounds: Bounds,
        cell_m: float,
        widest: int = MAX_WIDTH,
        highest: int = MAX_HEIGHT,
    ) -> View:
        """Return a view of ``bounds`` (x0, y0, x1, y1) [m], with a margin around.

        Args:
            bounds: what to show.
            cell_m: edge of a cell [m], the width of the margin.
            widest, highest: the most room there is [px].
        """
        margin = MARGIN_CELLS * cell_m
        x0, y0, x1, y1 = bounds
        wide, high = x1 - x0 + 2 * margin, y1 - y0 + 2 * margin
        scale = min(MAX_CELL / cell_m, widest / wide, highest / high)
        width, height = max(round(wide * scale), 1), max(round(high * scale), 1)
        oversampling = FINE if width * height <= FINE_UP_TO else COARSE
        return cls(x0 - margin, y1 + margin, scale, width, height, oversampling)

    @property
    def samples_per_metre(self) -> float:
        """Scale of the oversampled picture."""
        return self.scale * self.oversampling

    def samples(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the places in the oversampled picture of points (x, y) [m], both (n, 2)."""
        corner, up = np.array([self.left, self.top]), np.array([1.0, -1.0])
        samples: NDArray[np.float64] = (points - corner) * up * self.samples_per_metre
        return samples


def bounds_of(
    grid: OccupancyGrid | None, lattice: CoverageLattice, points: NDArray[np.float64]
) -> Bounds:
    """Return the bounds [m] of all that is known: of the map, or else the lattice, and points."""
    corners = [_known_corners(lattice if grid is None else grid), points]
    everything = np.concatenate([part for part in corners if len(part)] or [np.zeros((1, 2))])
    x0, y0 = everything.min(axis=0)
    x1, y1 = everything.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def bounds_around(centres: NDArray[np.float64], cell_m: float) -> Bounds:
    """Return the bounds [m] of cells, n >= 1, by their centres, float64 (n, 2)."""
    x0, y0 = (centres.min(axis=0) - cell_m / 2).tolist()
    x1, y1 = (centres.max(axis=0) + cell_m / 2).tolist()
    return x0, y0, x1, y1


def _known_corners(source: OccupancyGrid | CoverageLattice) -> NDArray[np.float64]:
    if isinstance(source, CoverageLattice):
        box = _box(source.states != UNKNOWN)
        window, cell_m = source.window, source.cell_m
        corner = np.array([window.col0, window.row0], np.float64)
        return (_corners(box) + corner) * cell_m
    geometry = source.geometry
    corners = _corners(_box(source.cells >= 0))
    return np.array([geometry.to_map(col, row) for col, row in corners]).reshape(-1, 2)


def _box(mask: NDArray[np.bool_]) -> Window:
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return Window(0, 0, *mask.shape)
    return Window(int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1)


def _corners(box: Window) -> NDArray[np.float64]:
    pairs = itertools.product((box.col0, box.col1), (box.row0, box.row1))
    return np.array(list(pairs), np.float64)
