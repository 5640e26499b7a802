"""Travel over a lattice: numbers of steps, travel times, and places far apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import StartBlocked
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.reachable_area import anchor_cell
from fasaco_edge.kernels.lattice.reach import FAR, ways_from

# Largest distance at which a coverable cell replaces a cell that is not coverable [cells].
SNAP = 2
# Travel time to a cell that cannot be reached [s].
UNREACHED_S = np.float32(1e9)

Seconds = NDArray[np.float32]
Steps = NDArray[np.float32]


def ways(lattice: CoverageLattice, start: Cell) -> Steps:
    """Return the steps from a cell, float32 (rows * cols,); FAR where unreachable."""
    if not lattice.contains(start):
        return np.full(lattice.steps.size, np.float32(FAR))
    row, col = on_ground(lattice, *lattice.local(start))
    return ways_from(lattice.steps, row * lattice.steps.shape[1] + col).astype(np.float32)


def times_of(steps: Steps, steps_s: NDArray[np.float32] | np.float32) -> Seconds:
    """Return travel times [s], float32 (k, n); UNREACHED_S where unreachable.

    Args:
        steps: numbers of steps, float32 (k, n).
        steps_s: time of a step [s].
    """
    return np.where(steps < FAR, steps * steps_s, UNREACHED_S)


def on_ground(lattice: CoverageLattice, row: int, col: int) -> Cell:
    """Return the coverable cell nearest to a cell, within SNAP cells; else the cell itself.

    Seeds that others send may lie on cells that are not coverable on this robot's map.
    """
    if lattice.coverable[row, col]:
        return row, col
    top, left = max(row - SNAP, 0), max(col - SNAP, 0)
    near = lattice.coverable[top : row + SNAP + 1, left : col + SNAP + 1]
    cells = np.argwhere(near) + np.array((top, left))
    if not len(cells):
        return row, col
    best = cells[((cells - (row, col)) ** 2).sum(axis=1).argmin()]
    return int(best[0]), int(best[1])


class Travel:
    """Travel times to a set of cells of a lattice; each start is searched once.

    Attributes:
        cells: flat indices, int64 (n,).
        every: 1 if these are all cells of interest, 2 for every second cell, and so on.
    """

    def __init__(self, lattice: CoverageLattice, cells: NDArray[np.int64], every: int) -> None:
        self.lattice, self.cells, self.every = lattice, cells, every
        self._known: dict[Cell, Steps] = {}

    def times_s(self, starts: Sequence[Cell], steps_s: NDArray[np.float64]) -> Seconds:
        """Return travel times from starts [s], float32 (k, n); UNREACHED_S where unreachable."""
        found = np.array([self._ways_from(start) for start in starts])
        return times_of(found, steps_s.astype(np.float32)[:, None])

    def has_ways_from(self, start: Cell) -> bool:
        """Return whether any of the cells can be reached from a start."""
        return bool((self._ways_from(start) < FAR).any())

    def _ways_from(self, start: Cell) -> Steps:
        if start not in self._known:
            self._known[start] = ways(self.lattice, start)[self.cells]
        return self._known[start]


def cell_of(lattice: CoverageLattice, flat: int) -> Cell:
    """Return the cell of a flat index."""
    row, col = divmod(flat, lattice.steps.shape[1])
    return row + lattice.window.row0, col + lattice.window.col0


def apart(lattice: CoverageLattice, first: Point, count: int) -> list[Point]:
    """Return ``count`` points [m], each as far as possible from ``first`` and all earlier points.

    Raises:
        StartBlocked: the robot does not fit at ``first``, or there is no room for ``count`` more.
    """
    start = anchor_cell(lattice, Pose2D(*first))
    if start is None:
        raise StartBlocked(f"the robot does not fit where it starts, {first} m")
    row, col = lattice.local(start)
    cols = lattice.steps.shape[1]
    nearest = ways_from(lattice.steps, row * cols + col)
    nearest[nearest >= FAR] = 0
    places: list[Point] = []
    for _ in range(count):
        flat = int(nearest.argmax())
        if nearest[flat] <= 0:
            raise StartBlocked(
                f"there is no place for a robot beside the other {len(places) + 1}",
                hint="let fewer robots start",
            )
        ((x, y),) = lattice.centres(np.array([cell_of(lattice, flat)], np.int32)).tolist()
        places.append((x, y))
        nearest = np.minimum(nearest, ways_from(lattice.steps, flat))
    return places
