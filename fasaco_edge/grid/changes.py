"""Lattice changes: incremental update of the coverage lattice to a new map.

A map that was patched, or has grown, shrunk or moved by whole pixels, stays on its raster: pixels
are compared, and only cells near changed pixels are reclassified. A map whose origin has moved by a
fraction of a pixel, or was rotated, lies on another raster: all cells are reclassified. In both
cases the lattice equals, bit for bit, ``CoverageLattice.from_map`` of the new map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Window
from fasaco_edge.grid.lattice import (
    UNKNOWN,
    CoverageLattice,
    Footprint,
    lattice_window,
    pixels_of,
    placement_of,
)
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.lattice.changes import mark_stale
from fasaco_edge.kernels.lattice.classification import Cells, classify_cells
from fasaco_edge.kernels.lattice.footprint import Box, Placement, Thresholds

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class LatticeChange:
    """A lattice over a new map, and the cells that changed from the previous one.

    Attributes:
        before: the previous lattice; None for the first.
        after: the lattice over the new map; the previous object if no cell has changed.
        cells: int32 (n, 2), read-only: (row, col) of each cell whose state or steps have
            changed. A lattice is unknown outside its window, so a known cell that entered or left
            the window has changed.
    """

    before: CoverageLattice | None
    after: CoverageLattice
    cells: NDArray[np.int32]

    def __post_init__(self) -> None:
        self.cells.flags.writeable = False

    def __bool__(self) -> bool:
        """Return whether any cell has changed."""
        return len(self.cells) > 0

    @property
    def window(self) -> Window | None:
        """The smallest window around the changed cells; None for none."""
        if not len(self.cells):
            return None
        row0, col0 = self.cells.min(axis=0).tolist()
        row1, col1 = self.cells.max(axis=0).tolist()
        return Window(row0, col0, row1 + 1, col1 + 1)

    @classmethod
    def first(
        cls, grid: OccupancyGrid, footprint: Footprint, max_cells: int = MAX_LATTICE_CELLS
    ) -> Self:
        """Return the lattice over a first map.

        Raises:
            MapTooLarge: it would have more than ``max_cells`` cells, or the pixels are too small.
            MapTooFar: it would reach too far from the origin, see ``lattice_window``.
        """
        lattice = CoverageLattice.from_map(grid, footprint, max_cells)
        return cls(None, lattice, _cells_where(lattice.states != UNKNOWN, lattice.window))

    @classmethod
    def between(
        cls,
        grids: tuple[OccupancyGrid, OccupancyGrid],
        lattice: CoverageLattice,
        footprint: Footprint,
        max_cells: int = MAX_LATTICE_CELLS,
        within: Window | None = None,
    ) -> Self:
        """Return the change of ``lattice`` from one map to the next.

        Args:
            grids: the previous map and the new one.
            lattice: the lattice over the previous map, made for ``footprint``.
            footprint: footprint of the lattice.
            max_cells: limit on the cells of the new lattice.
            within: window of the pixels (row, col) that may differ if the map has not moved, such
                as a patch's window; only these pixels are compared. None for all.

        Raises:
            MapTooLarge: the new lattice would have more than ``max_cells`` cells, or the pixels
                are too small.
            MapTooFar: it would reach too far from the origin, see ``lattice_window``.
        """
        window = lattice_window(grids[1].geometry, footprint.cell_m, max_cells)
        placement = placement_of(grids[1].geometry, footprint)
        stale = cells_near_changes(grids, window, placement, footprint.thresholds, within)
        stale |= new_cells(lattice.window, window)
        if window == lattice.window and not stale.any():
            return cls(lattice, lattice, np.empty((0, 2), np.int32))
        states = carried_copy(lattice.states, lattice.window, window)
        steps = carried_copy(lattice.steps, lattice.window, window)
        classify_cells(
            pixels_of(grids[1]),
            placement,
            footprint.thresholds,
            Cells(states, steps, stale, window.row0, window.col0),
        )
        return cls.to(lattice, CoverageLattice(window, footprint.cell_m, states, steps))

    @classmethod
    def to(cls, before: CoverageLattice, after: CoverageLattice) -> Self:
        """Compare two lattices; the previous object is kept if no cell has changed."""
        old, new = before.window, after.window
        changed = _cells_where(
            (after.states != carried(before.states, old, new))
            | (after.steps != carried(before.steps, old, new)),
            new,
        )
        if new != old:
            lost = (before.states != UNKNOWN) & new_cells(new, old)
            changed = np.concatenate((changed, _cells_where(lost, old)))
        elif not len(changed):
            return cls(before, before, changed)
        return cls(before, after, changed)


def windows_on_raster(grids: tuple[OccupancyGrid, OccupancyGrid]) -> tuple[Window, Window] | None:
    """Return the windows of both maps on their raster; None if they are on different rasters."""
    (old_raster, old), (raster, new) = (grid.geometry.on_raster() for grid in grids)
    return (old, new) if raster == old_raster else None


def carried(array: NDArray[Scalar], old: Window, new: Window, beyond: float = 0) -> NDArray[Scalar]:
    """Return the array (rows, cols, ...) of an old window on a new window.

    If the windows are equal, the array itself is returned.

    Args:
        array: values on the old window.
        old, new: the windows.
        beyond: value outside of the old window.
    """
    if new == old:
        return array
    result = np.empty((new.rows, new.cols, *array.shape[2:]), array.dtype)
    for part in new.without(old):
        result[part.slices_in(new)] = beyond
    common = new.intersection(old)
    if common is not None:
        result[common.slices_in(new)] = array[common.slices_in(old)]
    return result


def carried_copy(
    array: NDArray[Scalar], old: Window, new: Window, beyond: float = 0
) -> NDArray[Scalar]:
    """Return an array as ``carried`` does, but always a new one."""
    result = carried(array, old, new, beyond)
    return result.copy() if result is array else result


def cells_near_changes(
    grids: tuple[OccupancyGrid, OccupancyGrid],
    window: Window,
    placement: Placement,
    thresholds: Thresholds,
    within: Window | None,
) -> NDArray[np.bool_]:
    """Return which cells of the new window are near changed pixels, bool (rows, cols).

    Everything outside a map is unknown, so unknown pixels that it gains or loses are no change.

    Args:
        grids: the previous map and the new one.
        window: window of the lattice over the new map.
        placement: placement of its cells; pixels affect cells within a distance of ``reach_of``.
        thresholds: thresholds of free and occupied.
        within: see ``LatticeChange.between``.
    """
    windows = windows_on_raster(grids)
    if windows is None:
        return np.ones((window.rows, window.cols), np.bool_)
    old, new = windows
    common = old.intersection(new)
    regions = (*((common,) if common else ()), *new.without(old), *old.without(new))
    if old == new and within is not None:
        regions = (within.moved(new.row0, new.col0),)
    near = np.zeros((window.rows, window.cols), np.bool_)
    before, after = (pixels_of(grid) for grid in grids)
    for region in regions:
        mark_stale(
            before,
            after,
            Box(region.row0, region.col0, region.row1, region.col1),
            thresholds,
            placement,
            near,
            window.row0,
            window.col0,
        )
    return near


def new_cells(old: Window, new: Window) -> NDArray[np.bool_]:
    """Mark the cells of the new window that the old one lacks, bool (rows, cols).

    They are always classified, as a robot wider than its tool may be blocked there. Old cells gain
    steps into new cells only near changed pixels, as everything outside a map is unknown.
    """
    return ~carried(np.ones((old.rows, old.cols), np.bool_), old, new)


def _cells_where(mask: NDArray[np.bool_], window: Window) -> NDArray[np.int32]:
    """Return the cells (row, col), int32 (n, 2), that are marked in a mask over ``window``."""
    rows, cols = np.divmod(np.flatnonzero(mask), max(window.cols, 1))
    cells = np.stack((rows + window.row0, cols + window.col0), axis=1)
    return cells.astype(np.int32)
