"""Room commands: requests about rooms, applied to the room book."""

from __future__ import annotations

from fasaco_edge.errors import CommandError
from fasaco_edge.mission.orders.passes import passes_of
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.mission.rooms.room_book import RoomBook, RoomSettings

# Commands that need the map and the kernels.
ON_MAP = frozenset(("room_split", "room_merge"))


def check_before_map(command: str) -> None:
    """Check that a command can be carried out before there is a mission.

    Raises:
        CommandError: the command changes outlines of rooms.
    """
    if command in ON_MAP:
        raise CommandError(
            f"{command}: there is no map yet", hint="publish a map first, and ask again"
        )


def carry_out(book: RoomBook, command: str, asked: RoomRequest) -> None:
    """Carry out a command.

    Raises:
        OrderError: there is no such room, or the change is not possible; nothing has changed.
    """
    match command:
        case "room_name":
            book.name(asked.id, asked.name or "")
        case "room_set":
            before = book.room(asked.id).settings
            passes, kinds = before.passes, before.kinds
            if asked.passes is not None:
                passes, kinds = passes_of(asked.passes)
            skip = before.skip if asked.skip is None else asked.skip
            priority = before.priority if asked.priority is None else asked.priority
            book.set(asked.id, RoomSettings(passes, kinds, skip, priority))
        case _:
            # Imports kernels, which a daemon without a map has not loaded.
            from fasaco_edge.mission.rooms.room_edits import merge, split  # noqa: PLC0415

            if command == "room_split":
                assert asked.cut is not None
                start, end = asked.cut
                split(book, asked.id, (start, end))
            else:
                merge(book, [asked.id, *(asked.others or ())], asked.name or "")
