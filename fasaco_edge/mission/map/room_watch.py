"""Room watch: looks for rooms on the newest map, so seldom that it costs little."""

from __future__ import annotations

import math

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
# Maps of more pixels are looked at with wider ones: a look takes some 50 bytes a pixel.
MOST_PIXELS = 1_000_000
# A look waits at most this long for a step without a new map [s]: a plan comes first.
LATE_S = 1.0


class RoomWatch:
    """Finds the rooms of maps for a book.

    Attributes:
        book: the rooms.
    """

    def __init__(self) -> None:
        self.book = RoomBook()
        # The map of the last step; the map that was looked at last, the cuts on it, what was found.
        self._newest: OccupancyGrid | None = None
        self._seen: OccupancyGrid | None = None
        self._cuts: tuple[Cut, ...] = ()
        self._found: FoundRooms | None = None
        self._due = -math.inf

    def look(self, grid: OccupancyGrid, now: float) -> None:
        """Look for rooms on a map at ``now`` [s] if that is due.

        A map that stays is shown to the book again until nothing more follows from it.
        """
        came, self._newest = grid is not self._newest, grid
        if self.book.sheet is not None and self.book.frame != grid.frame:
            self.book.leave_building()
        sheet = self.book.sheet
        cuts = tuple(sheet.cuts) if sheet is not None else ()
        is_new = grid is not self._seen or cuts != self._cuts
        if now < self._due or not (is_new or (sheet is not None and sheet.is_settling)):
            return
        if (came and now < self._due + LATE_S) or (came and self._due == -math.inf):
            self._due = max(self._due, now)
            return
        if is_new or self._found is None:
            self._found = find_rooms(coarser(grid, MOST_PIXELS), cuts)
            self._seen, self._cuts = grid, cuts
        pixels = min(grid.cells.size, MOST_PIXELS)
        self._due = now + max(PERIOD_S, pixels / PIXELS_PER_S)
        update(self.book, self._found, grid.frame)
        if self.book.sheet is None or not self.book.sheet.is_settling:
            self._found = None

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
