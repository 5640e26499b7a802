"""Line ahead: the line that the robot drives along a walk, as points on the fine raster.

A new walk is laid as a line over stands, except where the previous line leads along the same cells:
there it stays as polished. Points keep the index of their cell in the walk, so the robot's place on
the line gives its place on the walk.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster, raster_to_map, raster_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, Window
from fasaco_edge.kernels.floor.line import LEAST_EDGE
from fasaco_edge.mission.line.pieces import Joiner, Piece, exchanged, kept_pieces
from fasaco_edge.mission.line.place_on_line import (
    LOOK_AHEAD_M,
    Beside,
    PlaceOnLine,
    aligned,
    by_distance,
)
from fasaco_edge.mission.line.polyline import (
    CURVED,
    NO_EDGES,
    POLISHED,
    Line,
    Points,
    Walk,
    edges_between,
    edges_near,
    is_outside,
    lengths,
)
from fasaco_edge.mission.line.tally import SweepTally
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

# Number of nearest cells tried for one that the robot can drive to straight.
TRIED = 8


class LineAhead:
    """Owns the line, which begins at the last point behind the robot, and its sweeps.

    Attributes:
        tally: counts of its sweeps.
        cell: index of the robot's cell in the walk.

    Args:
        floor: the floor under it.
        is_curved: whether the robot cannot turn on the spot, so that it is along the line.
    """

    def __init__(self, floor: FloorMap, *, is_curved: bool = False) -> None:
        self.tally = SweepTally(floor)
        self.cell = 0
        self._floor, self._geometry, self._is_curved = floor, floor.geometry, is_curved
        # The walk and its line; if a map has cut the walk off, with all beyond: the next walk
        # mostly leads there again. And how many of the walk's cells come before the cut.
        self._walk: Walk = np.empty((0, 2), np.int32)
        self._whole, self._until = Line(), 0
        self._place = PlaceOnLine()

    @property
    def line(self) -> Line:
        """The rest of the line, up to a cut."""
        return self._whole.part(0, self._whole.before(self._until))

    @property
    def is_cut(self) -> bool:
        """Whether the walk was cut off, and the line beyond is kept for the next one."""
        return self._until < len(self._walk)

    def end_at_cut(self) -> None:
        """Drop the line beyond a cut: the walk ends there."""
        line = self.line
        self.tally.exchange(edges_between(self._whole.points[max(len(line) - 1, 0) :]), NO_EDGES)
        self._walk, self._whole = self._walk[: self._until], line

    def follow_floor(self, floor: FloorMap) -> bool:
        """Follow the floor to another raster; return whether the line had to be dropped.

        The line keeps its place on the map, to be checked there, unless the raster is turned.
        """
        is_same, before = floor is self._floor, self._geometry
        self._floor, self._geometry = floor, floor.geometry
        if is_same and floor.shift is not None:
            shape = floor.geometry.rows, floor.geometry.cols
            if floor.shift != (0, 0) or shape != self.tally.shape:
                self._move(shape, floor.shift)
            return False
        self.tally = SweepTally(floor)
        if floor.geometry.origin.yaw == before.origin.yaw:
            self._carry(before)
            return False
        dropped, self._whole = bool(len(self._whole)), Line()
        return dropped

    def _carry(self, before: GridGeometry) -> None:
        """Convert to the floor's raster, which has another size or is shifted by part of a pixel.

        If a mapper's map begins at the farthest point seen, all its pixels move with that point.
        """
        carried = partial(raster_to_raster, before, self._geometry)
        self._whole = self._whole.at(carried(self._whole.points))
        self.tally.exchange(NO_EDGES, edges_between(self._whole.points))
        self._place.here = carried(self._place.here[None])[0]

    def _move(self, shape: tuple[int, int], by: tuple[int, int]) -> None:
        """Move to a raster of another shape, (rows, cols), and shift."""
        points, before = self._whole.points, self.tally.shape
        self._whole = self._whole.moved(by)
        moved = self._whole.points
        # Sweeps beyond a raster are not counted: such edges are subtracted before and added after.
        margin = self._tool + 1.0
        beyond = is_outside(points, before, margin) | is_outside(moved, shape, margin)
        is_edge = beyond[:-1] | beyond[1:]
        self.tally.exchange(edges_between(points, is_edge), NO_EDGES)
        self.tally.move(shape, by)
        self.tally.exchange(NO_EDGES, edges_between(moved, is_edge))
        self._place.here = self._place.here + np.array(by)

    def stop(self) -> None:
        """Leave the line for a path that is kept while the robot stands, as in a pause."""
        self._whole = self._whole.renumbered(-self.cell)
        self._walk, self._until, self.cell = self._walk[self.cell :], self._until - self.cell, 0

    def lay(
        self,
        walk: NDArray[np.int32],
        pose: Pose2D,
        *,
        is_cut: bool = False,
        keeps: bool = True,
        beside: NDArray[np.float64] | None = None,
    ) -> None:
        """Lay the line along a walk; it stays where it leads along the same cells.

        Args:
            walk: int32 (n, 2), cells (row, col), each a legal step from the previous one.
            pose: pose of the robot, in or near the first cell.
            is_cut: whether the walk ends where a map has cut off the previous one.
            keeps: False for a walk that is only a way, see ``way``: a polished line reaches its
                cells in another order, and by far longer ways.
            beside: discs that such a way keeps clear of, as ``Route.beside``.
        """
        self._see(pose)
        # A plan's cells are read-only; for those kernels would be compiled again, in the loop.
        walk = walk.copy()
        # Any line ends before a cell that is off the lattice.
        is_off = np.isnan(self._floor.stands.stands_of(walk)[:, 0])
        if is_off.any():
            walk = walk[: int(np.argmax(is_off))]
        ahead, line = self._walk[self.cell :], self._whole.renumbered(-self.cell)
        beyond = Piece(Line(), 0)
        is_beginning = keeps and len(walk) > 0 and common_beginning(walk, ahead) == len(walk)
        if is_beginning and (is_cut or len(walk) == len(ahead)):
            count = line.before(len(walk))
            if count > 1 and self.is_followed:
                self._walk, self._whole, self._until, self.cell = ahead, line, len(walk), 0
                return
            line, beyond = line.part(0, count), Piece(line.part(count), count)
        pieces = kept_pieces(line, ahead, walk) if keeps and len(line) and len(walk) else []
        if pieces and pieces[0].begin == 0 and not self.is_followed:
            # The robot is no longer behind its first point.
            rest = pieces[0].without_first()
            pieces[:1] = [rest] if len(rest.line) else []
        self._walk, self._until, self.cell = ahead if len(beyond.line) else walk, len(walk), 0
        self._join(pieces, beyond, skips=beside is None)
        if not keeps and len(self.line):
            way = self._past(discs_on(self._floor, beside))
            self._take([Piece(way.only(shortened(way.points, self._floor, beside)), -1)])

    def _past(self, discs: Points) -> Line:
        """Return the line with a corner by which the robot comes no nearer to discs, if it can."""
        line = self.line
        if not len(discs) or len(line) < 2:
            return line
        here, to = line.points[:2]
        corner = corner_past(here, to, discs) if comes_nearer(here, to, discs) else None
        if corner is None or not (self._is_clear(here, corner) and self._is_clear(corner, to)):
            return line
        state = np.full(1, POLISHED, np.uint8)
        return line.part(0, 1).joined(Line(corner[None], line.cells[:1], state), line.part(1))

    def _join(self, pieces: list[Piece], beyond: Piece, *, skips: bool = True) -> None:
        """Replace the line by one joined from pieces.

        Args:
            pieces: in order.
            beyond: the line beyond a cut, which is not joined.
            skips: whether it may skip the stand of the robot's cell, where that is swept.
        """
        if not len(self._walk):
            self._take([])
            return
        robot = self._place.here
        points = np.concatenate([robot[None], lead_out(self._floor, robot)])
        state = np.full(len(points), POLISHED, np.uint8)
        here = Line(points, np.full(len(points), self.cell), state)
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
        """Replace parts that a new map blocks by stands; return whether it blocks any.

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
            # The step that leads a robot out is never clear; do not add one with each map.
            blocked = blocked[leads_out(self._floor, self._place.here, line.points[1]) :]
        if not blocked:
            return False
        bounds = [0, *(number + 1 for number in blocked), len(line)]
        pieces = [Piece(line.part(first, end), first) for first, end in pairwise(bounds)]
        self._join(pieces, Piece(self._whole.part(len(line)), len(line)))
        return True

    def drive(self, pose: Pose2D, farthest_m: float = 0.0) -> None:
        """Note the robot's pose; the driven part is dropped.

        ``farthest_m``: how far it can have driven since the pose before; 0 if not known [m].
        """
        self._see(pose)
        look_m = max(LOOK_AHEAD_M, farthest_m)
        along = None
        if self._is_curved:
            yaw = pose.yaw - self._floor.geometry.origin.yaw
            along = np.array([math.sin(yaw), math.cos(yaw)])
        number = self._place.find(self.line.points, self._tool, look_m / self.tally.unit_m, along)
        if number is None:
            return
        if number > 0:
            self.tally.pass_line(self.line.points[: number + 1])
            self.tally.exchange(edges_between(self.line.points[: number + 1]), NO_EDGES)
            self._whole = self._whole.part(number)
        # At the last cell the robot has arrived, which is checked below.
        first, second = self.line.cells[:2].tolist()
        nearest = self._nearest(max(first, self.cell), second + 1)
        self.cell = max(self.cell, min(nearest, self._until - 2))
        left_m = float(self.lengths(self._tool * self.tally.unit_m)[-1])
        if self._place.has_arrived(self.line.points, left_m, self._tool, self.tally.unit_m):
            self.cell = self._until - 1

    @property
    def is_followed(self) -> bool:
        """Whether the robot is on the line, within half the tool."""
        return self._place.is_on(self.line.points, self._tool)

    @property
    def here(self) -> Point:
        """The robot's position, x, y [m]."""
        row, col = self._place.here.tolist()
        return self._floor.geometry.to_map(col + 0.5, row + 0.5)

    @property
    def place(self) -> Points:
        """The robot's position, (2,): y, x [pixels]."""
        return self._place.here

    @property
    def beside(self) -> Beside | None:
        """The robot's place beside the line; None if it does not follow one."""
        return self._place.beside(self.line.points, self.tally.unit_m) if self.is_followed else None

    @property
    def _tool(self) -> float:
        return self._floor.discs.tool_m / 2 / self.tally.unit_m

    def _see(self, pose: Pose2D) -> None:
        self._place.here = np.array(map_to_raster(self._floor.geometry, pose.x, pose.y))

    def xy(self) -> Points:
        """Return the line from the robot on, float64 (n, 2): x, y in the map frame [m].

        A robot beside its line begins at its place on it, unless its disc does not fit at its pose.
        """
        points, here = self._from_place(), self._place.here
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

        ``xy``: float64 (n, 2): x, y [m]; False without any.
        """
        points = [np.array(map_to_raster(self._geometry, x, y)) for x, y in xy.tolist()]
        ways = pairwise([self._place.here, *points])
        return bool(points) and all(self._is_clear(a, b) for a, b in ways)

    def next_xy(self, count: int) -> Points:
        """Return the first points of ``xy``, from the robot's place on, at most ``count``."""
        return raster_to_map(self._floor.geometry, self._from_place()[:count])

    def _from_place(self) -> Points:
        """Return the line from the robot's place on it."""
        points = self.line.points
        if len(points) > 1:
            points = points.copy()
            points[0] = self._place.on(points)
        return points

    def put(self, first: int, end: int, points: Points) -> None:
        """Replace the points from ``first`` to ``end`` by polished ones, and update the counts.

        The first and the last one stay, and keep their cells.
        """
        line = self._whole
        begin, last = int(line.cells[first]), int(line.cells[end - 1])
        cells = begin + aligned(points, self._stands(begin, last + 1))
        state = line.state[first:end].min(initial=POLISHED)
        part = Line(points, cells, np.full(len(points), state, np.uint8))
        self._whole = line.part(0, first).joined(part, line.part(end))

    def put_curve(self, first: int, end: int, xy: Points) -> None:
        """Replace the points from ``first`` to ``end`` by a curve, float64 (n, 2): x, y [m].

        From the first point on the curve begins at the robot.
        """
        line, geometry = self._whole, self._floor.geometry
        points = np.array([map_to_raster(geometry, x, y) for x, y in xy.tolist()])
        begin, last = int(line.cells[first]), int(line.cells[end - 1])
        cells = np.full(len(points), begin)
        if len(points) > 1:
            cells = begin + aligned(points, self._stands(begin, last + 1))
        part = Line(points, cells, np.full(len(points), CURVED, np.uint8))
        while end < len(line) and np.abs(points[-1] - line.points[end]).sum() < LEAST_EDGE:
            end += 1
        new = line.part(0, first).joined(part, line.part(end))
        if not first:
            self._place.along = 0.0
        self.tally.exchange(edges_between(line.points), edges_between(new.points))
        self._whole = new

    def _nearest(self, begin: int, end: int) -> int:
        """Return the nearest cell of the walk from ``begin`` to ``end``.

        It has to have a stand that the robot can drive to straight, as the next walk begins there.
        """
        stands, here = self._stands(begin, end), self._place.here
        nearest: list[int] = by_distance(here, stands)[:TRIED].tolist()
        seen = (number for number in nearest if self._is_clear(here, stands[number]))
        return begin + next(seen, nearest[0])

    def _stands(self, begin: int, end: int) -> Points:
        """Return the stands of the walk's cells from ``begin`` to ``end``, at least one."""
        return self._floor.stands.stands_of(self._walk[begin : max(end, begin + 1)])

    def note(self, first: int, end: int, state: int) -> None:
        """Mark points as MOVED or POLISHED."""
        self._whole = self._whole.marked(first, end, state)

    def lengths(self, within_m: float = math.inf) -> NDArray[np.float64]:
        """Return the distance along the line to each point, float64 (n,) [m]; the first is 0.

        Only for the first points, up to one that is farther than ``within_m`` [m], if there is one.
        """
        unit_m = self.tally.unit_m
        return lengths(self.line.points, within_m / unit_m, self._place.along) * unit_m

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

    def _is_clear(self, a: Points, b: Points) -> bool:
        return is_clear_between(self._floor, a, b)
