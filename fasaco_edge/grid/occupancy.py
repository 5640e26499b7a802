"""Occupancy grids: equations (1) and (2) of the paper, with ROS's values."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, PatchWithoutBase
from fasaco_edge.grid.geometry import GridGeometry, Window

UNKNOWN = -1
FREE = 0
OCCUPIED = 100


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """A map of what is free, occupied and unknown.

    Attributes:
        geometry: size, resolution and place.
        cells: int8 (rows, cols), read-only; -1 unknown, 0 free .. 100 occupied
            (the probability of equation (2) in percent).
        frame: name of the map frame.
        stamp_ns: time of the map [ns], by its publisher's clock.
    """

    geometry: GridGeometry
    cells: NDArray[np.int8]
    frame: str = "map"
    stamp_ns: int = 0

    def __post_init__(self) -> None:
        expected = (self.geometry.rows, self.geometry.cols)
        if self.cells.shape != expected or self.cells.dtype != np.int8:
            raise ValueError(
                f"cells must be int8 {expected}, got {self.cells.dtype} {self.cells.shape}"
            )
        if self.cells.flags.writeable:
            view = self.cells.view()
            view.flags.writeable = False
            object.__setattr__(self, "cells", view)

    def patched(self, *patches: MapPatch) -> OccupancyGrid:
        """Return this map with ``patches`` laid over it, one after the other; at one copy of it.

        Raises:
            PatchWithoutBase: one does not lie inside this map, or is in another frame.
        """
        for patch in patches:
            self.check_patch(patch)
        if not patches:
            return self
        cells = self.cells.copy()
        for patch in patches:
            window = patch.window
            cells[window.row0 : window.row1, window.col0 : window.col1] = patch.cells
        return OccupancyGrid(self.geometry, cells, self.frame, patches[-1].stamp_ns)

    def check_patch(self, patch: MapPatch) -> None:
        """Check that a patch can be laid over this map.

        Raises:
            PatchWithoutBase: it does not lie inside this map, or is in another frame.
        """
        window = patch.window
        rows, cols = self.cells.shape
        if window.intersection(Window(0, 0, rows, cols)) != window:
            raise PatchWithoutBase(
                f"update of rows {window.row0}..{window.row1}, columns {window.col0}.."
                f"{window.col1} does not lie inside the map of {rows} x {cols} cells"
            )
        if patch.frame != self.frame:
            raise PatchWithoutBase(f"update in frame {patch.frame!r}, map in {self.frame!r}")


def fitting(
    grid: OccupancyGrid, patches: Iterable[MapPatch]
) -> tuple[list[MapPatch], list[FasacoError]]:
    """Return which of some patches can be laid over a map, and why the others cannot."""
    fit: list[MapPatch] = []
    misfits: list[FasacoError] = []
    for patch in patches:
        try:
            grid.check_patch(patch)
        except PatchWithoutBase as error:
            misfits.append(error.with_traceback(None))
        else:
            fit.append(patch)
    return fit, misfits


@dataclass(frozen=True, slots=True, eq=False)
class MapPatch:
    """New values for a window of the last full map (map_msgs/OccupancyGridUpdate).

    Attributes:
        window: which cells of the map.
        cells: int8 (window.rows, window.cols), values as in ``OccupancyGrid``.
        frame: name of the map frame.
        stamp_ns: time of the update [ns].
    """

    window: Window
    cells: NDArray[np.int8]
    frame: str = "map"
    stamp_ns: int = 0
