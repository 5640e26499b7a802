"""Messages between the server and its page: JSON, or a JSON head with a body of bytes.

All text is sanitized here before it is sent; the page shows it as text only, never as HTML.
"""

from __future__ import annotations

import struct
from typing import Any, Literal

import msgspec

from fasaco_edge.text import one_line

# Longest text on a page [characters].
MOST_TEXT = 400
_LENGTH = struct.Struct("<I")

Role = Literal["viewer", "operator"]
# Commands that the page may send: all but ``reset``.
Command = Literal[
    "start",
    "pause",
    "resume",
    "home",
    "cancel",
    "replan",
    "keep_out_add",
    "keep_out_remove",
    "room_name",
    "room_split",
    "room_merge",
    "room_set",
]


class Hello(msgspec.Struct, tag="hello", tag_field="kind", forbid_unknown_fields=True):
    """The first message of a page, with its token."""

    token: str = ""


class Wants(msgspec.Struct, tag="wants", tag_field="kind", forbid_unknown_fields=True):
    """Whether the page shows the pheromone field, and unswept floor."""

    field: bool = False
    unswept: bool = False


class Seek(msgspec.Struct, tag="seek", tag_field="kind", forbid_unknown_fields=True):
    """The time in a recording to show, since its beginning [s]."""

    at: float


class Order(msgspec.Struct, tag="command", tag_field="kind", forbid_unknown_fields=True):
    """A command for the robot.

    Attributes:
        id: returned with the reply.
        command: one of the page's commands.
        order: the order, as in ``protocol/schema/mission.json``; only for ``start``.
        discard: whether covered cells may be forgotten; only for ``start``.
        keep_out: as in that schema; only for ``keep_out_add`` and ``keep_out_remove``.
        room: as in that schema; only for commands on rooms.
    """

    id: int
    command: Command
    order: dict[str, Any] | None = None
    discard: bool = False
    keep_out: dict[str, Any] | None = None
    room: dict[str, Any] | None = None


FromPage = Hello | Wants | Seek | Order
_DECODER: msgspec.json.Decoder[FromPage] = msgspec.json.Decoder(FromPage)


def from_page(text: str | bytes) -> FromPage:
    """Decode a message of the page.

    Raises:
        msgspec.DecodeError: the message is invalid.
    """
    return _DECODER.decode(text)


def message_text(kind: str, **members: object) -> str:
    """Return a message as JSON with sanitized text."""
    return msgspec.json.encode({"kind": kind} | _cleaned(members)).decode()


def framed(kind: str, head: dict[str, object], body: bytes) -> bytes:
    """Return a message of a head and a body: length of the head (uint32), JSON head, body."""
    encoded = message_text(kind, **head).encode()
    return _LENGTH.pack(len(encoded)) + encoded + body


def _cleaned(value: Any) -> Any:  # noqa: ANN401 - any JSON
    if isinstance(value, str):
        return one_line(value, MOST_TEXT)
    if isinstance(value, dict):
        return {one_line(str(key), MOST_TEXT): _cleaned(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_cleaned(item) for item in value]
    return value
