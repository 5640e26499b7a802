"""Room watch: finds rooms on the newest map from time to time, and enters them in the room book.

The regions of a map go to the sheet of the building that it shows.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import replace

import numpy as np

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.grid.rooms import FoundRooms, find_rooms
from fasaco_edge.grid.rotation import rotated_pose
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.rooms.room_book import MOST_NUMBER, RoomBook, RoomSheet
from fasaco_edge.mission.rooms.room_edits import move
from fasaco_edge.mission.rooms.room_matching import SETTLED, Matching, common_counts, slots_of
from fasaco_edge.mission.rooms.room_outline import refresh, stale
from fasaco_edge.mission.rooms.room_raster import (
    MOST_SQUARES,
    Cut,
    RoomRaster,
    sampled,
    window_over,
)

# A map shows the building of a sheet if this share of the floor lies in matching rooms. A region
# and a room match if this share of their floor is common to both.
ALIKE = MATCH = 0.5
# Squares are as wide as the map's pixels, and not narrower than this [m].
LEAST_SQUARE_M = 0.05


# Searches are PERIOD_S apart [s], or 1 s for each PIXELS_PER_S pixels of a large map: a search
# takes some 0.2 s per million pixels.
PERIOD_S, PIXELS_PER_S = 2.0, 50_000
# Larger maps are made coarser before a search, which takes some 20 bytes per pixel.
MOST_PIXELS = 1_000_000
# A search waits up to this long for a step without a new map, as planning comes first [s].
LATE_S = 1.0


class RoomWatch:
    """Finds the rooms of maps, and enters them in a book.

    Attributes:
        book: the rooms.
    """

    def __init__(self) -> None:
        self.book = RoomBook()
        # The map of the last step, and whether it was searched.
        self._newest: OccupancyGrid | None = None
        self._is_seen = False
        # The last map searched, its cuts, and the rooms found on it while they are needed.
        self._key: tuple[object, ...] = ()
        self._cuts: tuple[Cut, ...] = ()
        self._found: FoundRooms | None = None
        self._due = -math.inf

    def update(self, grid: OccupancyGrid, now: float) -> None:
        """Search a map for rooms at ``now`` [s] if that is due.

        An unchanged map is entered again until it causes no further change. If the search fails,
        the rooms known before stay.
        """
        came, self._newest = grid is not self._newest, grid
        self._is_seen &= not came
        if self.book.sheet is not None and self.book.frame != grid.frame:
            self.leave_building()
        sheet = self.book.sheet
        cuts = () if sheet is None else tuple(sheet.cuts)
        is_settled = sheet is None or not sheet.is_settling
        is_seen = self._is_seen and cuts == self._cuts
        if now < self._due or (is_seen and is_settled):
            return
        if came and (self._due == -math.inf or now < self._due + LATE_S):
            self._due = max(self._due, now)
            return
        self._is_seen, self._cuts = True, cuts
        pixels = min(grid.cells.size, MOST_PIXELS)
        self._due = now + max(PERIOD_S, pixels / PIXELS_PER_S)
        # The mapper of a standing robot repeats the same map.
        key = zlib.crc32(np.ascontiguousarray(grid.cells).data), grid.geometry, grid.frame, cuts
        if key == self._key and is_settled:
            return
        if key != self._key or self._found is None:
            self._found = find_rooms(coarser(grid, MOST_PIXELS), cuts)
        self._key = key
        update(self.book, self._found, grid.frame)
        if self.book.sheet is None or not self.book.sheet.is_settling:
            self._found = None

    def leave_building(self) -> None:
        """Note that the map shows another building."""
        self.book.leave_building()
        self._key, self._is_seen = (), False

    def on(self, grid: OccupancyGrid | None) -> RoomBook:
        """Return the book if its rooms are in the frame of a map, else an empty book."""
        is_here = grid is None or self.book.frame in ("", grid.frame)
        return self.book if is_here else RoomBook()

    def move(self, motion: Motion, lattice_deg: float) -> None:
        """Move the rooms with the map; ``motion`` is in the frame of the lattice."""
        start, end = (rotated_pose(pose, lattice_deg) for pose in (motion.start, motion.end))
        move(self.book, Motion(start, end))


def update(book: RoomBook, found: FoundRooms, frame: str) -> None:
    """Enter the regions of the newest map, in ``frame``, in a book; without regions do nothing."""
    if not found.count:
        return
    sheet = _sheet_for(book, found, frame)
    _widen(sheet, round(found.geometry.resolution / sheet.raster.square_m))
    while True:
        window = window_over(found.geometry, sheet.raster.square_m)
        whole = Window.around(sheet.raster.window, window) or window
        if whole.rows * whole.cols <= MOST_SQUARES:
            break
        _widen(sheet, 2)
    book.turn_to(sheet)
    sheet.settle(SETTLED)
    before = sheet.raster.on(whole)
    sheet.lay(replace(sheet.raster, window=whole, ids=before.copy()))
    labels = sampled(found, window, sheet.raster.square_m)
    Matching(book, sheet, window, labels).apply(before)
    refresh(book, stale(sheet, before))


def _widen(sheet: RoomSheet, factor: int) -> None:
    if factor > 1:
        sheet.lay(sheet.raster.coarser(factor), sheet.gone.coarser(factor))
        sheet.note({}, RoomRaster.empty(sheet.raster.square_m))


def _sheet_for(book: RoomBook, found: FoundRooms, frame: str) -> RoomSheet:
    """Return the sheet of the building that a map shows, perhaps a new sheet."""
    in_use = book.sheet if book.frame == frame else None
    if in_use is not None and in_use.is_named:
        return in_use
    # The first map may show only a corner of the building. So an older sheet may turn out to show
    # this building, as long as no room in use is kept.
    others = [each for each in book.sheets if each.frame == frame and each is not in_use]
    alike = [(_alike(each, found), each) for each in others if each.is_named or in_use is None]
    share, best = max(alike, key=lambda each: each[0], default=(0.0, None))
    if best is not None and share >= ALIKE:
        if in_use is not None:
            book.forget(in_use)
        return best
    if in_use is not None:
        return in_use
    return RoomSheet.empty(frame, max(found.geometry.resolution, LEAST_SQUARE_M))


def _alike(sheet: RoomSheet, found: FoundRooms) -> float:
    """Return the floor in matching regions and rooms, as a share of the smaller of both floors."""
    window = window_over(found.geometry, sheet.raster.square_m)
    if window.rows * window.cols > MOST_SQUARES:
        return 0.0
    labels = sampled(found, window, sheet.raster.square_m)
    counts = common_counts(labels, slots_of(sheet.raster.on(window), sheet.rooms), len(sheet.rooms))
    squares = np.bincount(sheet.raster.ids.ravel(), minlength=MOST_NUMBER + 1)[sorted(sheet.rooms)]
    areas = counts[1:].sum(axis=1)
    floor, common = min(int(areas.sum()), int(squares.sum())), counts[1:, 1:]
    matches = common >= MATCH * (areas[:, np.newaxis] + squares - common)
    return float(common[matches].sum()) / floor if floor else 0.0
