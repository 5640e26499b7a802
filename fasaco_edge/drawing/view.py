"""Which part of the map frame a picture shows, and at what scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Bounds, Window
from fasaco_edge.grid.lattice import UNKNOWN, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid, known_bounds

MAX_WIDTH, MAX_HEIGHT = 1760, 1600
MAX_CELL = 36
MARGIN_CELLS = 1.0

# Three samples a pixel and axis look better, two need less memory.
FINE, COARSE = 3, 2
FINE_UP_TO = 1_200_000


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
            widest, highest: the most the picture may take [px].
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
    if grid is not None:
        known = known_bounds(grid) or grid.geometry.bounds()
    else:
        box = Window.of(lattice.states != UNKNOWN) or Window(0, 0, *lattice.states.shape)
        here = box.moved(lattice.window.row0, lattice.window.col0)
        x0, y0, x1, y1 = (
            lattice.cell_m * at for at in (here.col0, here.row0, here.col1, here.row1)
        )
        known = x0, y0, x1, y1
    if not len(points):
        return known
    corners = np.concatenate([np.reshape(known, (2, 2)), points])
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return x0, y0, x1, y1
