"""Commands to a mission: their JSON or YAML form and its schema.

``protocol/schema/mission.json`` is generated from these definitions; a test compares them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import msgspec

from fasaco_edge.errors import OrderError
from fasaco_edge.host.documents import StrictDocument, converted
from fasaco_edge.mission.orders.keep_outs import KeepOutDocument, keep_out_document, keep_out_of
from fasaco_edge.mission.orders.order import (
    Command,
    CommandName,
    OrderDocument,
    order_document,
    order_of,
)
from fasaco_edge.mission.orders.room_requests import RoomRequest, room_faults

FORGETFUL = ("start", "reset")
"""The commands that may forget covered cells."""


class CommandDocument(StrictDocument, frozen=True):
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

    def faults(self) -> Iterator[OrderError]:
        name, keep_out = self.command, self.keep_out
        if name not in get_args(CommandName):
            return
        if self.order is not None and name != "start":
            yield OrderError(f"goes with start alone, got it with {name}", key="order")
        if self.discard and name not in FORGETFUL:
            text = f"goes with {' and '.join(FORGETFUL)} alone, got it with {name}"
            yield OrderError(text, key="discard")
        if (keep_out is not None) != (name in ("keep_out_add", "keep_out_remove")):
            got = f"got it with {name}" if keep_out else f"missing with {name}"
            yield OrderError(f"goes with keep_out_add and keep_out_remove, {got}", key="keep_out")
        elif keep_out is not None and bool(keep_out.polygon) != (name == "keep_out_add"):
            got = "missing" if name == "keep_out_add" else "got it with keep_out_remove"
            yield OrderError(f"goes with keep_out_add, {got}", key="keep_out.polygon")
        yield from room_faults(name, self.room)


def read_command(document: object) -> Command:
    """Return the command in a parsed document.

    Raises:
        OrderError: a member is wrong; the text names it, the expected and the given value.
    """
    asked = converted(CommandDocument, document, OrderError)
    keep_out = None if asked.keep_out is None else keep_out_of(asked.keep_out)
    order = order_of(asked.order or OrderDocument())
    return Command(asked.command, order, keep_out, asked.discard, asked.room)


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
