"""Room watch: looks for rooms on the newest map, so seldom that it costs little."""

from __future__ import annotations

import math
import zlib

import numpy as np

from fasaco_edge.errors import NotPublished
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.grid.rooms import FoundRooms, find_rooms
from fasaco_edge.grid.rotation import rotated_pose
from fasaco_edge.mission.map.loop_closure import Motion
from fasaco_edge.mission.map.room_book import RoomBook
from fasaco_edge.mission.map.room_edits import move
from fasaco_edge.mission.map.room_raster import Cut
from fasaco_edge.mission.map.room_update import update

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
