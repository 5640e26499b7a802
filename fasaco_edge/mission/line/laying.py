"""Laying of the line along each new walk.

The line along a new walk leads over stands. Where the previous line, already polished, leads along
the same cells, it is kept.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.pieces import Joiner, Piece, kept_pieces
from fasaco_edge.mission.line.polyline import POLISHED, Points, Polyline, edges_near
from fasaco_edge.mission.line.way import (
    comes_nearer,
    corner_past,
    corners_between,
    discs_on,
    lead_out,
    leads_out,
    shortened,
)
from fasaco_edge.planners.path import common_beginning


def lay(
    ahead: LineAhead,
    walk: NDArray[np.int32],
    pose: Pose2D,
    *,
    is_cut: bool = False,
    keeps: bool = True,
    beside: NDArray[np.float64] | None = None,
) -> None:
    """Lay the line along a walk; parts of the line along the same cells stay.

    Args:
        ahead: the line.
        walk: int32 (n, 2), cells (row, col), each a legal step from the previous one.
        pose: pose of the robot, in or near the first cell.
        is_cut: whether the walk ends where a map has cut off the previous walk.
        keeps: whether to keep parts of the line; False for a direct way to a place: there, a line
            that was polished for sweeping would be much longer.
        beside: discs that such a way keeps clear of, see ``Route.beside``.
    """
    ahead.see(pose)
    ahead.stop()
    # A plan's cells are read-only: numba would compile the kernels again for such arrays.
    walk = walk.copy()
    # Any line ends before a cell that is off the lattice.
    lattice = ahead.floor.stands.lattice
    is_on = lattice.window.values_at(lattice.coverable, walk, 0)
    if not is_on.all():
        walk = walk[: int(np.argmin(is_on))]
    before, line = ahead.walk, ahead.whole
    beyond = Piece(Polyline(), 0)
    is_beginning = keeps and len(walk) > 0 and common_beginning(walk, before) == len(walk)
    if is_beginning and (is_cut or len(walk) == len(before)):
        count = line.before(len(walk))
        if count > 1 and ahead.is_followed:
            ahead.follow(before, len(walk))
            return
        line, beyond = line.part(0, count), Piece(line.part(count), count)
    pieces = kept_pieces(line, before, walk) if keeps and len(line) and len(walk) else []
    if pieces and pieces[0].begin == 0 and not ahead.is_followed:
        # The robot has passed the first point of the piece.
        rest = pieces[0].without_first()
        pieces[:1] = [rest] if len(rest.line) else []
    ahead.follow(before if len(beyond.line) else walk, len(walk))
    _join(ahead, pieces, beyond, skips=beside is None)
    if not keeps and len(ahead.line):
        way = _past(ahead, discs_on(ahead.floor, beside))
        ahead.take([Piece(way.only(shortened(way.points, ahead.floor, beside)), -1)])


def lay_blocked(ahead: LineAhead, touched: Window) -> bool:
    """Lay anew, over stands, the parts that a map blocks; return whether there are any.

    Args:
        ahead: the line.
        touched: window of the raster that may have changed.
    """
    line, floor = ahead.line, ahead.floor
    margin = floor.discs.radius_m / floor.geometry.resolution + 1.0
    blocked = [
        number
        for number in edges_near(line.points, touched, ahead.tally.shape, margin)
        if not ahead.is_clear(line.points[number], line.points[number + 1])
    ]
    if blocked[:1] == [0] and ahead.is_followed:
        # The first edge may lead out of a blocked place, and then it is never clear: with each map,
        # another such edge would be added.
        blocked = blocked[leads_out(floor, ahead.place, line.points[1]) :]
    if not blocked:
        return False
    bounds = [0, *(number + 1 for number in blocked), len(line)]
    pieces = [Piece(line.part(first, end), first) for first, end in pairwise(bounds)]
    _join(ahead, pieces, Piece(ahead.whole.part(len(line)), len(line)))
    return True


def _past(ahead: LineAhead, discs: Points) -> Polyline:
    """Return the line with a corner that keeps the robot off discs, if possible."""
    line = ahead.line
    if not len(discs) or len(line) < 2:
        return line
    here, to = line.points[:2]
    corner = corner_past(here, to, discs) if comes_nearer(here, to, discs) else None
    if corner is None or not (ahead.is_clear(here, corner) and ahead.is_clear(corner, to)):
        return line
    state = np.full(1, POLISHED, np.uint8)
    return line.part(0, 1).joined(Polyline(corner[None], line.cells[:1], state), line.part(1))


def _join(ahead: LineAhead, pieces: list[Piece], beyond: Piece, *, skips: bool = True) -> None:
    """Replace the line by a line joined from pieces.

    Args:
        ahead: the line.
        pieces: in order.
        beyond: the line beyond a cut, which is not joined.
        skips: whether the line may skip the stand of the robot's cell if the floor there is swept.
    """
    if not len(ahead.walk):
        ahead.take([])
        return
    floor, robot, tally, cell = ahead.floor, ahead.place, ahead.tally, ahead.cell
    points = np.concatenate([robot[None], lead_out(floor, robot)])
    state = np.full(len(points), POLISHED, np.uint8)
    stands = floor.stands
    joiner = Joiner(
        Polyline(points, np.full(len(points), cell), state),
        ahead.walk[: ahead.until],
        cell,
        stand=stands.stand,
        raw=stands.line,
        is_clear=ahead.is_clear,
        is_swept=lambda cell: skips and not tally.is_open(stands.stand(cell)),
        way=lambda a, b: corners_between(floor, a, b),
    )
    ahead.take([*joiner.joined(pieces), *([beyond] if len(beyond.line) else [])])
