"""Line ahead: the line that the robot drives along a walk, and its place on it.

Each point of the line lies on the fine raster, and has the index of its cell in the walk. So the
robot's place on the line gives its place on the walk. ``line.laying`` lays the line.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster, raster_to_map, raster_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D
from fasaco_edge.kernels.floor.line import LEAST_EDGE
from fasaco_edge.mission.line.pieces import Piece, exchanged
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
    Points,
    Polyline,
    Walk,
    edges_between,
    is_outside,
    lengths,
)
from fasaco_edge.mission.line.tally import SweepTally
from fasaco_edge.mission.line.way import fitting_radius, is_clear_between

# The robot's cell is the nearest cell with a clear straight way to its stand, among this many.
NEAREST_CELLS = 8


class LineAhead:
    """The line, which begins at the last point behind the robot.

    Attributes:
        floor: the floor under it.
        tally: how often the line sweeps each pixel.
        walk: int32 (n, 2), the walk, with the part that a map has cut off, as the next walk mostly
            leads there again.
        whole: the line along the walk.
        until: number of the walk's cells before the cut.
        cell: index of the robot's cell in the walk.

    Args:
        floor: the floor under it.
        is_curved: whether the robot cannot turn on the spot, and so is aligned with its line.
    """

    def __init__(self, floor: FloorMap, *, is_curved: bool = False) -> None:
        self.tally = SweepTally(floor)
        self.floor, self._geometry, self._is_curved = floor, floor.geometry, is_curved
        self.walk: Walk = np.empty((0, 2), np.int32)
        self.whole, self.until, self.cell = Polyline(), 0, 0
        self._place = PlaceOnLine()

    @property
    def line(self) -> Polyline:
        """The rest of the line, up to a cut."""
        return self.whole.part(0, self.whole.before(self.until))

    @property
    def is_cut(self) -> bool:
        """Whether the walk was cut off, and the line beyond is kept for the next walk."""
        return self.until < len(self.walk)

    def end_at_cut(self) -> None:
        """Drop the line beyond a cut: the walk ends there."""
        line = self.line
        self.tally.exchange(edges_between(self.whole.points[max(len(line) - 1, 0) :]), NO_EDGES)
        self.walk, self.whole = self.walk[: self.until], line

    def follow_floor(self, floor: FloorMap) -> bool:
        """Follow the floor to another raster; return whether the line had to be dropped.

        The line keeps its place on the map, to be checked there, unless the raster is rotated.
        """
        is_same, before = floor is self.floor, self._geometry
        self.floor, self._geometry = floor, floor.geometry
        if is_same and floor.shift is not None:
            shape = floor.geometry.rows, floor.geometry.cols
            if floor.shift != (0, 0) or shape != self.tally.shape:
                self._move(shape, floor.shift)
            return False
        self.tally = SweepTally(floor)
        if floor.geometry.origin.yaw == before.origin.yaw:
            self._carry(before)
            return False
        dropped, self.whole = bool(len(self.whole)), Polyline()
        return dropped

    def _carry(self, before: GridGeometry) -> None:
        """Convert the line to the floor's raster, of another size or shifted by part of a pixel.

        Some mappers begin their maps at the farthest point seen, so that pixels shift with it.
        """
        carried = partial(raster_to_raster, before, self._geometry)
        self.whole = self.whole.at(carried(self.whole.points))
        self.tally.exchange(NO_EDGES, edges_between(self.whole.points))
        self._place.here = carried(self._place.here[None])[0]

    def _move(self, shape: tuple[int, int], by: tuple[int, int]) -> None:
        points, before = self.whole.points, self.tally.shape
        self.whole = self.whole.moved(by)
        moved = self.whole.points
        # Sweeps outside a raster do not count, so edges at the rim are counted anew after the move.
        margin = self._tool + 1.0
        beyond = is_outside(points, before, margin) | is_outside(moved, shape, margin)
        is_edge = beyond[:-1] | beyond[1:]
        self.tally.exchange(edges_between(points, is_edge), NO_EDGES)
        self.tally.move(shape, by)
        self.tally.exchange(NO_EDGES, edges_between(moved, is_edge))
        self._place.here = self._place.here + np.array(by)

    def stop(self) -> None:
        """Number the walk's cells from the robot's cell on, where the kept path begins."""
        self.whole = self.whole.renumbered(-self.cell)
        self.walk, self.until, self.cell = self.walk[self.cell :], self.until - self.cell, 0

    def follow(self, walk: Walk, until: int) -> None:
        """Take another walk; ``until``: number of its cells before a cut."""
        self.walk, self.until, self.cell = walk, until, 0

    def take(self, pieces: list[Piece]) -> None:
        """Replace the line; changed parts are counted and polished again.

        Args:
            pieces: their ``begin`` is 0 or more if they are part of the previous line.
        """
        old = self.whole
        new, goes, comes = exchanged(old, pieces)
        if not np.array_equal(old.points[:2], new.points[:2]):
            if len(old) > 1:
                self.tally.pass_line(np.stack([old.points[0], self._place.on(old.points)]))
            self._place.along = 0.0
        self.tally.exchange(goes, comes)
        self.whole = new

    def drive(self, pose: Pose2D, farthest_m: float = 0.0) -> None:
        """Note the robot's pose; drop the driven part of the line.

        ``farthest_m``: the farthest it may have driven since the previous pose; 0 if unknown [m].
        """
        self.see(pose)
        look_m = max(LOOK_AHEAD_M, farthest_m)
        along = None
        if self._is_curved:
            yaw = pose.yaw - self.floor.geometry.origin.yaw
            along = np.array([math.sin(yaw), math.cos(yaw)])
        number = self._place.find(self.line.points, self._tool, look_m / self.tally.unit_m, along)
        if number is None:
            return
        if number > 0:
            self.tally.pass_line(self.line.points[: number + 1])
            self.tally.exchange(edges_between(self.line.points[: number + 1]), NO_EDGES)
            self.whole = self.whole.part(number)
        # Being in the last cell means arrival, which is checked below.
        first, second = self.line.cells[:2].tolist()
        nearest = self._nearest(max(first, self.cell), second + 1)
        self.cell = max(self.cell, min(nearest, self.until - 2))
        left_m = float(self.lengths(self._tool * self.tally.unit_m)[-1])
        if self._place.has_arrived(self.line.points, left_m, self._tool, self.tally.unit_m):
            self.cell = self.until - 1

    @property
    def is_followed(self) -> bool:
        """Whether the robot is on the line, within half the tool's width."""
        return self._place.is_on(self.line.points, self._tool)

    @property
    def here(self) -> Point:
        """The robot's position, x, y [m]."""
        row, col = self._place.here.tolist()
        return self.floor.geometry.to_map(col + 0.5, row + 0.5)

    @property
    def place(self) -> Points:
        """The robot's position, (2,): y, x [pixels]."""
        return self._place.here

    @property
    def beside(self) -> Beside | None:
        """The robot's offset from the line; None if it does not follow a line."""
        return self._place.beside(self.line.points, self.tally.unit_m) if self.is_followed else None

    @property
    def _tool(self) -> float:
        return self.floor.discs.tool_m / 2 / self.tally.unit_m

    def see(self, pose: Pose2D) -> None:
        """Note the robot's pose; its place on the line stays."""
        self._place.here = np.array(map_to_raster(self.floor.geometry, pose.x, pose.y))

    def next_xy(self, count: int) -> Points:
        """Return the first points of ``xy``, from the robot's place on, at most ``count``."""
        return raster_to_map(self.floor.geometry, self.from_place()[:count])

    def from_place(self) -> Points:
        """Return the line from the robot's place on it, float64 (n, 2), in pixels."""
        points = self.line.points
        if len(points) > 1:
            points = points.copy()
            points[0] = self._place.on(points)
        return points

    def xy(self) -> Points:
        """Return the line from the robot on, float64 (n, 2): x, y in the map frame [m].

        It begins at the robot's place on the line; if the disc does not fit at the robot's pose, it
        begins at that pose.
        """
        points, here = self.from_place(), self._place.here
        if len(points) > 1:
            on = points[0]
            radius = fitting_radius(self.floor, here)
            is_off = radius < self.floor.discs.radius_m / self.floor.geometry.resolution
            is_off = is_off and np.abs(on - here).sum() >= LEAST_EDGE
            if is_off and is_clear_between(self.floor, here, on, radius):
                points = np.concatenate([here[None], points])
        return raster_to_map(self.floor.geometry, points)

    def leads_on(self, xy: Points) -> bool:
        """Return whether the robot can drive straight to the first of some points, and along them.

        ``xy``: float64 (n, 2): x, y [m]; False for no points.
        """
        points = [np.array(map_to_raster(self._geometry, x, y)) for x, y in xy.tolist()]
        ways = pairwise([self._place.here, *points])
        return bool(points) and all(self.is_clear(a, b) for a, b in ways)

    def put(self, first: int, end: int, points: Points) -> None:
        """Replace the points from ``first`` to ``end`` by polished points, and update the counts.

        The first and the last point stay, and keep their cells.
        """
        line = self.whole
        begin, last = int(line.cells[first]), int(line.cells[end - 1])
        cells = begin + aligned(points, self._stands(begin, last + 1))
        state = line.state[first:end].min(initial=POLISHED)
        part = Polyline(points, cells, np.full(len(points), state, np.uint8))
        self.whole = line.part(0, first).joined(part, line.part(end))

    def put_curve(self, first: int, end: int, xy: Points) -> None:
        """Replace the points from ``first`` to ``end`` by a curve, float64 (n, 2): x, y [m].

        If ``first`` is 0, the curve begins at the robot.
        """
        line, geometry = self.whole, self.floor.geometry
        points = np.array([map_to_raster(geometry, x, y) for x, y in xy.tolist()])
        begin, last = int(line.cells[first]), int(line.cells[end - 1])
        cells = np.full(len(points), begin)
        if len(points) > 1:
            cells = begin + aligned(points, self._stands(begin, last + 1))
        part = Polyline(points, cells, np.full(len(points), CURVED, np.uint8))
        while end < len(line) and np.abs(points[-1] - line.points[end]).sum() < LEAST_EDGE:
            end += 1
        new = line.part(0, first).joined(part, line.part(end))
        if not first:
            self._place.along = 0.0
        self.tally.exchange(edges_between(line.points), edges_between(new.points))
        self.whole = new

    def _nearest(self, begin: int, end: int) -> int:
        """Return the nearest cell of the walk from ``begin`` to ``end``.

        The next walk begins there. So cells with a clear straight way to their stand come first.
        """
        stands, here = self._stands(begin, end), self._place.here
        nearest: list[int] = by_distance(here, stands)[:NEAREST_CELLS].tolist()
        seen = (number for number in nearest if self.is_clear(here, stands[number]))
        return begin + next(seen, nearest[0])

    def _stands(self, begin: int, end: int) -> Points:
        return self.floor.stands.stands_of(self.walk[begin : max(end, begin + 1)])

    def mark(self, first: int, end: int, state: int) -> None:
        """Mark points as MOVED or POLISHED."""
        self.whole = self.whole.marked(first, end, state)

    def lengths(self, within_m: float = math.inf) -> NDArray[np.float64]:
        """Return the distance along the line to each point, float64 (n,) [m]; the first is 0.

        The result may end at the first point that is farther than ``within_m`` [m].
        """
        unit_m = self.tally.unit_m
        return lengths(self.line.points, within_m / unit_m, self._place.along) * unit_m

    def is_clear(self, a: Points, b: Points) -> bool:
        """Return whether the robot can drive straight between two points, (2,): y, x [pixels]."""
        return is_clear_between(self.floor, a, b)
