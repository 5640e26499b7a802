"""Swept floor: the pixels of the map frame that the tool has passed over.

A pixel is swept if its centre was under the tool, a disc, on the straight segment between two
consecutive poses, and no wall lay between pixel and robot (``tool_sight``).

With noisy poses, the union of tool discs is wider than the strip that is swept. So the disc moves
along the steady track and shrinks by the track's error bound: not at all with exact poses, and
never below half of the tool. Between poses far apart it also shrinks by the distance that the robot
may have driven beside the segment, down to nothing (``segments``). Sweeps along the newest poses
are visible at once; they are stored and counted as soon as the track there is final.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Self

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.mission.coverage.floor_tiles import (
    FLOOR_TILE,
    PIXEL_M,
    ROW_BYTES,
    Bits,
    FloorSnapshot,
    Mask,
    SharedTiles,
    Similarity,
    TileKey,
    Tiles,
    count_bits,
    places_of,
    swept_in,
    swept_on,
    window_of,
)
from fasaco_edge.mission.coverage.segments import (
    TOUCH_M,
    Segment,
    segments_between,
    span,
    window_around,
    within,
)
from fasaco_edge.mission.coverage.steady_track import Position, SteadyTrack

if TYPE_CHECKING:
    from fasaco_edge.mission.coverage.tool_sight import ToolSight

# Two poses farther apart than this are a jump, unless the robot could have driven that far [tool
# widths].
JUMP_TOOLS = 2.0
# Limit on the tiles of a floor: 100 million pixels, the limit of planning. A tile takes 2 kB, and 2
# kB more if it has changed since it was last written. ``protocol/limits.yaml`` has the same number.
MOST_FLOOR_TILES = 6144
# Number of tiles dropped at once at the limit, the farthest first.
DROPPED_FLOOR_TILES = MOST_FLOOR_TILES // 16
NOWHERE = Window(0, 0, 0, 0)
# Limit on the pixels around the preliminary part of the track.
MOST_AHEAD = 1 << 22
# Limit on segments times pixels in one array operation, which bounds memory.
MOST_TOGETHER = 1 << 16
# Number of changes whose windows are remembered.
REMEMBERED = 64
ANYWHERE = Window(-(2**40), -(2**40), 2**40, 2**40)
# Grids are processed in blocks of about BLOCK x BLOCK pixels of floor.
BLOCK = 256


class SweptFloor:
    """The floor that the tool has passed over.

    Attributes:
        changes: counter of changes; each object has its own.
        pixels: number of swept pixels.
        forgotten: how often pixels were forgotten.
        dropped: number of tiles dropped at the limit ``MOST_FLOOR_TILES``, farthest first.
    """

    def __init__(self, tool_m: float, sight: ToolSight | None = None) -> None:
        """Start empty.

        Args:
            tool_m: width of the tool [m].
            sight: for a tool wider than the robot; else None.
        """
        self._sight = sight
        self.changes = 0
        self.pixels = self.forgotten = 0
        self.dropped = 0
        self._tool_m = tool_m
        self._track = SteadyTrack(tool_m)
        # The newest pose, and the place up to which sweeps are stored.
        self._last: Pose2D | None = None
        self._kept_to: Position | None = None
        # Preliminary sweeps after that place, None until computed; and a window around them.
        self._ahead: tuple[Window, Mask] | None = None
        self._around_ahead: Window | None = None
        blank = np.zeros((FLOOR_TILE, ROW_BYTES), np.uint8)
        self._tiles = SharedTiles(MOST_FLOOR_TILES, DROPPED_FLOOR_TILES, blank)
        # The newest changes: the value of ``changes`` after each, and its window.
        self._news: deque[tuple[int, Window]] = deque(maxlen=REMEMBERED)

    @classmethod
    def restored(
        cls, snapshot: FloorSnapshot, tool_m: float, sight: ToolSight | None = None
    ) -> Self:
        """Return a restored floor, without the last pose, as the track from it is unknown."""
        floor = cls(tool_m, sight)
        floor.changes, floor.pixels = snapshot.changes, snapshot.pixels
        floor._tiles.update(snapshot.tiles)
        return floor

    def snapshot(self) -> FloorSnapshot:
        """Return a copy; tiles are copied on write."""
        return FloorSnapshot(self._tiles.snapshot(), self.changes)

    @property
    def swept_m2(self) -> float:
        """Area of the swept floor [m2]."""
        return self.pixels * PIXEL_M * PIXEL_M

    def swept_in(self, window: Window) -> Mask:
        """Return which pixels of ``window`` are swept, bool (rows, cols)."""
        swept = swept_in(self._tiles, window)
        place, ahead = self._swept_ahead()
        if (common := window.intersection(place)) is not None:
            swept[common.slices_in(window)] |= ahead[common.slices_in(place)]
        return swept

    def swept_on(self, geometry: GridGeometry, window: Window | None = None) -> Mask:
        """Return which pixels of a grid have a swept centre, bool (rows, cols).

        Args:
            geometry: placement of the grid, at any yaw.
            window: window of its pixels; None for all.
        """
        whole = window or geometry.window
        found = np.zeros((whole.rows, whole.cols), np.bool_)
        place = Similarity.of(geometry)
        side = max(min(int(BLOCK * PIXEL_M / geometry.resolution), BLOCK), 1)
        for row in range(whole.row0, whole.row1, side):
            for col in range(whole.col0, whole.col1, side):
                block = Window(row, col, min(row + side, whole.row1), min(col + side, whole.col1))
                found[block.slices_in(whole)] = swept_on(self.swept_in, place, block)
        return found

    def record(self, pose: Pose2D, farthest_m: float = 0.0) -> None:
        """Record driving to ``pose``.

        ``farthest_m``: longest possible drive since the previous pose; 0 if unknown [m].
        """
        last, self._last = self._last, pose
        most_m = max(JUMP_TOOLS * self._tool_m, farthest_m)
        if last is not None and (apart := _apart(last, pose)) <= most_m:
            if not apart:
                return  # a repeated pose would bias the noise estimate
        else:
            self._end_track()
        before = self._around_ahead
        self._keep(self._track.receive_pose(pose, farthest_m))
        self._begin_ahead()
        # The preliminary sweeps have changed, too.
        self._record_change(Window.around(before, self._around_ahead))

    def changed_since(self, changes: int) -> Window | None:
        """Return the window that may have changed since change number ``changes``; None for none.

        ``ANYWHERE`` if that change is no longer remembered.
        """
        if changes == self.changes:
            return None
        news = [window for number, window in self._news if number > changes]
        if len(news) != self.changes - changes:
            return ANYWHERE
        return Window.around(*news)

    def break_track(self) -> None:
        """Note that the robot's track to its next pose is unknown."""
        self._end_track()
        self._last = None

    def forget(self, inside: Callable[[Window], Mask]) -> None:
        """Forget some pixels, except those under the tool now.

        Args:
            inside: returns which pixels of a window are chosen, bool (rows, cols).
        """
        self.leave(
            lambda tiles: [
                (place, tile & ~np.packbits(found, axis=1))
                for place, tile in tiles.items()
                if (found := inside(window_of(place))).any()
            ]
        )

    def leave(self, left_of: Callable[[Tiles], Iterable[tuple[TileKey, Bits]]]) -> None:
        """Forget pixels of all tiles at once, except those under the tool now.

        Args:
            left_of: returns the tiles that lose pixels, with their remaining pixels.
        """
        self._end_track()
        before = self.pixels
        for place, left in left_of(self._tiles):
            count = count_bits(left)
            self.pixels -= count_bits(self._tiles[place]) - count
            if count:
                self._tiles.put(place, left)
            else:
                self._tiles.drop(place)
        if self.pixels != before:
            self.forgotten += 1
            self._record_change(ANYWHERE)
        if self._last is not None:
            self._keep(self._track.receive_pose(self._last))
            self._begin_ahead()

    def _end_track(self) -> None:
        """Store the sweeps up to the newest pose."""
        before = self._around_ahead
        self._keep(self._track.end())
        self._kept_to = None
        self._begin_ahead()
        self._record_change(before)

    def _record_change(self, window: Window | None) -> None:
        if window is not None:
            self.changes += 1
            self._news.append((self.changes, window))

    def _keep(self, places: list[Position]) -> None:
        for place in places:
            for segment in segments_between(self._kept_to or place, place, self._tool_m):
                window = window_around(segment)
                self._mark(window, np.packbits(self._under([segment], window), axis=1))
            self._kept_to = place

    def _begin_ahead(self) -> None:
        """Set the window of the preliminary sweeps; they are computed on demand."""
        self._ahead, self._around_ahead = None, None
        box = self._track.box_ahead()
        if box is None:
            return
        corners = [(box[0], box[1]), (box[2], box[3])]
        if self._kept_to is not None:
            corners.append(self._kept_to.point)
        xs, ys = zip(*corners, strict=True)
        rows = span(min(ys), max(ys), 0.5 * self._tool_m + TOUCH_M, 1)
        cols = span(min(xs), max(xs), 0.5 * self._tool_m + TOUCH_M, 8)
        self._around_ahead = Window(rows[0], cols[0], rows[1], cols[1])

    def _swept_ahead(self) -> tuple[Window, Mask]:
        if self._ahead is None:
            places = self._track.ahead()
            segments = self._segments_ahead(places)
            windows = [window_around(segment) for segment in segments]
            whole = Window.around(*windows) or NOWHERE
            if whole.rows * whole.cols > MOST_AHEAD:
                # Poses this noisy show no driving, and their mask would take much memory.
                whole, segments = NOWHERE, []
            if len(segments) * whole.rows * whole.cols <= MOST_TOGETHER:
                ahead = self._under(segments, whole)
            else:
                ahead = np.zeros((whole.rows, whole.cols), np.bool_)
                for segment, window in zip(segments, windows, strict=True):
                    ahead[window.slices_in(whole)] |= self._under([segment], window)
            self._ahead = whole, ahead
        return self._ahead

    def _segments_ahead(self, places: list[Position]) -> list[Segment]:
        """Return the sweeps along places, from the last stored place on."""
        chain = [self._kept_to or places[0], *places] if places else []
        return [
            segment
            for start, end in pairwise(chain)
            for segment in segments_between(start, end, self._tool_m)
        ]

    def _under(self, segments: Sequence[Segment], window: Window) -> Mask:
        """Return which pixel centres of a window the tool passed with certainty."""
        under = within(segments, window)
        if self._sight is None:
            return under
        return self._sight.of(under, within(segments, window, self._sight.radius_m), window)

    def _mark(self, window: Window, bits: Bits) -> None:
        """Mark pixels of a window; its columns are whole bytes."""
        has_changed = False
        for place in places_of(window):
            part = window_of(place)
            common = window.intersection(part)
            assert common is not None
            new = bits[_bytes_in(common, window)]
            inside = _bytes_in(common, part)
            tile = self._tiles.get(place)
            if tile is not None:
                new = new & ~tile[inside]
            if count := count_bits(new):
                self._make_room(place)
                self._tiles.writable(place)[inside] |= new
                self.pixels += count
                has_changed = True
        if has_changed:
            self._record_change(window)

    def _make_room(self, place: TileKey) -> None:
        """Drop the tiles farthest from ``place`` if there is no room for another."""
        if dropped := self._tiles.make_room(place):
            self.pixels -= sum(map(count_bits, dropped))
            self.dropped += len(dropped)
            self.forgotten += 1
            self._record_change(ANYWHERE)


def _apart(one: Pose2D, other: Pose2D) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


def _bytes_in(part: Window, outer: Window) -> tuple[slice, slice]:
    rows, cols = part.slices_in(outer)
    return rows, slice(cols.start // 8, cols.stop // 8)
