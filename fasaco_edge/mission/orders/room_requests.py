"""Requests to name, split, merge and set rooms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import msgspec
from msgspec import Meta

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import FARTHEST_M
from fasaco_edge.host.documents import StrictDocument
from fasaco_edge.mission.orders.keep_outs import LONGEST_NAME, PlaceName
from fasaco_edge.mission.orders.passes import Passes, passes_faults

# Most rooms that a merge joins with one.
MOST_MERGED = 50

# Priority of floor for which none is given.
USUAL_PRIORITY = 50
Priority = Annotated[int, Meta(ge=0, le=100)]
RoomNumber = Annotated[int, Meta(ge=1, le=65_000)]
Corner = Annotated[tuple[float, float], Meta(description="x, y [m] in the map frame")]


class RoomRequest(StrictDocument, frozen=True, omit_defaults=True):
    """A room, and what to change.

    Attributes:
        id: its number or its name.
        name: for `room_name`: the new name, or "" for none; for `room_merge`: optional name of
            the merged room.
        cut: for `room_split`: a segment from wall to wall.
        others: for `room_merge`: numbers or names of the rooms to merge with it.
        passes: for `room_set`: passes over the room in orders that name it and give none.
        skip: for `room_set`: whether orders for everything leave the room out.
        priority: for `room_set`: floor of higher priority comes first if time or battery do not
            allow all.
    """

    id: RoomNumber | PlaceName
    name: Annotated[str, Meta(max_length=LONGEST_NAME)] | None = None
    cut: (
        Annotated[list[Corner], Meta(min_length=2, max_length=2, description="its two ends")] | None
    ) = None
    others: (
        Annotated[list[RoomNumber | PlaceName], Meta(min_length=1, max_length=MOST_MERGED)] | None
    ) = None
    passes: Passes | None = None
    skip: bool | None = None
    priority: Priority | None = None

    def faults(self) -> Iterator[OrderError]:
        if any(not math.hypot(x, y) <= FARTHEST_M for x, y in self.cut or ()):
            yield OrderError(f"must be finite and within {FARTHEST_M:g} m of 0", key="cut")
        yield from passes_faults(self.passes)


# For each command: the members it takes besides the room's id, and those it requires.
_TAKES: dict[str, tuple[set[str], set[str]]] = {
    "room_name": ({"name"}, {"name"}),
    "room_split": ({"cut"}, {"cut"}),
    "room_merge": ({"others", "name"}, {"others"}),
    "room_set": ({"passes", "skip", "priority"}, set()),
}


def room_faults(command: str, asked: RoomRequest | None) -> Iterator[OrderError]:
    """Yield the faults of a command's request: members missing, or for another command."""
    if (asked is not None) != (command in _TAKES):
        got = "missing" if asked is None else "got it"
        yield OrderError(f"goes with {', '.join(_TAKES)}, {got} with {command}", key="room")
    elif asked is not None:
        takes, needs = _TAKES[command]
        members = msgspec.structs.asdict(asked).items()
        given = {name for name, value in members if value is not None and name != "id"}
        for other in sorted(given - takes):
            yield OrderError(f"does not go with {command}", key=f"room.{other}")
        for missing in sorted(needs - given):
            yield OrderError(f"missing with {command}", key=f"room.{missing}")
        if not (given or needs):
            text = f"{' or '.join(sorted(takes))} is missing with {command}"
            yield OrderError(text, key="room")
