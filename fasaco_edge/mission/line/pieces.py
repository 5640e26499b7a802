"""Pieces of a line, and the joining of pieces to a line.

A line along a new walk reuses the pieces of the previous line that lead along the same cells,
forward or backward; between these pieces it leads over stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fasaco_edge.kernels.floor.line import LEAST_EDGE
from fasaco_edge.kernels.floor.runs import AFTER, BACKWARD, BEFORE, STEPS, common_runs
from fasaco_edge.mission.line.polyline import (
    RAW,
    Edges,
    Numbers,
    Points,
    Polyline,
    Walk,
    edges_between,
)
from fasaco_edge.planners.path import common_beginning

# Least steps of a reused piece: shorter pieces would consist mostly of joints. The piece at the
# robot has one joint only, and may be shorter, so that the line just ahead stays as it is.
LEAST_STEPS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A reused piece of the previous line.

    Attributes:
        line: the piece, as in the new line.
        begin: lowest index of its points in the previous line.
        backward: whether the direction is reversed.
    """

    line: Polyline
    begin: int
    backward: bool = False

    def without_first(self) -> Piece:
        """Return the piece without its first point."""
        return Piece(self.line.part(1), self.begin + (not self.backward), self.backward)


def kept_pieces(line: Polyline, before: Walk, after: Walk) -> list[Piece]:
    """Return the pieces of a line along one walk that lead along the cells of another walk.

    Args:
        line: the line along ``before``.
        before, after: int32 (n, 2) and (m, 2), cells (row, col).
    """
    pieces = []
    alike = max(common_beginning(before, after) - 1, 0)
    own = alike if alike < LEAST_STEPS else 0
    if own:
        pieces.append(Piece(line.part(0, line.before(own)), 0))
    for run in common_runs(before[own:], after[own:], LEAST_STEPS).tolist():
        begin, origin, steps = run[AFTER] + own, run[BEFORE] + own, run[STEPS]
        if run[BACKWARD]:
            first, last = line.before(origin - steps + 1), line.before(origin)
            part = line.part(first, last)
            cells = begin + origin - part.cells[::-1]
            turned = Polyline(part.points[::-1], cells, part.state[::-1])
            pieces.append(Piece(turned, first, backward=True))
        else:
            # If both walks begin with this run, include the point behind the robot.
            first = 0 if begin == origin == 0 else line.before(origin + 1)
            last = line.before(origin + steps)
            pieces.append(Piece(line.part(first, last).renumbered(begin - origin), first))
    return [piece for piece in pieces if len(piece.line)]


def exchanged(line: Polyline, pieces: list[Piece]) -> tuple[Polyline, Edges, Edges]:
    """Return the line that consists of pieces, with the edges removed and the edges added.

    Points of new pieces, and points at joints of old pieces, are RAW, to be polished again.

    Args:
        line: the previous line.
        pieces: in order; ``begin`` is -1 for pieces that are no part of the previous line.

    Returns:
        the new line, the removed edges of the previous line, the added edges: float64 (n, 4).
    """
    new = pieces[0].line.joined(*(piece.line for piece in pieces[1:])) if pieces else Polyline()
    goes, comes = np.ones(max(len(line) - 1, 0), bool), np.ones(max(len(new) - 1, 0), bool)
    at = 0
    for piece in pieces:
        inner = len(piece.line) - 1
        if piece.begin >= 0:
            goes[piece.begin : piece.begin + inner] = False
            comes[at : at + inner] = False
            # Points at a joint may improve.
            new.state[at : at + 1 if at else 0] = RAW
            new.state[at + inner : at + inner + 1 if at + inner + 1 < len(new) else 0] = RAW
        at += inner + 1
    return new, edges_between(line.points, goes), edges_between(new.points, comes)


@dataclass(slots=True, eq=False)
class Joiner:
    """Joins pieces to a line, with stands between them.

    Attributes:
        here: the robot's position, at which the line begins unless a piece begins there.
        walk: int32 (n, 2), the walk of the new line.
        begin: index of the robot's cell in the walk.
        stand: returns the stand of a cell, float64 (2,).
        raw: returns the line over the stands of a walk: points, and cell indices from 0.
        is_clear: returns whether the robot can drive straight between two points.
        is_swept: returns whether a cell's stand needs no sweep.
        way: returns the corners of a way round obstacles between two points, float64 (n, 2); none
            if there is no way.
    """

    here: Polyline
    walk: Walk
    begin: int
    stand: Callable[[Walk], Points]
    raw: Callable[[Walk], tuple[Points, Numbers]]
    is_clear: Callable[[Points, Points], bool]
    is_swept: Callable[[Walk], bool]
    way: Callable[[Points, Points], Points]
    _done: list[Piece] = field(default_factory=list, init=False)

    def joined(self, pieces: list[Piece]) -> list[Piece]:
        """Return the line as pieces; new pieces have ``begin`` -1."""
        self._done = [Piece(self.here, -1)]
        # The point behind the robot needs the next point; both are kept or dropped.
        if pieces and pieces[0].begin == 0:
            if len(pieces[0].line) > 1:
                self._done = pieces[:1]
            pieces = pieces[1:]
        for piece in pieces:
            self._join(piece)
        self._go_on(len(self.walk))
        return [piece for piece in self._done if len(piece.line)]

    def _join(self, piece: Piece) -> None:
        """Append a piece, connected over stands; drop points at the joint that are not clear."""
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
        """Append the stands of the walk's cells up to ``until``, excluding it."""
        while True:
            last = self._last()
            if last is None:
                self._append(self.begin, until)
                return
            # The stand of the last point's own cell can be skipped; at the robot's position only if
            # the floor there is swept.
            at = max(int(self._done[-1].line.cells[-1]), self.begin)
            is_here = self._is_here()
            starts = [at]
            if at + 1 < len(self.walk) and (not is_here or self.is_swept(self.walk[at])):
                starts = [at + 1, at]
            for start in starts:
                is_way = start >= until or self.is_clear(last, self.stand(self.walk[start]))
                if is_way and self._append(start, until):
                    return
            if is_here and at < until and self._lead_in(at) and self._append(at, until):
                return
            self._drop_last()

    def _lead_in(self, at: int) -> bool:
        """Append a way round obstacles from the robot to a cell's stand; return whether it exists.

        On a polished line the robot passes places with no clear straight way to any stand.
        """
        stand = self.stand(self.walk[at])
        corners = self.way(self.here.points[-1], stand)
        if not len(corners):
            return False
        self._done.append(Piece(Polyline.raw(corners, np.full(len(corners), at)), -1))
        return True

    def _append(self, first: int, until: int) -> bool:
        """Append the stands of cells up to ``until``, excluding it; return whether that is clear.

        A stand that nearly coincides with the last point is left out. Nothing is appended if the
        segment from that point to the next stand is then blocked.
        """
        if first >= until:
            return True
        # Whether a stand is a corner depends on the next one.
        points, cells = self.raw(self.walk[first : until + 1])
        line = Polyline.raw(points, cells + first)
        line = line.part(0, line.before(until))
        last = self._last()
        ends = line.points if last is None else np.concatenate([last[None], line.points])
        far = np.hypot(*np.diff(ends, axis=0).T) >= LEAST_EDGE
        kept = far if last is not None else np.concatenate([[True], far])
        if not kept.all():
            line = Polyline(line.points[kept], line.cells[kept], line.state[kept])
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
        """Drop the last point; the two points of the robot's edge are dropped together."""
        if self._is_here():
            self._done = []
            return
        piece = self._done[-1]
        line = piece.line.part(0, len(piece.line) - 1)
        self._done[-1] = Piece(line, piece.begin + piece.backward, piece.backward)
        if self._last() is not None and len(self._done) == 1 and len(line) == 1:
            self._done = [Piece(self.here, -1)]
