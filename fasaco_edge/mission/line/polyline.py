"""The line as a polyline: points with the cells that they stand for, and edges on the raster."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window

Points = NDArray[np.float64]
Edges = NDArray[np.float64]
Numbers = NDArray[np.int64]
Walk = NDArray[np.int32]

# States of points: at a stand; moved; polished with all moves; on a curve.
RAW, MOVED, POLISHED, CURVED = range(4)
NO_EDGES = np.empty((0, 4))
# Lengths are computed for this many points first, then for twice as many until they suffice.
FIRST_POINTS = 128


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """A polyline.

    Attributes:
        points: float64 (n, 2): y, x [pixels of the fine raster].
        cells: int64 (n,), ascending: index in the walk of each point's cell.
        state: uint8 (n,): RAW, MOVED, POLISHED or CURVED.
    """

    points: Points = field(default_factory=lambda: np.empty((0, 2)))
    cells: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    state: NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def raw(cls, points: Points, cells: Numbers) -> Polyline:
        """Return a line of points that have not been moved yet."""
        return cls(points, cells, np.full(len(points), RAW, np.uint8))

    def part(self, begin: int, end: int | None = None) -> Polyline:
        """Return the points from ``begin`` to ``end``."""
        return Polyline(self.points[begin:end], self.cells[begin:end], self.state[begin:end])

    def only(self, kept: NDArray[np.intp]) -> Polyline:
        """Return the points of some indices."""
        return Polyline(self.points[kept], self.cells[kept], self.state[kept])

    def joined(self, *others: Polyline) -> Polyline:
        """Return this line with others appended."""
        lines = self, *others
        return Polyline(
            np.concatenate([line.points for line in lines]),
            np.concatenate([line.cells for line in lines]),
            np.concatenate([line.state for line in lines]),
        )

    def renumbered(self, by: int) -> Polyline:
        """Return this line with cell indices shifted."""
        return Polyline(self.points, self.cells + by, self.state)

    def moved(self, by: tuple[int, int]) -> Polyline:
        """Return this line shifted by rows and columns of the raster."""
        return self.at(self.points + np.array(by))

    def at(self, points: Points) -> Polyline:
        """Return this line with its points at other places, float64 (n, 2)."""
        return Polyline(points, self.cells, self.state)

    def marked(self, first: int, end: int, state: int) -> Polyline:
        """Return this line with points marked as MOVED or POLISHED."""
        states = self.state.copy()
        states[first:end] = np.maximum(states[first:end], state)
        return Polyline(self.points, self.cells, states)

    def first_below(self, state: int) -> int:
        """Return the index of the first point with a lower state; the count if there is none."""
        below = self.state < state
        return int(np.argmax(below)) if below.any() else len(below)

    def raw_until(self, first: int) -> int:
        """Return the index of the first moved point from ``first`` on; the count if none."""
        moved = self.state[first:] >= MOVED
        return first + int(np.argmax(moved)) if moved.any() else len(self)

    def before(self, cell: int) -> int:
        """Return the number of points of cells before ``cell``."""
        return int(np.searchsorted(self.cells, cell))


def is_outside(points: Points, shape: tuple[int, int], margin: float) -> NDArray[np.bool_]:
    """Return which points are closer than ``margin`` to the rim of a raster, bool (n,)."""
    # Column by column: numpy takes several times as long over rows of two.
    y, x = points[:, 0], points[:, 1]
    outside: NDArray[np.bool_] = (
        (y < margin) | (x < margin) | (y > shape[0] - 1.0 - margin) | (x > shape[1] - 1.0 - margin)
    )
    return outside


def edges_between(points: Points, which: NDArray[np.bool_] | None = None) -> Edges:
    """Return the edges between points, or some of them, float64 (n, 4)."""
    begins, ends = points[:-1], points[1:]
    if which is not None:
        numbers = np.flatnonzero(which)
        begins, ends = begins[numbers], ends[numbers]
    return np.concatenate([begins, ends], axis=1)


def edges_near(points: Points, part: Window, shape: tuple[int, int], margin: float) -> list[int]:
    """Return the edges between points that may come near a window of the raster.

    Args:
        points: float64 (n, 2): y, x [pixels].
        part: the window.
        shape: of the raster, (rows, cols); edges beyond it are always included.
        margin: the distance that counts as near [pixels].
    """
    if len(points) < 2:
        return []
    outside = is_outside(points, shape, margin)
    near = outside[:-1] | outside[1:]
    # Edges with both ends on one side of the window are not near it.
    close = np.ones(len(near), np.bool_)
    for axis, low, high in ((0, part.row0, part.row1), (1, part.col0, part.col1)):
        ends = points[:, axis]
        below, above = ends + margin <= low, ends - margin >= high
        close &= ~((below[:-1] & below[1:]) | (above[:-1] & above[1:]))
    numbers: list[int] = np.flatnonzero(near | close).tolist()
    return numbers


def lengths(points: Points, within: float, along: float) -> NDArray[np.float64]:
    """Return the distance along a line to its points, float64 (m,) [pixels]; the first is 0.

    Args:
        points: float64 (n, 2), n of 1 or more.
        within: distance that the result covers [pixels]: m may be less than n if the last of the m
            points is farther.
        along: fraction of the first edge that is not counted.
    """
    count = FIRST_POINTS
    while True:
        edges = np.hypot(*np.diff(points[:count], axis=0).T)
        edges[:1] *= 1.0 - along
        sums: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(edges)])
        if count >= len(points) or sums[-1] > within:
            return sums
        count *= 2
