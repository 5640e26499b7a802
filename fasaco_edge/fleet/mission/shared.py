"""Shared progress: the cells that the other robots of a fleet report as swept.

Each report has an epoch number, which changes whenever the sender forgets cells. Within an epoch
the set only grows, so reports are merged by union: lost, repeated and late messages do no harm, and
two halves of a split fleet agree once they receive each other's messages again. When the epoch
changes, the sender's earlier reports are dropped. The progress of an absent robot is kept.

Cells that this robot has to sweep again (a second pass, a reset, a map that moved) are disregarded
until the robot that swept them has forgotten them itself. Each robot reports which of its cells it
swept before its epoch. Some cells are swept once more than needed: the sender may not know when it
swept a cell, or swept it again in an epoch whose messages were all lost.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission.member_cells import Kept, MemberCells
from fasaco_edge.fleet.mission.tiles import (
    EMPTY,
    TILE_BYTES,
    Bits,
    Placed,
    bits_of,
    unpacked,
    window_of,
)
from fasaco_edge.mission.coverage.ledger import TILE, LedgerSnapshot
from fasaco_edge.mission.coverage.others_cells import Inside, OthersCells
from fasaco_edge.mission.events import SAME_LATTICE

if TYPE_CHECKING:
    # For types only: a daemon announces itself to its fleet before the kernels are loaded.
    from fasaco_edge.grid.geometry import Pose2D, Window
    from fasaco_edge.grid.lattice import Cell

# Largest numbers of robots, and of tiles of all robots (16 million cells).
MOST_ROBOTS, MOST_TILES = 32, 4096
MOST_TILES_OF_ONE = MOST_TILES // 8


@dataclass(frozen=True, slots=True)
class MapPlace:
    """Pose of the robot's map in the frame of its fleet.

    Attributes:
        origin: x, y of the map's origin [m], and the angle of its x axis [deg].
        frame: the frame of the map with this origin; "" for the first map received.
    """

    origin: tuple[float, float, float]
    frame: str = ""


class SharedProgress(OthersCells):
    """The cells that other robots have swept, on this robot's lattice.

    Args:
        place: pose of the robot's map in the frame of the fleet; None without such a frame.

    Attributes:
        epoch: epoch of this robot's own cells; 0 without a fleet.
        version: counter of changes.
    """

    def __init__(self, place: MapPlace | None = None) -> None:
        self._place = place
        # The frame of the map whose pose is ``place``; "" before the first map.
        self._map_frame = "" if place is None else place.frame
        # The frame whose map now shows another building; "" for none.
        self._left = ""
        self.epoch = 0
        self.version = 0
        self._robots: dict[str, MemberCells] = {}
        # The last query and its result; the tiles that have gained cells since.
        self._known: tuple[Window | None, NDArray[np.bool_]]
        self._known = None, np.zeros((0, 0), np.bool_)
        self._grown: set[Cell] = set()
        self._encoded: tuple[int, bytes] = 0, b""
        self._clear_too: Callable[[], None] = lambda: None

    def begin_epoch(self, epoch: int) -> None:
        """Start an epoch unused by earlier ledgers of this robot, unless an epoch was restored."""
        if not self.epoch:
            self.epoch = epoch
            self.version += 1

    def record_forgotten(self) -> None:
        """Note that this robot has forgotten some of its own cells."""
        if self.epoch:
            self.epoch += 1
            self.version += 1

    def enter(self, frame: str) -> None:
        """Note the active frame.

        If the configuration names no frame, the place belongs to the first map. On another floor
        the robot has another map, and its place is unknown.
        """
        if self._place is not None and not self._map_frame:
            self._map_frame = frame
            self.version += 1

    def leave_building(self, frame: str) -> None:
        """Note that the map in a frame now shows another building, without cells of others."""
        self._left = frame
        self.version += 1

    def reset(self) -> None:
        """Accept the next map as the map with the configured place."""
        self._left = ""
        self.version += 1

    def why_misplaced(self, frame: str) -> str:
        """Return why a map frame's pose in the fleet's frame is not known; "" if it is known."""
        if self._left and frame == self._left:
            return (
                "the map shows another building than before: `mission reset` makes it the fleet's"
            )
        if self._place is None or self._map_frame in ("", frame):
            return ""
        here = f"the map frame is {frame!r} here" if frame else "no map frame is known here"
        place = f"fleet.x_m, y_m and yaw_deg belong to {self._map_frame!r} (fleet.map_frame)"
        return f"{here}, {place}"

    def receive(
        self,
        robot: str,
        epoch: int,
        tiles: Iterable[Placed],
        members: Collection[str] = (),
        kept: Iterable[Placed] | None = None,
        lattice: Pose2D = SAME_LATTICE,
    ) -> bool:
        """Take in a robot's report; return whether cells must be swept again because of it.

        Args:
            robot: its name.
            epoch: epoch of its cells.
            tiles: places, with TILE_BYTES of bits each.
            members: names of robots that must not be displaced.
            kept: the cells of ``tiles`` that it swept before the epoch; None if not known.
            lattice: pose of its lattice in this robot's lattice [m]; a change drops its cells.

        Raises:
            FleetError: there is no room for its data.
        """
        member, has_lost = self._robots.get(robot), False
        if member is None:
            has_lost = self._make_room(robot, members)
            member = self._robots[robot] = MemberCells(epoch, lattice)
        if member.lattice != lattice:
            has_lost = bool(member.tiles)
            member.move(epoch, lattice)
            self._note_lost()
        elif member.epoch != epoch:
            has_lost = bool(member.tiles)
            if sum(len(one.disregarded) for one in self._robots.values()) > MOST_TILES:
                member.drop_gone()
            member.begin(epoch)
            self._note_lost()
        known = None if kept is None else dict(kept)
        for place, sent in tiles:
            bits, before = bits_of(sent), member.tiles.get(place)
            if before is None:
                self._check_room(robot)
                from_before = bits if known is None else bits & bits_of(known.get(place, EMPTY))
                without = member.disregarded.pop(place, np.uint8(0)) & from_before
                if without.any():
                    member.disregarded[place] = without
            after = bits if before is None else before | bits
            if before is None or not np.array_equal(before, after):
                member.tiles[place] = after
                if member.is_doubtful:
                    member.disregarded[place] = after
                self.version += 1
                self._grown.add(place)
        return has_lost

    def swept(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` others have swept, bool (rows, cols), read-only."""
        known, found = self._known
        if window != known:
            found = np.zeros((window.rows, window.cols), np.bool_)
            self._grown = self._places()
        elif self._grown:
            found = found.copy()
        for place in self._grown:
            whole = window_of(place)
            if common := whole.intersection(window):
                found[common.slices_in(window)] |= self._swept_of(place)[common.slices_in(whole)]
        self._grown = set()
        found.flags.writeable = False
        self._known = window, found
        return found

    def _swept_of(self, place: Cell) -> NDArray[np.bool_]:
        """Return which cells of a tile others have swept, bool (TILE, TILE)."""
        bits = np.zeros(TILE_BYTES, np.uint8)
        for member in self._robots.values():
            if place in member.tiles:
                bits |= member.counted(place)
        return unpacked(bits)

    def _note_lost(self) -> None:
        """Note that some cells may have to be swept again."""
        self._known = None, self._known[1]
        self.version += 1

    def disregard(self, inside: Inside) -> None:
        """Disregard all earlier sweeps of some cells.

        Args:
            inside: returns which cells are chosen, bool (n,), for rows and columns, int64 (n,).
        """
        for place in self._places():
            # Called once for all robots, as ``inside`` takes most of the time.
            swept = (one.tiles[place] for one in self._robots.values() if place in one.tiles)
            at = np.argwhere(unpacked(np.bitwise_or.reduce(list(swept))))
            rows, cols = (at + np.multiply(place, TILE)).T
            chosen = inside(rows, cols) if len(at) else np.zeros(0, np.bool_)
            if chosen.any():
                marked = np.zeros((TILE, TILE), np.bool_)
                marked[tuple(at[chosen].T)] = True
                self._disregard(place, np.packbits(marked))

    def _disregard(self, place: Cell, bits: Bits) -> None:
        for member in self._robots.values():
            if place in member.tiles and (gone := member.tiles[place] & bits).any():
                member.disregarded[place] = gone | member.disregarded.get(place, np.uint8(0))
        self._note_lost()

    def _places(self) -> set[Cell]:
        return {place for member in self._robots.values() for place in member.tiles}

    def clears(self, clear: Callable[[], None]) -> None:
        """Set what else ``clear`` calls."""
        self._clear_too = clear

    def clear(self) -> None:
        """Forget all reports: they belong to another frame or building."""
        self._clear_too()
        if self._robots:
            self._robots.clear()
            self._note_lost()

    def snapshot(self, cell_m: float) -> LedgerSnapshot:
        """Return the cells that others have swept, as one ledger."""
        tiles = {place: self._swept_of(place).astype(np.uint16) for place in self._places()}
        return LedgerSnapshot(cell_m, "", 0, MappingProxyType(tiles))

    def cells_of(self, robot: str) -> int:
        """Return the number of a robot's cells that are not disregarded."""
        member = self._robots.get(robot)
        return 0 if member is None else member.count

    def encode(self) -> bytes:
        """Return everything as bytes, to be stored with the ledger; b"" for nothing."""
        if self._encoded[0] != self.version:
            robots = {name: member.kept() for name, member in self._robots.items()}
            own = self.epoch, robots, self._origin, self._map_frame, self._left
            self._encoded = self.version, msgspec.json.encode(_StoredProgress(1, *own))
        return self._encoded[1]

    def restore(self, kept: bytes) -> None:
        """Restore from bytes of ``encode``; bytes of another version are ignored.

        If the configured place of this robot's map has changed, cells are ignored, too.
        """
        try:
            note = msgspec.json.decode(kept, type=_StoredProgress)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return
        self.epoch, self._left = note.epoch, note.left
        self._note_lost()
        is_in_place = note.origin == self._origin
        if is_in_place:
            self._map_frame = self._map_frame or note.map_frame
        robots = note.robots.items()
        self._robots = {name: kept.restored(is_in_place=is_in_place) for name, kept in robots}

    @property
    def _origin(self) -> tuple[float, float, float] | None:
        return None if self._place is None else self._place.origin

    def _make_room(self, robot: str, members: Collection[str]) -> bool:
        """Make room for another robot; return whether cells must be swept again because of it."""
        if len(self._robots) < MOST_ROBOTS:
            return False
        gone = sorted(self._robots.keys() - set(members))
        if not gone:
            raise FleetError(f"{robot}: progress of {MOST_ROBOTS} robots is kept at most")
        least = self._robots.pop(min(gone, key=self.cells_of))
        self._note_lost()
        return least.count > 0

    def _check_room(self, robot: str) -> None:
        if len(self._robots[robot].tiles) >= MOST_TILES_OF_ONE:
            raise FleetError(f"{robot}: {MOST_TILES_OF_ONE} tiles of a robot are kept at most")
        if sum(len(member.tiles) for member in self._robots.values()) >= MOST_TILES:
            raise FleetError(f"{robot}: {MOST_TILES} tiles of others' progress are kept at most")


class _StoredProgress(msgspec.Struct, frozen=True):
    version: Literal[1]
    epoch: int
    robots: dict[str, Kept]
    # Place of this robot's map in the frame of the fleet, and the frame of that map.
    origin: tuple[float, float, float] | None = None
    map_frame: str = ""
    # The frame whose map now shows another building.
    left: str = ""
