"""Line ahead: the line along the walk ahead, laid anew with each walk.

The line along a new walk leads over stands. Where the previous line, already polished, leads along
the same cells, it is kept.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster, raster_to_map
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.kernels.floor.line import LEAST_EDGE
from fasaco_edge.mission.line.followed_line import FollowedLine
from fasaco_edge.mission.line.pieces import Joiner, Piece, exchanged, kept_pieces
from fasaco_edge.mission.line.polyline import (
    POLISHED,
    Points,
    Polyline,
    edges_near,
)
from fasaco_edge.mission.line.way import (
    comes_nearer,
    corner_past,
    corners_between,
    discs_on,
    fitting_radius,
    is_clear_between,
    lead_out,
    leads_out,
    shortened,
)
from fasaco_edge.planners.path import common_beginning


class LineAhead(FollowedLine):
    """Lays the line along the walk, and replaces parts that a map blocks."""

    def lay(
        self,
        walk: NDArray[np.int32],
        pose: Pose2D,
        *,
        is_cut: bool = False,
        keeps: bool = True,
        beside: NDArray[np.float64] | None = None,
    ) -> None:
        """Lay the line along a walk; parts of the line along the same cells stay.

        Args:
            walk: int32 (n, 2), cells (row, col), each a legal step from the previous one.
            pose: pose of the robot, in or near the first cell.
            is_cut: whether the walk ends where a map has cut off the previous one.
            keeps: whether to keep parts of the line; False for a way to a place, as a polished line
                over the same cells is much longer.
            beside: discs that such a way keeps clear of, see ``Route.beside``.
        """
        self._see(pose)
        # A plan's cells are read-only: numba would compile the kernels again for such arrays.
        walk = walk.copy()
        # Any line ends before a cell that is off the lattice.
        lattice = self._floor.stands.lattice
        is_on = lattice.window.values_at(lattice.coverable, walk, 0)
        if not is_on.all():
            walk = walk[: int(np.argmin(is_on))]
        ahead, line = self._walk[self.cell :], self._whole.renumbered(-self.cell)
        beyond = Piece(Polyline(), 0)
        is_beginning = keeps and len(walk) > 0 and common_beginning(walk, ahead) == len(walk)
        if is_beginning and (is_cut or len(walk) == len(ahead)):
            count = line.before(len(walk))
            if count > 1 and self.is_followed:
                self._walk, self._whole, self._until, self.cell = ahead, line, len(walk), 0
                return
            line, beyond = line.part(0, count), Piece(line.part(count), count)
        pieces = kept_pieces(line, ahead, walk) if keeps and len(line) and len(walk) else []
        if pieces and pieces[0].begin == 0 and not self.is_followed:
            # The robot has passed the first point of the piece.
            rest = pieces[0].without_first()
            pieces[:1] = [rest] if len(rest.line) else []
        self._walk, self._until, self.cell = ahead if len(beyond.line) else walk, len(walk), 0
        self._join(pieces, beyond, skips=beside is None)
        if not keeps and len(self.line):
            way = self._past(discs_on(self._floor, beside))
            self._take([Piece(way.only(shortened(way.points, self._floor, beside)), -1)])

    def _past(self, discs: Points) -> Polyline:
        """Return the line with a corner that keeps the robot off discs, if possible."""
        line = self.line
        if not len(discs) or len(line) < 2:
            return line
        here, to = line.points[:2]
        corner = corner_past(here, to, discs) if comes_nearer(here, to, discs) else None
        if corner is None or not (self._is_clear(here, corner) and self._is_clear(corner, to)):
            return line
        state = np.full(1, POLISHED, np.uint8)
        return line.part(0, 1).joined(Polyline(corner[None], line.cells[:1], state), line.part(1))

    def _join(self, pieces: list[Piece], beyond: Piece, *, skips: bool = True) -> None:
        """Replace the line by one joined from pieces.

        Args:
            pieces: in order.
            beyond: the line beyond a cut, which is not joined.
            skips: whether it may skip the stand of the robot's cell if the floor there is swept.
        """
        if not len(self._walk):
            self._take([])
            return
        robot = self._place.here
        points = np.concatenate([robot[None], lead_out(self._floor, robot)])
        state = np.full(len(points), POLISHED, np.uint8)
        here = Polyline(points, np.full(len(points), self.cell), state)
        stands, tally = self._floor.stands, self.tally
        joiner = Joiner(
            here,
            self._walk[: self._until],
            self.cell,
            stand=stands.stand,
            raw=stands.line,
            is_clear=self._is_clear,
            is_swept=lambda cell: skips and not tally.is_open(stands.stand(cell)),
            way=lambda a, b: corners_between(self._floor, a, b),
        )
        self._take([*joiner.joined(pieces), *([beyond] if len(beyond.line) else [])])

    def check(self, touched: Window) -> bool:
        """Lay the parts that a map blocks over stands again; return whether there are any.

        Args:
            touched: window of the raster that may have changed.
        """
        line = self.line
        margin = self._floor.discs.radius_m / self._floor.geometry.resolution + 1.0
        blocked = [
            number
            for number in edges_near(line.points, touched, self.tally.shape, margin)
            if not self._is_clear(line.points[number], line.points[number + 1])
        ]
        if blocked[:1] == [0] and self.is_followed:
            # A lead-out is never clear; do not add another one with each map.
            blocked = blocked[leads_out(self._floor, self._place.here, line.points[1]) :]
        if not blocked:
            return False
        bounds = [0, *(number + 1 for number in blocked), len(line)]
        pieces = [Piece(line.part(first, end), first) for first, end in pairwise(bounds)]
        self._join(pieces, Piece(self._whole.part(len(line)), len(line)))
        return True

    def xy(self) -> Points:
        """Return the line from the robot on, float64 (n, 2): x, y in the map frame [m].

        It begins at the robot's place on the line; if the disc does not fit at the robot's pose, it
        begins at that pose.
        """
        points, here = self.from_place(), self._place.here
        if len(points) > 1:
            on = points[0]
            radius = fitting_radius(self._floor, here)
            is_off = radius < self._floor.discs.radius_m / self._floor.geometry.resolution
            is_off = is_off and np.abs(on - here).sum() >= LEAST_EDGE
            if is_off and is_clear_between(self._floor, here, on, radius):
                points = np.concatenate([here[None], points])
        return raster_to_map(self._floor.geometry, points)

    def leads_on(self, xy: Points) -> bool:
        """Return whether the robot can drive straight to the first of some points, and along them.

        ``xy``: float64 (n, 2): x, y [m]; False for no points.
        """
        points = [np.array(map_to_raster(self._geometry, x, y)) for x, y in xy.tolist()]
        ways = pairwise([self._place.here, *points])
        return bool(points) and all(self._is_clear(a, b) for a, b in ways)

    def _take(self, pieces: list[Piece]) -> None:
        """Replace the line; changed parts are counted and polished again.

        Args:
            pieces: their ``begin`` is 0 or more if they are part of the previous line.
        """
        old = self._whole
        new, goes, comes = exchanged(old, pieces)
        if not np.array_equal(old.points[:2], new.points[:2]):
            if len(old) > 1:
                self.tally.pass_line(np.stack([old.points[0], self._place.on(old.points)]))
            self._place.along = 0.0
        self.tally.exchange(goes, comes)
        self._whole = new
