"""Floor map: places, stands and the lattice over them, for a map that changes.

If the raster stays, only cells near changed pixels are recomputed (``grid.changes``). The result is
the same as if the new map were the first.

The raster spans whole chunks of the map's pixels. So a growing map seldom moves the raster, and
always by whole words of its bits.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import (
    LatticeChange,
    carried,
    cells_near_changes,
    new_cells,
    windows_on_raster,
)
from fasaco_edge.grid.fine_raster import (
    REACH_CELLS,
    REACH_PX,
    PolygonsOnRaster,
    Reach,
    RobotDiscs,
    blocked_pixels,
    fine_geometry,
    stand_placement,
)
from fasaco_edge.grid.floor import StandLattice, states_of, tool_reach, tool_steps
from fasaco_edge.grid.geometry import GridGeometry, Point, Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell, CoverageLattice, Footprint, placement_of
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import WORD, Bits, packed, unpacked
from fasaco_edge.kernels.floor.places import disc_rows, keep_in_cells, places_of
from fasaco_edge.kernels.lattice.footprint import Placement

# The raster spans whole chunks of this many pixels of the map: for a map of 5 cm pixels 3.2 m.
CHUNK = WORD
# All bits of a word set: pixels beyond a raster are blocked.
BLOCKED_WORD = (1 << WORD) - 1


class FloorMap:
    """Places and stands of a robot on a map.

    Attributes:
        discs: robot and tool.
        geometry: geometry of the fine raster.
        blocked: uint64 (rows, words), see ``kernels.floor.bits``: pixels that are not known free,
            or lie in keep-out polygons.
        places: uint64 (rows, words): pixels whose centre the robot can occupy, reachable or not.
        stands: the lattice of stands.
        revision: incremented with each map.
        shift: shift of pixels on the raster by the newest map, in rows and columns; None for
            another raster.
        touched: window of the raster that the newest map may have changed; None for none.
    """

    geometry: GridGeometry
    blocked: Bits
    places: Bits
    stands: StandLattice
    revision: int = 0
    shift: tuple[int, int] | None
    touched: Window | None

    def __init__(
        self,
        grid: OccupancyGrid,
        plain: CoverageLattice,
        footprint: Footprint,
        discs: RobotDiscs,
        most_pixels: int,
        keep_out: tuple[Polygon, ...] = (),
    ) -> None:
        """Compute the floor of a first map.

        Args:
            grid: the map.
            plain: the lattice of cell centres over it, which gives the unknown cells.
            footprint, discs: the robot and its tool.
            most_pixels: limit on the pixels of the raster.
            keep_out: polygons that the robot must not touch.

        Raises:
            MapTooLarge: the raster would have more pixels.
        """
        self.discs, self._reach = discs, Reach(discs, footprint.cell_m)
        self._footprint, self._most_pixels, self._keep_out = footprint, most_pixels, keep_out
        # The keep-out polygons on the raster, with the geometry they were converted for.
        self._kept_out: tuple[GridGeometry, PolygonsOnRaster] | None = None
        self._compute_all(grid, plain)

    def change(
        self,
        grids: tuple[OccupancyGrid, OccupancyGrid],
        plain: CoverageLattice,
        within: Window | None = None,
    ) -> LatticeChange:
        """Update to the next map; return the change of the lattice.

        Args:
            grids: the previous map and the new one.
            plain: the lattice of cell centres over the new one.
            within: window of the pixels that may differ, see ``LatticeChange.between``.

        Raises:
            MapTooLarge: the raster would have too many pixels; nothing has changed.
        """
        before = self.stands.lattice
        geometry, parts = self._geometry_of(grids[1])
        is_same_raster = geometry.resolution == self.geometry.resolution
        if not is_same_raster or windows_on_raster(grids) is None:
            self._compute_all(grids[1], plain)
            return self._compared(before)
        wide = placement_of(grids[1].geometry, self._footprint)
        scale = self._footprint.cell_m / grids[1].geometry.resolution
        clearance = self.discs.clearance_m / grids[1].geometry.resolution
        wide = wide._replace(radius=wide.radius + clearance + REACH_CELLS * scale + REACH_PX)
        thresholds = self._footprint.thresholds
        near = cells_near_changes(grids, plain.window, wide, thresholds, within)
        self.revision += 1
        self.shift = geometry.corner_of(self.geometry)
        # ``near`` leaves out new cells: along the sides of a grown map they add little floor.
        self.touched = self._reach.pixels_of(near, plain.window, geometry)
        if plain.window != before.window:
            # Floor that the new map does not show may lie beyond its cells.
            lost = cells_near_changes(grids, before.window, wide, thresholds, within)
            lost_pixels = self._reach.pixels_of(lost, before.window, geometry)
            self.touched = Window.around(self.touched, lost_pixels)
        is_same = geometry == self.geometry
        if self.touched is None and is_same and plain.window == before.window:
            return LatticeChange.to(before, self._with_states(plain))
        # On another raster, rounding may shift keep-out polygons.
        if not is_same and (not self._move(geometry, self.shift) or self._keep_out):
            self._compute_places(grids[1], parts, 0, geometry.rows)
        elif self.touched is not None:
            self._compute_places(grids[1], parts, self.touched.row0, self.touched.row1)
        self._compute_stands(plain, near | new_cells(before.window, plain.window))
        return self._compared(before)

    def stand_xy(self, cell: Cell) -> Point | None:
        """Return the stand of a cell, x, y [m]; None for none."""
        lattice = self.stands.lattice
        if not lattice.contains(cell):
            return None
        y, x = self.stands.stands[lattice.local(cell)].tolist()
        return None if math.isnan(y) else self.geometry.to_map(x + 0.5, y + 0.5)

    def box_of(self, cell: Cell, rim_m: float = 0.0) -> Window:
        """Return the bounding box of a cell on the raster, with a rim around it."""
        window = Window(cell[0], cell[1], cell[0] + 1, cell[1] + 1)
        rim = round(rim_m / self.geometry.resolution)
        return self._reach.box(window, self.geometry, rim) or Window(0, 0, 0, 0)

    def reached(self, cells: NDArray[np.bool_], part: Window) -> NDArray[np.bool_]:
        """Return the pixels in a window of the raster that the tool reaches from places in cells.

        The tool reaches no pixel through walls (``tool_reach``).

        Args:
            cells: bool (rows, cols) of the lattice.
            part: window of the raster.

        Returns:
            bool, (rows, cols) of the part.
        """
        radius = self.discs.radius_m / self.geometry.resolution
        tool = self.discs.tool_m / 2 / self.geometry.resolution
        margin = int(max(tool, min(radius, tool) + tool_steps(radius, tool))) + 1
        whole = self.geometry.window
        around = Window(
            part.row0 - margin, part.col0 - margin, part.row1 + margin, part.col1 + margin
        ).intersection(whole)
        assert around is not None
        # Whole words, as pixels farther away have no effect.
        first, end = around.col0 // WORD, -(-around.col1 // WORD)
        found = self.places[around.row0 : around.row1, first:end].copy()
        lattice = self.stands.lattice
        window = lattice.window
        if (lattice.coverable & ~cells).any():
            cell, corner = (window.row0, window.col0), (around.row0, first * WORD)
            keep_in_cells(found, self.placement, cells, cell, corner)
        words = Window(around.row0, first * WORD, around.row1, end * WORD)
        blocked = self.blocked[around.row0 : around.row1, first:end]
        reached = unpacked(tool_reach(found, blocked, radius, tool), words.cols)
        return reached[part.slices_in(words)]

    def lying_in(self, cells: NDArray[np.bool_], part: Window) -> NDArray[np.bool_]:
        """Return the pixels in a window of the raster that lie in cells, bool (rows, cols).

        Args:
            cells: bool (rows, cols) of the lattice.
            part: window of the raster.
        """
        window = self.stands.lattice.window
        found = packed(np.ones((part.rows, part.cols), np.bool_), beyond=False)
        first, corner = (window.row0, window.col0), (part.row0, part.col0)
        keep_in_cells(found, self.placement, cells, first, corner)
        return unpacked(found, part.cols)

    def pixels_of(self, cells: NDArray[np.bool_]) -> Window | None:
        """Return a window of the pixels that the tool reaches from some cells; None without any.

        Args:
            cells: bool (rows, cols) of the lattice.
        """
        return self._reach.pixels_of(cells, self.stands.lattice.window, self.geometry)

    def _compute_all(self, grid: OccupancyGrid, plain: CoverageLattice) -> None:
        self.geometry, parts = self._geometry_of(grid)
        rows, cols = self.geometry.rows, self.geometry.cols
        self.revision += 1
        self.shift, self.touched = None, Window(0, 0, rows, cols)
        self._compute_places(grid, parts, 0, rows)
        self._compute_stands(plain, np.ones(plain.states.shape, np.bool_))

    def _geometry_of(self, grid: OccupancyGrid) -> tuple[GridGeometry, int]:
        return fine_geometry(grid.geometry, self.discs, self._most_pixels, CHUNK)

    def _move(self, geometry: GridGeometry, by: tuple[int, int]) -> bool:
        """Move the bits to a larger raster, shifted by rows and columns; False if impossible."""
        (rows, cols), whole = self.blocked.shape, geometry.window
        before, self.geometry = self.geometry.window, geometry
        if by[1] % WORD or not whole.contains(before.moved(*by)):
            return False
        old = Window(0, 0, rows, cols).moved(by[0], by[1] // WORD)
        new = Window(0, 0, geometry.rows, -(-geometry.cols // WORD))
        self.blocked = carried(self.blocked, old, new, BLOCKED_WORD)
        self.places = carried(self.places, old, new)
        return True

    def _compute_places(self, grid: OccupancyGrid, parts: int, first: int, end: int) -> None:
        """Compute blocked pixels in rows of the raster, and the places there."""
        rows = self.geometry.rows
        keep_out = None
        if self._keep_out:
            if self._kept_out is None or self._kept_out[0] != self.geometry:
                kept_out = PolygonsOnRaster.of(self._keep_out, self.geometry)
                self._kept_out = self.geometry, kept_out
            keep_out = self._kept_out[1].touched
        free_at_most = self.discs.free_at_most
        seen = blocked_pixels(grid, self.geometry, parts, free_at_most, (first, end), keep_out)
        disc = disc_rows(self.discs.radius_m / self.geometry.resolution)
        if end - first == rows:
            self.blocked, self.places = seen, places_of(seen, disc)
            return
        self.blocked[first:end] = seen
        low, high = max(first - len(disc), 0), min(end + len(disc), rows)
        places = places_of(self.blocked[low:high], disc)
        self.places[first:end] = places[first - low : end - low]

    def _compared(self, before: CoverageLattice) -> LatticeChange:
        """Keep the previous lattice object if no cell has changed, though a stand may have."""
        change = LatticeChange.to(before, self.stands.lattice)
        self.stands = replace(self.stands, lattice=change.after)
        return change

    @property
    def placement(self) -> Placement:
        """Placement of the lattice's cells on the raster."""
        return stand_placement(self.geometry, self._footprint.cell_m, self.discs.radius_m)

    def _compute_stands(self, plain: CoverageLattice, stale: NDArray[np.bool_]) -> None:
        """Recompute stale cells; take the other cells from the previous lattice."""
        self.stands = StandLattice.where(
            self.blocked,
            self.places,
            self.placement,
            plain.window,
            plain.cell_m,
            self.discs.clear_m / self.geometry.resolution,
            plain.states == UNKNOWN,
            None if self.shift is None else (self.stands, self.shift, stale),
        )

    def _with_states(self, plain: CoverageLattice) -> CoverageLattice:
        before = self.stands.lattice
        states = states_of(self.stands.stands, plain.states == UNKNOWN)
        if (states == before.states).all():
            return before
        lattice = CoverageLattice(before.window, before.cell_m, states, before.steps)
        self.stands = StandLattice(lattice, self.stands.stands, self.stands.bends)
        return lattice
