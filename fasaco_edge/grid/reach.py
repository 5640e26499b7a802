"""Reach of a robot: which pixels and cells a change of others affects.

Disc and tool reach beyond the pixel or cell that they stand on, and a step may bend around a
corner. Whatever lies farther from a change than that need not be recomputed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import RobotDiscs, stand_placement
from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.grid.occupancy import OccupancyGrid

# A step may bend over places this far from the centres of its two cells; one pixel for rounding.
REACH_CELLS, REACH_PX = 2.5, 2.0


@dataclass(frozen=True, slots=True)
class Reach:
    """Reach of a robot on a lattice.

    Attributes:
        discs: robot and tool.
        cell_m: edge of a cell [m].
    """

    discs: RobotDiscs
    cell_m: float

    def box(self, cells: Window, geometry: GridGeometry, margin: int) -> Window | None:
        """Return the bounding box in pixels of a window of cells; None for none on the raster.

        Args:
            cells: window of the lattice.
            geometry: of the raster.
            margin: added on each side [pixels].
        """
        placement = stand_placement(geometry, self.cell_m, self.discs.radius_m)
        corners = [
            (
                placement.x0 + placement.ux * col - placement.uy * row,
                placement.y0 + placement.uy * col + placement.ux * row,
            )
            for row in (cells.row0, cells.row1)
            for col in (cells.col0, cells.col1)
        ]
        xs, ys = zip(*corners, strict=True)
        box = Window(
            math.ceil(min(ys)) - margin,
            math.ceil(min(xs)) - margin,
            math.ceil(max(ys)) + margin,
            math.ceil(max(xs)) + margin,
        )
        return box.intersection(_whole(geometry))

    def pixels_of(
        self, cells: NDArray[np.bool_], window: Window, geometry: GridGeometry
    ) -> Window | None:
        """Return a window of pixels around cells that robot and tool reach; None without any.

        Args:
            cells: bool (rows, cols) of the window.
            window: window of the lattice.
            geometry: of the raster.
        """
        found = Window.of(cells)
        if found is None:
            return None
        return self.box(found.moved(window.row0, window.col0), geometry, self._margin(geometry))

    def lost(
        self, grids: tuple[OccupancyGrid, OccupancyGrid], geometry: GridGeometry, parts: int
    ) -> Window | None:
        """Return a window around the previous map's free pixels that the new map does not show.

        They may lie beyond the new map's cells. None without any.

        Args:
            grids: the previous map and the new one.
            geometry: of the raster over the new one.
            parts: pixels of the raster along the edge of a pixel of the map.
        """
        old, new = (grid.geometry.on_raster()[1] for grid in grids)
        lost = []
        for part in old.without(new):
            values = grids[0].cells[part.slices_in(old)]
            free = Window.of((values >= 0) & (values <= self.discs.free_at_most))
            lost.append(free and free.moved(part.row0 - new.row0, part.col0 - new.col0))
        around = Window.around(*lost)
        if around is None:
            return None
        (row, col), margin = geometry.corner_of(grids[1].geometry.snapped()), self._margin(geometry)
        return Window(
            around.row0 * parts + row - margin,
            around.col0 * parts + col - margin,
            around.row1 * parts + row + margin,
            around.col1 * parts + col + margin,
        ).intersection(_whole(geometry))

    def _margin(self, geometry: GridGeometry) -> int:
        """Return how far robot and tool reach from a pixel, in pixels."""
        return int(max(self.discs.clear_m, self.discs.tool_m / 2) / geometry.resolution) + 2


def _whole(geometry: GridGeometry) -> Window:
    return Window(0, 0, geometry.rows, geometry.cols)
