"""Pieces of a line: points with the cells that they stand for, and a line put together of them.

A line along another walk keeps the pieces of the line before that lead along the same cells,
forward or backward. Between them it goes over stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.line import LEAST_EDGE
from fasaco_edge.kernels.floor.runs import AFTER, BACKWARD, BEFORE, STEPS, common_runs

Points = NDArray[np.float64]
Numbers = NDArray[np.int64]
Walk = NDArray[np.int32]

# How far points are: over stands; moved; polished with all moves.
RAW, MOVED, POLISHED = range(3)
# Stretches of a walk with fewer steps are not kept: joints would take most of them.
LEAST_STEPS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Points in a row, straight ways between them.

    Attributes:
        points: float64 (n, 2): y, x [pixels of the fine raster].
        cells: int64 (n,), rising: of which cell of the walk each is.
        state: uint8 (n,): RAW, MOVED or POLISHED.
    """

    points: Points = field(default_factory=lambda: np.empty((0, 2)))
    cells: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    state: NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def raw(cls, points: Points, cells: Numbers) -> Line:
        """Return points that were not moved yet."""
        return cls(points, cells, np.full(len(points), RAW, np.uint8))

    def part(self, begin: int, end: int | None = None) -> Line:
        """Return the points from one place to another."""
        return Line(self.points[begin:end], self.cells[begin:end], self.state[begin:end])

    def joined(self, *others: Line) -> Line:
        """Return it with others behind."""
        lines = self, *others
        return Line(
            np.concatenate([line.points for line in lines]),
            np.concatenate([line.cells for line in lines]),
            np.concatenate([line.state for line in lines]),
        )

    def renumbered(self, by: int) -> Line:
        """Return it along a walk whose cells have other numbers."""
        return Line(self.points, self.cells + by, self.state)

    def moved(self, by: tuple[int, int]) -> Line:
        """Return it on a raster on which pixels have moved, rows and columns."""
        return Line(self.points + np.array(by), self.cells, self.state)

    def before(self, cell: int) -> int:
        """Return how many points are of cells before one."""
        return int(np.searchsorted(self.cells, cell))


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """What is kept of the line before.

    Attributes:
        line: as it is in the new line.
        begin: its first point's number in the line before; its last one's if ``backward``.
        backward: whether it is driven the other way now.
    """

    line: Line
    begin: int
    backward: bool = False

    def without_first(self) -> Piece:
        """Return it without its first point."""
        return Piece(self.line.part(1), self.begin + (not self.backward), self.backward)


def kept_pieces(line: Line, before: Walk, after: Walk) -> list[Piece]:
    """Return what of a line along one walk leads along the same cells as another walk.

    Args:
        line: along ``before``.
        before, after: int32 (n, 2) and (m, 2), cells (row, col).
    """
    pieces = []
    for run in common_runs(before, after, LEAST_STEPS).tolist():
        begin, origin, steps = run[AFTER], run[BEFORE], run[STEPS]
        if run[BACKWARD]:
            first, last = line.before(origin - steps + 1), line.before(origin)
            part = line.part(first, last)
            cells = begin + origin - part.cells[::-1]
            turned = Line(part.points[::-1], cells, part.state[::-1])
            pieces.append(Piece(turned, first, backward=True))
        else:
            # Where both begin, the point behind the robot, too.
            first = 0 if begin == origin == 0 else line.before(origin + 1)
            last = line.before(origin + steps)
            pieces.append(Piece(line.part(first, last).renumbered(begin - origin), first))
    return [piece for piece in pieces if len(piece.line)]


@dataclass(slots=True, eq=False)
class Joiner:
    """Puts a line together of pieces, and of stands between them.

    Attributes:
        here: where the robot is: the beginning, where no piece is.
        walk: int32 (n, 2), what the line leads along.
        begin: the number of its cell that the robot is at.
        stand: returns where the robot stands in a cell, float64 (2,).
        raw: returns the line over the stands of a walk, points and cells from 0.
        is_clear: tells whether the robot can drive straight between two points.
        is_swept: tells whether a cell's stand needs no sweep.
    """

    here: Line
    walk: Walk
    begin: int
    stand: Callable[[Walk], Points]
    raw: Callable[[Walk], tuple[Points, Numbers]]
    is_clear: Callable[[Points, Points], bool]
    is_swept: Callable[[Walk], bool]
    _done: list[Piece] = field(default_factory=list, init=False)

    def joined(self, pieces: list[Piece]) -> list[Piece]:
        """Return the line, piece by piece; what was not in the line before begins at -1."""
        self._done = [Piece(self.here, -1)]
        # With the point behind the robot it takes one more, or both are left.
        if pieces and pieces[0].begin == 0:
            if len(pieces[0].line) > 1:
                self._done = pieces[:1]
            pieces = pieces[1:]
        for piece in pieces:
            self._join(piece)
        self._go_on(len(self.walk))
        return [piece for piece in self._done if len(piece.line)]

    def _join(self, piece: Piece) -> None:
        """Go over stands to a piece; points at the joint that cannot be driven are dropped."""
        self._go_on(int(piece.line.cells[0]))
        while len(piece.line):
            last = self._last()
            if last is None:
                return
            apart = np.abs(last - piece.line.points[0]).sum()
            if apart >= LEAST_EDGE and self.is_clear(last, piece.line.points[0]):
                self._done.append(piece)
                return
            piece = piece.without_first()
            if len(piece.line):
                self._go_on(int(piece.line.cells[0]))

    def _go_on(self, until: int) -> None:
        """Go over the stands of the walk's cells before one."""
        while True:
            last = self._last()
            if last is None:
                self._append(self.begin, until)
                return
            # From a point that was moved one need not go back to the stand it comes from; nor
            # from where the robot is, if that is swept.
            at = max(int(self._done[-1].line.cells[-1]), self.begin)
            is_here = self._is_here()
            starts = [at]
            if at + 1 < len(self.walk) and (not is_here or self.is_swept(self.walk[at])):
                starts = [at + 1, at]
            for start in starts:
                is_way = start >= until or self.is_clear(last, self.stand(self.walk[start]))
                if is_way and self._append(start, until):
                    return
            self._drop_last()

    def _append(self, first: int, until: int) -> bool:
        """Append the stands of cells from one to before another; return whether they can be driven.

        A stand that the last point is all but at is left out. From the stand the way to the next
        one is clear, from that point it may be blocked by a hair: nothing is appended then.
        """
        if first >= until:
            return True
        # Whether a stand is a corner is seen from the next one.
        points, cells = self.raw(self.walk[first : until + 1])
        line = Line.raw(points, cells + first)
        line = line.part(0, line.before(until))
        last = self._last()
        ends = line.points if last is None else np.concatenate([last[None], line.points])
        far = np.hypot(*np.diff(ends, axis=0).T) >= LEAST_EDGE
        kept = far if last is not None else np.concatenate([[True], far])
        if not kept.all():
            line = Line(line.points[kept], line.cells[kept], line.state[kept])
        is_left_out = len(line) > 0 and not kept[0]
        if last is not None and is_left_out and not self.is_clear(last, line.points[0]):
            return False
        self._done.append(Piece(line, -1))
        return True

    def _last(self) -> Points | None:
        while self._done and not len(self._done[-1].line):
            self._done.pop()
        return self._done[-1].line.points[-1] if self._done else None

    def _is_here(self) -> bool:
        return len(self._done) == 1 and self._done[0].line is self.here

    def _drop_last(self) -> None:
        """Drop the last point; of the edge that the robot is on both stay, or none."""
        if self._is_here():
            self._done = []
            return
        piece = self._done[-1]
        line = piece.line.part(0, len(piece.line) - 1)
        self._done[-1] = Piece(line, piece.begin + piece.backward, piece.backward)
        if self._last() is not None and len(self._done) == 1 and len(line) == 1:
            self._done = [Piece(self.here, -1)]
