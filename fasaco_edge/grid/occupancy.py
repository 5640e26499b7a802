"""Occupancy grids: equations (1) and (2) of the paper, with the values of ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, PatchWithoutBase
from fasaco_edge.grid.geometry import Bounds, GridGeometry, Window

_Value = TypeVar("_Value", np.int8, np.uint8)

UNKNOWN = -1
FREE = 0
OCCUPIED = 100

# Pixels processed at once: a mask of all pixels would take as much memory as the map.
BLOCK_PIXELS = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """A map of free, occupied and unknown pixels.

    Attributes:
        geometry: size, resolution and placement.
        cells: int8 (rows, cols), read-only; -1 unknown, 0 free .. 100 occupied (the probability
            that the pixel is occupied, in percent).
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
        """Return this map with ``patches`` applied in order.

        Raises:
            PatchWithoutBase: a patch is not inside this map, or is in another frame.
        """
        result = self.with_updates(patches)
        for fault in result.faults:
            raise fault
        return result.grid

    def with_updates(self, patches: Iterable[MapPatch]) -> UpdatedGrid:
        """Apply the patches that fit, in order; the map is copied once."""
        fit: list[MapPatch] = []
        faults: list[FasacoError] = []
        for patch in patches:
            if why := self._misfit(patch):
                hint = "publish the full map again when its size or frame changes, then updates"
                faults.append(PatchWithoutBase(why, hint=hint))
            else:
                fit.append(patch)
        if not fit:
            return UpdatedGrid(self, (), faults)
        cells = self.cells.copy()
        for patch in fit:
            window = patch.window
            cells[window.row0 : window.row1, window.col0 : window.col1] = patch.cells
        grid = OccupancyGrid(self.geometry, cells, self.frame, fit[-1].stamp_ns)
        return UpdatedGrid(grid, tuple(patch.window for patch in fit), faults)

    def _misfit(self, patch: MapPatch) -> str:
        """Return why a patch cannot be applied to this map; "" if it can."""
        window, (rows, cols) = patch.window, self.cells.shape
        if window.intersection(Window(0, 0, rows, cols)) != window:
            return (
                f"update of rows {window.row0}..{window.row1}, columns {window.col0}.."
                f"{window.col1} does not lie inside the map of {rows} x {cols} cells"
            )
        if patch.frame != self.frame:
            return f"update in frame {patch.frame!r}, map in {self.frame!r}"
        return ""


@dataclass(frozen=True, slots=True)
class UpdatedGrid:
    """A map with updates applied.

    Attributes:
        grid: the map; the same object if no update fits.
        windows: windows of the updates that fit, in order.
        faults: why the other updates do not fit.
    """

    grid: OccupancyGrid
    windows: tuple[Window, ...]
    faults: list[FasacoError]


def coarser(grid: OccupancyGrid, most_pixels: int) -> OccupancyGrid:
    """Return a map of about ``most_pixels`` or fewer; a pixel has the highest value it joins."""
    factor = math.ceil(math.sqrt(grid.cells.size / most_pixels))
    if factor <= 1:
        return grid
    rows, cols = -(-grid.cells.shape[0] // factor), -(-grid.cells.shape[1] // factor)
    padded = np.full((rows * factor, cols * factor), UNKNOWN, np.int8)
    padded[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    cells = highest(padded, factor)
    resolution = grid.geometry.resolution * factor
    geometry = replace(grid.geometry, rows=rows, cols=cols, resolution=resolution)
    return replace(grid, geometry=geometry, cells=cells)


def highest(values: NDArray[_Value], factor: int) -> NDArray[_Value]:
    """Return the highest value of each block of ``factor`` x ``factor`` values."""
    # Slice by slice, which is many times faster than a maximum over two axes.
    rows = reduce(np.maximum, (values[first::factor] for first in range(factor)))
    return reduce(np.maximum, (rows[:, first::factor] for first in range(factor)))


def without_base(patches: Iterable[MapPatch], *, updates_lost: bool) -> list[FasacoError]:
    """Return a fault for each update that has no map, or follows lost updates."""
    why = "updates before it were lost" if updates_lost else "there is no map yet"
    return [PatchWithoutBase(f"map update refused: {why}") for _ in patches]


@dataclass(frozen=True, slots=True, eq=False)
class MapPatch:
    """New values for a window of the last full map (map_msgs/OccupancyGridUpdate).

    Attributes:
        window: window of the map's cells.
        cells: int8 (window.rows, window.cols), values as in ``OccupancyGrid``.
        frame: name of the map frame.
        stamp_ns: time of the update [ns].
    """

    window: Window
    cells: NDArray[np.int8]
    frame: str = "map"
    stamp_ns: int = 0


def known_bounds(grid: OccupancyGrid) -> Bounds | None:
    """Return the bounds of the known pixels of a map; None without any."""
    window = marked_window(grid.cells.shape, lambda rows: grid.cells[rows] >= FREE)
    return grid.geometry.bounds(window) if window else None


def marked_window(
    shape: tuple[int, int], marked: Callable[[slice], NDArray[np.bool_]]
) -> Window | None:
    """Return the window of marked pixels; ``marked`` returns the mask, bool, of some rows."""
    found = None
    for strip in Window(0, 0, *shape).strips(BLOCK_PIXELS):
        here = Window.of(marked(slice(strip.row0, strip.row1)))
        if here is not None:
            found = Window.around(found, here.moved(strip.row0, 0))
    return found
