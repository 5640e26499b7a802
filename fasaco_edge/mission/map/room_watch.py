"""Room watch: looks for rooms on the newest map, so seldom that it costs little, and takes them in.

The regions of a map go to the sheet of the building that it shows.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import replace

import numpy as np

from fasaco_edge.errors import NotPublished
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.grid.rooms import FoundRooms, find_rooms
from fasaco_edge.grid.rotation import rotated_pose
from fasaco_edge.mission.map.loop_closure import Motion
from fasaco_edge.mission.map.room_book import MOST_NUMBER, RoomBook, RoomSheet
from fasaco_edge.mission.map.room_edits import move
from fasaco_edge.mission.map.room_matching import SETTLED, Matching, common_counts, slots_of
from fasaco_edge.mission.map.room_outline import refresh, stale
from fasaco_edge.mission.map.room_raster import (
    MOST_SQUARES,
    Cut,
    RoomRaster,
    sampled,
    window_over,
)

# Share of the floor in rooms that match from which a map shows the building of a sheet; region and
# room match if they have this share of all their floor in common.
ALIKE = MATCH = 0.5
# Squares are as wide as the map's pixels, and not narrower than this [m].
LEAST_SQUARE_M = 0.05


# Least time from one look to the next [s]; large maps, at some 0.2 s per million pixels, are looked
# at less often.
PERIOD_S, PIXELS_PER_S = 2.0, 50_000
# Maps of more pixels are looked at with wider ones: a look takes some 20 bytes a pixel.
MOST_PIXELS = 1_000_000
# A look waits at most this long for a step without a new map [s]: a plan comes first.
LATE_S = 1.0

ROOMS_STAY = "the robot goes on with the rooms it knows; report it with the log"


class RoomWatch:
    """Finds the rooms of maps for a book.

    Attributes:
        book: the rooms.
    """

    def __init__(self) -> None:
        self.book = RoomBook()
        # The map of the last step, and whether it was looked at.
        self._newest: OccupancyGrid | None = None
        self._is_seen = False
        # What was looked at last, the cuts on it, and what was found, as long as it is needed.
        self._key: tuple[object, ...] = ()
        self._cuts: tuple[Cut, ...] = ()
        self._found: FoundRooms | None = None
        self._due = -math.inf

    def look(self, grid: OccupancyGrid, now: float) -> None:
        """Look for rooms on a map at ``now`` [s] if that is due.

        Raises:
            NotPublished: that failed; the rooms known before are as good as they were.
        """
        try:
            self._look(grid, now)
        except Exception as error:
            why = f"rooms of this map were not published: {type(error).__name__}: {error}"
            raise NotPublished(why, hint=ROOMS_STAY) from error

    def _look(self, grid: OccupancyGrid, now: float) -> None:
        """Look for rooms on a map at ``now`` [s] if that is due.

        A map that stays is shown to the book again until nothing more follows from it.
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
        # A mapper of a robot that stands sends the same map again and again.
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
        """Return the rooms as far as they are those of a map; all without one."""
        is_here = grid is None or self.book.frame in ("", grid.frame)
        return self.book if is_here else RoomBook()

    def move(self, motion: Motion, lattice_deg: float) -> None:
        """Move the rooms with the map; the motion is given in a frame at an angle [deg]."""
        start, end = (_turned(pose, lattice_deg) for pose in (motion.start, motion.end))
        move(self.book, Motion(start, end))


def _turned(pose: Pose2D, by_deg: float) -> Pose2D:
    return rotated_pose(pose, by_deg) if by_deg else pose


def update(book: RoomBook, found: FoundRooms, frame: str) -> None:
    """Take in the regions of the newest map, which is in ``frame``.

    A map without regions changes nothing.
    """
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
    """Make the squares of a sheet wider by a factor, if that is more than 1."""
    if factor > 1:
        sheet.lay(sheet.raster.coarser(factor), sheet.gone.coarser(factor))
        sheet.note({}, RoomRaster.empty(sheet.raster.square_m))


def _sheet_for(book: RoomBook, found: FoundRooms, frame: str) -> RoomSheet:
    """Return the sheet of the building that a map shows, perhaps a new one."""
    in_use = book.sheet if book.frame == frame else None
    if in_use is not None and in_use.is_named:
        return in_use
    # A first look may have seen a corner: as long as no room in use has a name or settings,
    # other rooms may turn out to be those of the building.
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
    """Return how much of the floor of map or sheet lies in regions and rooms that match."""
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
