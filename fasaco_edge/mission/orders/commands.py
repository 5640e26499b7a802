"""Commands to a mission: their JSON or YAML form and its schema.

``protocol/schema/mission.json`` is generated from these definitions; a test compares them.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from fasaco_edge.errors import OrderError
from fasaco_edge.mission.orders.keep_outs import KeepOutDocument, keep_out_document, keep_out_of
from fasaco_edge.mission.orders.order import (
    Command,
    CommandName,
    Document,
    OrderDocument,
    converted,
    order_document,
    order_of,
)
from fasaco_edge.mission.orders.room_requests import RoomRequest, checked_room

FORGETFUL = ("start", "reset")
"""The commands that may forget covered cells."""


class CommandDocument(Document, frozen=True):
    """A command to a mission.

    Attributes:
        order: for `start` only.
        keep_out: for `keep_out_add` and, by its name alone, `keep_out_remove`.
        discard: for `start` and `reset`: whether they may forget what is covered. Without it, a
            command that would forget covered cells is refused (`would_forget`).
        room: for `room_name`, `room_split`, `room_merge` and `room_set` only.
    """

    command: CommandName
    order: OrderDocument | None = None
    keep_out: KeepOutDocument | None = None
    discard: bool = False
    room: RoomRequest | None = None


def read_command(document: object) -> Command:
    """Return the command in a parsed document.

    Raises:
        OrderError: a member is wrong; the text names it, the expected and the given value.
    """
    asked = converted(document, CommandDocument)
    name = asked.command
    if asked.order is not None and name != "start":
        raise OrderError(f"order goes with start alone, got it with {name}")
    if asked.discard and name not in FORGETFUL:
        raise OrderError(f"discard goes with {' and '.join(FORGETFUL)} alone, got it with {name}")
    if (asked.keep_out is not None) != (name in ("keep_out_add", "keep_out_remove")):
        got = f"got it with {name}" if asked.keep_out else f"missing with {name}"
        raise OrderError(f"keep_out goes with keep_out_add and keep_out_remove, {got}")
    keep_out = None if asked.keep_out is None else keep_out_of(asked.keep_out)
    if keep_out is not None and bool(keep_out.polygon) != (name == "keep_out_add"):
        got = "missing" if name == "keep_out_add" else "got it with keep_out_remove"
        raise OrderError(f"keep_out.polygon: goes with keep_out_add, {got}")
    room = checked_room(name, asked.room)
    return Command(name, order_of(asked.order or OrderDocument()), keep_out, asked.discard, room)


def order_faults(document: object) -> list[OrderError]:
    """Return all faults of a parsed order: each member and zone is judged alone, then together."""
    found: dict[str, OrderError] = {}
    for part, index in [*_parts(document), (document, 0)]:
        if part is document and found:
            break  # by itself it shows only the first of them
        try:
            order_of(converted(part, OrderDocument))
        except OrderError as error:
            text = str(error).replace("[0]", f"[{index}]", 1)
            found.setdefault(text, OrderError(text, hint=error.hint))
    return list(found.values())


def _parts(order: object) -> Iterator[tuple[object, int]]:
    """Yield parts of an order that can be judged alone, and the index of a zone or keep-out."""
    for name, value in order.items() if isinstance(order, dict) else ():
        if name not in ("zones", "keep_out") or not isinstance(value, list):
            yield {name: value}, 0
            continue
        for index, item in enumerate(value):
            members = item.items() if name == "zones" and isinstance(item, dict) else ()
            yield from (({name: [{"name": "zone", key: held}]}, index) for key, held in members)
            if "name" not in dict(members):
                yield {name: [{} if members else item]}, index
        if name == "zones" and all(isinstance(item, dict) and "name" in item for item in value):
            yield {name: [{"name": item["name"]} for item in value]}, 0


def read_recorded(document: dict[str, object]) -> Command:
    """Return a recorded command; without ``discard``, as in older releases, it may forget.

    Raises:
        OrderError: as ``read_command``.
    """
    forgets = document.get("command") in FORGETFUL
    return read_command({"discard": True} | document if forgets else document)


def command_document(command: Command) -> dict[str, object]:
    """Return the document of a command; ``read_command`` reads it."""
    document: dict[str, object] = {"command": command.name}
    if command.name == "start":
        document["order"] = order_document(command.order)
    if command.name in FORGETFUL:
        document["discard"] = command.discard
    if command.keep_out is not None:
        document["keep_out"] = keep_out_document(command.keep_out)
    if command.room is not None:
        document["room"] = msgspec.to_builtins(command.room)
    return document
