"""Loop closures: SLAM corrects the whole map, and moves map and pose at once.

The ledger's cells are places in the map frame. While the tool swept them, the true position of the
map was somewhere between the old and the new position. So only cells that are covered for every
position in between still count.

Small shifts are found by walls alone. A loop closure that moves the map by less than a cell changes
too few cells for ``has_moved``, and is smaller than the steps between poses of a driving robot. If
the map is moved back, its wall pixels beside free pixels lie in the previous walls.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Pose2D, Window
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, CoverageLattice, Footprint, beside
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor import certain as kernels
from fasaco_edge.kernels.floor.certain import FloorTiles, Whereabouts
from fasaco_edge.mission.coverage.floor_tiles import (
    FLOOR_TILE,
    PIXEL_M,
    ROW_BYTES,
    Bits,
    FloorSnapshot,
    Similarity,
    TileKey,
    Tiles,
)
from fasaco_edge.mission.coverage.ledger import Cells, LedgerSnapshot

# A map has moved if LEAST_CELLS, and LEAST_SHARE of the known cells, change between free and
# blocked. Doors and passers-by change fewer.
LEAST_CELLS, LEAST_SHARE = 20, 0.1
# A map with this many coverable cells shows enough floor to tell whether walls are elsewhere.
LEAST_FLOOR = LEAST_CELLS
# Motions up to STILL_M [m] and STILL_RAD [rad] are ignored.
STILL_M, STILL_RAD = 0.02, math.radians(0.2)
# A point this near to a row (or column) of cell centres needs only this row covered; another point
# needs the rows on both sides [cells].
NEAR = 0.1
# Intermediate map positions that are tested, as shares of the motion.
BETWEEN = (0.25, 0.5, 0.75, 1.0)
# Most positions tested for swept floor, one per pixel of the motion: motions of more than 0.4 m,
# which are rare, are tested more coarsely.
MOST_BETWEEN = 16


def shows_floor(lattice: CoverageLattice) -> bool:
    """Return whether a map shows floor, and so gives evidence of walls."""
    return int(np.count_nonzero(lattice.coverable)) >= LEAST_FLOOR


def has_moved(change: LatticeChange) -> bool:
    """Return whether a map shows many walls at other places."""
    if change.before is None or len(change.cells) < LEAST_CELLS:
        return False
    then, now = _states(change.before, change), _states(change.after, change)
    changed = int(np.count_nonzero((then != UNKNOWN) & (now != UNKNOWN) & (then != now)))
    # Counts the whole lattice only if necessary, as this runs with every map.
    return changed >= LEAST_CELLS and changed >= LEAST_SHARE * int(
        np.count_nonzero(change.before.states != UNKNOWN)
    )


def _states(lattice: CoverageLattice, change: LatticeChange) -> NDArray[np.uint8]:
    """Return the states of the changed cells on a lattice, uint8 (n,)."""
    return lattice.window.values_at(lattice.states, change.cells, UNKNOWN)


@dataclass(frozen=True, slots=True)
class Motion:
    """A rigid motion of the map, given by the robot's poses before and after it."""

    start: Pose2D
    end: Pose2D

    def undone(self, share: float) -> Similarity:
        """Return the transform of swept pixels that undoes a share of the motion."""
        x, y = self.back(share, np.zeros(1), np.zeros(1))
        turn = -share * math.remainder(self.end.yaw - self.start.yaw, math.tau)
        return Similarity(
            float(y[0]) / PIXEL_M, float(x[0]) / PIXEL_M, math.cos(turn), math.sin(turn)
        )

    @property
    def is_still(self) -> bool:
        """Whether there was no motion."""
        start, end = self.start, self.end
        distance = math.hypot(end.x - start.x, end.y - start.y)
        turn = math.remainder(end.yaw - start.yaw, math.tau)
        return distance < STILL_M and abs(turn) < STILL_RAD

    def forward(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points [m] after the motion."""
        return Motion(self.end, self.start).back(1.0, x, y)

    def back(
        self, share: float, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points [m] with a share of the motion undone."""
        start, end = self.start, self.end
        turn = -share * math.remainder(end.yaw - start.yaw, math.tau)
        dx = x - start.x - share * (end.x - start.x)
        dy = y - start.y - share * (end.y - start.y)
        cos, sin = math.cos(turn), math.sin(turn)
        return cos * dx - sin * dy + start.x, sin * dx + cos * dy + start.y


def moved_cells(cells: NDArray[np.int32], motion: Motion, cell_m: float) -> NDArray[np.int32]:
    """Return a path's cells, int32 (n, 2), after the motion, int32 (m, 2).

    Cells are moved by their centres; successive centres in one cell give one cell. After a rotation
    successive cells may touch only at a corner.
    """
    y, x = ((cells.astype(np.float64) + 0.5) * cell_m).T
    x, y = motion.forward(x, y)
    moved = np.floor(np.stack((y, x), axis=1) / cell_m).astype(np.int32)
    is_other = np.ones(len(moved), bool)
    is_other[1:] = (moved[1:] != moved[:-1]).any(axis=1)
    return moved[is_other]


def moved_mask(
    window: Window, mask: NDArray[np.bool_], motion: Motion, cell_m: float, scale: float = 1.0
) -> tuple[Window, NDArray[np.bool_]] | None:
    """Return the marked cells after a motion of the map, and their window.

    ``mask``: bool (rows, cols) of ``window``, of cells of ``cell_m``. The cells returned are
    ``scale`` times as wide. None if their window is too large.
    """
    rows, cols, new_m = (window.row0, window.row1), (window.col0, window.col1), cell_m * scale
    y, x = np.array(list(product(rows, cols))).T * cell_m
    x, y = motion.forward(x, y)
    row0, col0, row1, col1 = (
        int(edge // new_m) for edge in (y.min(), x.min(), y.max() + new_m, x.max() + new_m)
    )
    whole = Window(row0, col0, row1, col1)
    if whole.rows * whole.cols > MAX_LATTICE_CELLS:
        return None
    y, x = (np.mgrid[row0:row1, col0:col1].reshape(2, -1) + 0.5) * new_m
    x, y = motion.back(1.0, x, y)
    were = np.floor(np.stack((y, x), axis=1) / cell_m).astype(np.int32)
    moved = window.values_at(mask, were, 0).reshape(whole.rows, whole.cols)
    return whole, moved.astype(np.bool_)


def uncertain_cells(
    before: LedgerSnapshot, motion: Motion
) -> Callable[[Cells, Cells], NDArray[np.bool_]]:
    """Return a function of rows and columns: which cells are not surely covered, bool (n,)."""

    def inside(rows: Cells, cols: Cells) -> NDArray[np.bool_]:
        x, y = ((each.astype(np.float64) + 0.5) * before.cell_m for each in (cols, rows))
        doubt = np.zeros(rows.shape, bool)
        for share in BETWEEN:
            doubt |= ~_covered(before, *motion.back(share, x, y))
        # The tool is a disc: at a cell's centre it misses the cell's corners.
        x, y = motion.back(1.0, x, y)
        row, col = y / before.cell_m - 0.5, x / before.cell_m - 0.5
        between: NDArray[np.bool_] = np.hypot(row - np.rint(row), col - np.rint(col)) >= 0.5
        return doubt | between

    return inside


def certain_floor(
    before: FloorSnapshot, motion: Motion
) -> Callable[[Tiles], list[tuple[TileKey, Bits]]]:
    """Return a function of tiles: those with uncertain pixels, after removal of these pixels."""
    known = _stacked(before.tiles)

    def left_of(tiles: Tiles) -> list[tuple[TileKey, Bits]]:
        if not tiles:
            return []
        asked = _stacked(tiles)
        counts = _places_between(asked.places, motion)
        between = np.zeros((MOST_BETWEEN, MOST_BETWEEN, 4))
        for count in np.unique(counts).tolist():
            places = [motion.undone(number / count) for number in range(1, count + 1)]
            between[count - 1, :count] = places
        left = kernels.certain_floor(known, asked, Whereabouts(between, counts))
        is_less = (left != asked.bits).any(axis=(1, 2))
        # Copies, as a view would keep the whole array in memory.
        return [
            ((row, col), bits.copy())
            for (row, col), bits in zip(asked.places[is_less].tolist(), left[is_less], strict=True)
        ]

    return left_of


def _stacked(tiles: Tiles) -> FloorTiles:
    places = sorted(tiles)
    bits = np.zeros((len(tiles), FLOOR_TILE, ROW_BYTES), np.uint8)
    for number, place in enumerate(places):
        bits[number] = tiles[place]
    return FloorTiles(np.array(places, np.int64).reshape(-1, 2), bits)


def _places_between(tiles: NDArray[np.int64], motion: Motion) -> NDArray[np.int64]:
    """Return the number of map positions to test for the pixels of tiles, int64 (n, 2)."""
    corners = np.array([(0, 0), (1, 1), (1, 0), (0, 1)])
    y, x = np.moveaxis((tiles[:, np.newaxis] + corners) * FLOOR_TILE * PIXEL_M, 2, 0)
    was_x, was_y = motion.back(1.0, x, y)
    farthest: NDArray[np.float64] = np.hypot(was_x - x, was_y - y).max(axis=1)
    return np.clip(np.ceil(farthest / PIXEL_M), 1, MOST_BETWEEN).astype(np.int64)


def _covered(
    before: LedgerSnapshot, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether all cells around points [m] were covered, bool (n,)."""
    row, col = y / before.cell_m - 0.5, x / before.cell_m - 0.5
    low_row, high_row = np.floor(row + NEAR).astype(int), np.ceil(row - NEAR).astype(int)
    low_col, high_col = np.floor(col + NEAR).astype(int), np.ceil(col - NEAR).astype(int)
    row0, col0 = int(low_row.min()), int(low_col.min())
    window = Window(row0, col0, int(high_row.max()) + 1, int(high_col.max()) + 1)
    visited = before.visits(window) > 0
    covered = np.ones(x.shape, bool)
    for rows in (low_row, high_row):
        for cols in (low_col, high_col):
            covered &= visited[rows - row0, cols - col0]
    return covered


# A map is compared with the previous one if at least this many free cells have become blocked.
LEAST_CLOSED = 3
# Shifts of up to FARTHEST_PX [pixels] along each axis are tried, on at most MOST_PIXELS of walls.
FARTHEST_PX, MOST_PIXELS = 4, 2000
# A shift is accepted if it moves at least the share LEAST_ALIKE of these pixels into the previous
# walls. This share must also exceed the share without a shift by at least BETTER.
LEAST_ALIKE, BETTER = 0.5, 0.2
# If the shares of two shifts differ by less, the smaller shift is taken: along a corridor, the
# shares of many shifts are alike.
ALIKE = 0.03


def closes_cells(change: LatticeChange | None) -> bool:
    """Return whether a change of the lattice closes cells, as a shift of the map does."""
    if change is None or change.before is None:
        return False
    was_open = _states(change.before, change) == COVERABLE
    closed = was_open & (_states(change.after, change) == BLOCKED)
    return bool(np.count_nonzero(closed) >= LEAST_CLOSED)


def small_shift(before: OccupancyGrid, after: OccupancyGrid, footprint: Footprint) -> Motion | None:
    """Return the shift of a map since the previous one; None for none."""
    faces = np.flatnonzero(_wall_faces(after.cells, footprint))
    faces = faces[:: 1 + len(faces) // MOST_PIXELS]
    if not len(faces):
        return None
    rows, cols = np.divmod(faces, after.cells.shape[1])
    x, y = after.geometry.to_map(cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
    occupied, unit = before.cells >= footprint.occupied_at_least, after.geometry.resolution
    steps = range(-FARTHEST_PX, FARTHEST_PX + 1)
    shifts = sorted(product(steps, steps), key=lambda shift: (math.hypot(*shift), shift))
    alike = np.zeros(len(shifts))
    for index, (right, up) in enumerate(shifts):
        at_col, at_row = before.geometry.to_pixels(x - right * unit, y - up * unit)
        row, col = np.floor(at_row).astype(np.int64), np.floor(at_col).astype(np.int64)
        inside = (row >= 0) & (col >= 0) & (row < occupied.shape[0]) & (col < occupied.shape[1])
        alike[index] = np.count_nonzero(occupied[row[inside], col[inside]]) / len(faces)
        if alike[0] > 1.0 - BETTER:
            return None
    best = int(np.argmax(alike >= alike.max() - ALIKE))
    if alike[best] < max(LEAST_ALIKE, alike[0] + BETTER):
        return None
    right, up = shifts[best]
    return Motion(Pose2D(0.0, 0.0), Pose2D(right * unit, up * unit))


def _wall_faces(cells: NDArray[np.int8], footprint: Footprint) -> NDArray[np.bool_]:
    """Return which occupied pixels lie beside a free pixel, bool (rows, cols)."""
    free = (cells >= 0) & (cells <= footprint.free_at_most)
    return beside(free) & (cells >= footprint.occupied_at_least)
