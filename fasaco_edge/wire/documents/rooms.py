"""Rooms on the daemon's map, with names and settings that people gave them."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from fasaco_edge.wire.documents.json_text import Amount, Corners, Count, Document, Ordinal, allowed
from fasaco_edge.wire.limits import MAX_COORDINATE_M

# A polygon of fewer corners has no inside.
LEAST_CORNERS = 3

Share = Annotated[float, Meta(ge=0, le=1)]


class RoomReport(Document, frozen=True):
    """A room.

    Attributes:
        id: its number; no other room ever gets it.
        name: given by people; "" for none: then it is shown and ordered as `room 3`, by its number.
        outline: corners x, y [m] in the frame of the map, without holes.
        neighbours: numbers of the rooms that it has a passage to.
        encloses: numbers of the rooms that lie within its outline without being part of it.
        swept: swept share of the room's reachable floor: in the present pass if the order includes
            the room, else before. In a fleet, or if only cells are counted, covered share of the
            reachable cells. Null if no floor is reachable.
        to_go_s: driving time of the path ahead within the room [s]; null without a path.
        passes: its passes in an order that names the room without passes, as in `mission.json`;
            null for as many as other zones get.
        skip: whether orders for everything leave it out.
        priority: if time or battery do not suffice for all rooms, those of higher priority come
            first.
    """

    id: Ordinal = 1
    name: str = ""
    outline: Corners = ()
    area_m2: Amount = 0.0
    neighbours: Annotated[tuple[Ordinal, ...], allowed(maxItems=250)] = ()
    encloses: Annotated[tuple[Ordinal, ...], allowed(maxItems=250)] = ()
    swept: Share | None = None
    to_go_s: Amount | None = None
    passes: int | tuple[str | dict[str, object], ...] | None = None
    skip: bool = False
    priority: Annotated[int, Meta(ge=0, le=100)] = 50

    @property
    def title(self) -> str:
        """Its name, or its number in words."""
        return self.name or f"room {self.id}"


class Rooms(Document, frozen=True):
    """The rooms of the building that the map shows.

    Attributes:
        frame: frame of the map; "" before the first map.
        revision: counter of changes of the rooms, except of their swept shares.
    """

    frame: str = ""
    revision: Count = 0
    rooms: Annotated[tuple[RoomReport, ...], allowed(maxItems=250)] = ()

    @property
    def outlined(self) -> tuple[RoomReport, ...]:
        """The rooms that can be drawn: the outline has three corners or more, on the map."""
        return tuple(
            room
            for room in self.rooms
            if len(room.outline) >= LEAST_CORNERS
            and all(abs(value) <= MAX_COORDINATE_M for corner in room.outline for value in corner)
        )
