"""Room book: the only owner of rooms, with their numbers, names, settings and squares.

A sheet holds the rooms of one building in one map frame; the newest map shows the building of the
sheet in use. Over all sheets no two rooms get the same number. Maps change rooms through
``room_matching``, people through ``room_edits`` and the methods here. The module needs no kernels,
so that commands are accepted before there is a map.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.mission.orders.keep_outs import name_faults
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY
from fasaco_edge.mission.rooms.room_raster import Cut, RoomRaster
from fasaco_edge.planners.passes import Pass

if TYPE_CHECKING:
    from fasaco_edge.mission.coverage.loop_closure import Motion

# Limits on the rooms and cuts of a sheet, and on the number of a room, which has 16 bits.
MOST_ROOMS, MOST_CUTS, MOST_NUMBER = 250, 100, 65_000
# Least area of a room, and of a change that is more than noise of its border [m2].
LEAST_M2 = 1.0
# Most characters of a list of rooms in a text.
MOST_LISTED = 400
# Sheets that are kept: floors and buildings.
MOST_SHEETS = 8

BY_NUMBER = re.compile(r"room (\d{1,5})")
# Names that would be taken for a room's number.
LIKE_NUMBER = re.compile(r"(room )?\d+")


@dataclass(frozen=True, slots=True)
class RoomSettings:
    """Settings of a room: defaults for orders that name it.

    Attributes:
        passes: number of passes; None for the order's.
        kinds: settings of each pass; () if all are usual.
        skip: whether orders for everything leave the room out.
        priority: 0 to 100; rooms of higher priority come first if time or battery do not allow all.
    """

    passes: int | None = None
    kinds: tuple[Pass, ...] = ()
    skip: bool = False
    priority: int = USUAL_PRIORITY


USUAL = RoomSettings()


@dataclass(frozen=True, slots=True)
class Room:
    """A room.

    Attributes:
        id: its number, from 1.
        name: given by people; "" for none.
        is_by_hand: whether people have split or merged it, so that no map does.
        settings: defaults for orders.
        outline: corners (x, y) [m] in the map frame, without holes.
        area_m2: area of its squares [m2].
        neighbours: numbers of the rooms it is joined to, ascending.
        encloses: numbers of the rooms within its outline, for instance in a ring of corridors.
    """

    id: int
    name: str = ""
    is_by_hand: bool = False
    settings: RoomSettings = USUAL
    outline: Polygon = ()
    area_m2: float = 0.0
    neighbours: tuple[int, ...] = ()
    encloses: tuple[int, ...] = ()

    @property
    def is_kept(self) -> bool:
        """Whether no map may remove it, or join it with another kept room."""
        return bool(self.name) or self.is_by_hand or self.settings != USUAL

    @property
    def title(self) -> str:
        """Its name, or its number in words."""
        return self.name or f"room {self.id}"


@dataclass(slots=True, eq=False)
class RoomSheet:
    """The rooms of one building.

    Attributes:
        frame: frame of its map.
        raster: squares of the rooms.
        rooms: by their numbers.
        cuts: segments that people have split rooms along [m].
        gone: squares of rooms that maps have joined to others; if such a room reappears, it gets
            its number back.
        regions: scores of the regions that are no rooms yet, by their numbers in ``pending``.
        pending: squares of these regions.
        settled: the squares of rooms some updates ago, without what the newest maps have added.
        changes: scores of possible changes (what, room, other room): a room that may join another,
            or a part of a room that may. Each update that shows a change adds 1, others subtract 2.
    """

    frame: str
    raster: RoomRaster
    gone: RoomRaster
    pending: RoomRaster
    settled: RoomRaster
    rooms: dict[int, Room] = field(default_factory=dict)
    cuts: list[Cut] = field(default_factory=list)
    regions: dict[int, int] = field(default_factory=dict)
    changes: dict[tuple[str, int, int], int] = field(default_factory=dict)
    # Number of squares of each room that have changed since its outline was drawn.
    stale: dict[int, int] = field(default_factory=dict, init=False)
    # The next ``settled``, and the number of updates so far.
    _between: RoomRaster | None = field(default=None, init=False)
    _updates: int = field(default=0, init=False)

    @classmethod
    def empty(cls, frame: str, square_m: float) -> Self:
        """Return a sheet without rooms."""
        nothing = RoomRaster.empty(square_m)
        return cls(frame, nothing, nothing, nothing, nothing)

    def lay(
        self, raster: RoomRaster, gone: RoomRaster | None = None, pending: RoomRaster | None = None
    ) -> None:
        """Replace the squares of rooms, of rooms gone, and of pending regions."""
        self.raster, self.gone = raster, gone or self.gone
        self.pending = pending or self.pending

    def note(self, regions: dict[int, int], pending: RoomRaster) -> None:
        """Replace the regions that are no rooms yet."""
        self.regions, self.pending = regions, pending

    def settle(self, period: int) -> None:
        """Note the squares before an update: they settle after 1 to 2 times ``period`` updates."""
        if self._updates % period == 0:
            self.settled, self._between = self._between or self.raster, self.raster
        self._updates += 1

    def fix(self) -> None:
        """Take the present squares as settled, as people rely on them."""
        self.settled, self._between = self.raster, self.raster

    def move(self, motion: Motion) -> None:
        """Move all squares with the map."""
        self.lay(self.raster.moved(motion), self.gone.moved(motion), self.pending.moved(motion))
        self.fix()

    def note_changes(self, changes: dict[tuple[str, int, int], int]) -> None:
        """Replace the scores of changes."""
        self.changes = changes

    def cut(self, cuts: list[Cut]) -> None:
        """Replace the cuts."""
        self.cuts = cuts

    @property
    def is_settling(self) -> bool:
        """Whether a change is pending that would be complete after repeats of the same map."""
        return bool(self.regions or self.changes)

    @property
    def is_named(self) -> bool:
        """Whether the sheet has a room that no map may remove."""
        return any(room.is_kept for room in self.rooms.values())


@dataclass(slots=True, eq=False)
class RoomBook:
    """All rooms.

    Attributes:
        sheets: all sheets, the last used first.
        next_id: the next number.
        version: counter of changes of the published rooms.
        is_elsewhere: whether the map may show another building than the first sheet; then no sheet
            is in use until the next update.
    """

    sheets: list[RoomSheet] = field(default_factory=list)
    next_id: int = 1
    version: int = 0
    is_elsewhere: bool = False

    @property
    def sheet(self) -> RoomSheet | None:
        """The sheet in use; None before the first map, and while the building is unclear."""
        return self.sheets[0] if self.sheets and not self.is_elsewhere else None

    @property
    def rooms(self) -> tuple[Room, ...]:
        """The rooms of the sheet in use, sorted by number."""
        sheet = self.sheet
        return () if sheet is None else tuple(sheet.rooms[each] for each in sorted(sheet.rooms))

    @property
    def frame(self) -> str:
        """The frame of the sheet in use; "" without one."""
        return "" if self.sheet is None else self.sheet.frame

    def leave_building(self) -> None:
        """Note that the map shows another building: the next update looks for its sheet."""
        self.version += not self.is_elsewhere
        self.is_elsewhere = True

    def find(self, called: str | int) -> Room | None:
        """Return the room with a name, as "bath" or "room 3", or with a number; None for none."""
        rooms = {} if self.sheet is None else self.sheet.rooms
        if isinstance(called, int):
            return rooms.get(called)
        named = next((room for room in rooms.values() if room.name == called), None)
        by_number = BY_NUMBER.fullmatch(called)
        return rooms.get(int(by_number[1])) if named is None and by_number else named

    def room(self, called: str | int) -> Room:
        """Return the room with a name or number.

        Raises:
            OrderError: there is none; the text lists all rooms.
        """
        room = self.find(called)
        if room is None:
            raise OrderError(
                f"there is no room {called!r}; {self.listed()}",
                key="room.id",
                hint="name one of those, or its number",
            )
        return room

    def listed(self) -> str:
        """Return a list of the rooms as text."""
        titles = ", ".join(repr(room.name) if room.name else room.title for room in self.rooms)
        verb = "is" if len(self.rooms) == 1 else "are"
        return f"there {verb} {titles:.{MOST_LISTED}}" if titles else "no room is known yet"

    def name(self, called: str | int, name: str) -> None:
        """Give a room a name; "" removes its name.

        Raises:
            OrderError: there is no such room, another room has that name, or the name is not valid.
        """
        room = self.room(called)
        if name:
            self.check_name("room.name", name, room.id)
        self.put_by_hand(replace(room, name=name))

    def holes(self, room: Room) -> tuple[Polygon, ...]:
        """Return the outlines of the rooms that a room encloses."""
        rooms = {} if self.sheet is None else self.sheet.rooms
        return tuple(rooms[each].outline for each in room.encloses if each in rooms)

    def check_name(self, where: str, name: str, *of: int) -> None:
        """Check a new name of a room; the rooms ``of`` may have it already.

        Raises:
            OrderError: it is no valid name, or another room has it.
        """
        for fault in name_faults(name, where):
            raise fault
        if LIKE_NUMBER.fullmatch(name):
            raise OrderError(
                f"{name!r} would be read as the number of a room",
                hint="choose a name that is more than a number",
                key=where,
            )
        taken = self.find(name)
        if taken is not None and taken.id not in of:
            raise OrderError(
                f"room {taken.id} is {name!r} already",
                hint="choose another name, or give that room another one first",
                key=where,
            )

    def set(self, called: str | int, settings: RoomSettings) -> None:
        """Give a room settings.

        Raises:
            OrderError: there is no such room.
        """
        self.put_by_hand(replace(self.room(called), settings=settings))

    def put(self, room: Room) -> None:
        """Add a room to the sheet in use, or replace it if it has changed."""
        assert self.sheet is not None
        if self.sheet.rooms.get(room.id) != room:
            self.sheet.rooms[room.id] = room
            self.version += 1

    def put_by_hand(self, room: Room) -> None:
        """Replace a room as people have requested."""
        assert self.sheet is not None
        self.put(room)
        self.sheet.fix()

    def drop(self, rooms: Iterable[int]) -> None:
        """Remove rooms from the sheet in use."""
        assert self.sheet is not None
        for room in rooms:
            del self.sheet.rooms[room]
            self.version += 1

    @property
    def numbers_left(self) -> int:
        """Number of rooms that may be added to the sheet in use."""
        there = MOST_ROOMS if self.sheet is None else len(self.sheet.rooms)
        return min(MOST_ROOMS - there, MOST_NUMBER + 1 - self.next_id)

    def new_id(self) -> int:
        """Return a number that no room has had; 0 if there are too many rooms."""
        if self.numbers_left < 1:
            return 0
        self.next_id += 1
        return self.next_id - 1

    def pass_over(self, number: int) -> None:
        """Skip the numbers up to this one, which a lost room had."""
        self.next_id = max(self.next_id, number + 1)
        self.version += 1

    def forget(self, sheet: RoomSheet) -> None:
        """Drop a sheet, as another sheet is of the same building."""
        self.sheets.remove(sheet)
        self.version += 1

    def turn_to(self, sheet: RoomSheet) -> None:
        """Use a sheet, which may be new.

        Beyond ``MOST_SHEETS``, the least recently used sheet is dropped, if possible one without
        kept rooms.
        """
        if self.sheet is not sheet:
            self.version += 1
        self.sheets = [sheet, *(each for each in self.sheets if each is not sheet)]
        self.is_elsewhere = False
        if len(self.sheets) > MOST_SHEETS:
            blank = [each for each in self.sheets[1:] if not each.is_named]
            self.sheets.remove(blank[-1] if blank else self.sheets[-1])
