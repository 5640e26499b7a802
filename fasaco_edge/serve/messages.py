"""Messages between the server and its page: JSON, or a JSON head with a body of bytes.

All text is sanitized here before it is sent; the page shows it as text only, never as HTML.

A grid is sent as marks, a byte of flags for each pixel. Large grids are reduced: pixels are merged
by OR, so that no thin wall is lost. Amounts become levels: a level has the bits of all lower ones,
so that OR gives the highest. NumPy is not imported, to save memory on the robot.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import Any, Literal

import msgspec

from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.settings import MapSettings
from fasaco_edge.wire.messages.grids import GridOctets

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


# Marks of a map: unmarked pixels are unknown.
FREE, WALL = 1, 2
LEVELS = 7
# Default thresholds of a map [percent]; the configuration in the status may have others.
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65
# Values of a coverage grid, as in ``wire.messages.maps.CoverageValue``, which needs NumPy.
TO_COVER, COVERED, RECOVERED, BLOCKED = 0, 50, 75, 100
# Limit on the pixels of a grid message: a phone draws this many easily.
MOST_PIXELS = 2_000_000
COMPRESSION = 1


def map_marks(settings: MapSettings) -> bytes:
    """Return the mark of each value of a map, by the thresholds in force."""
    free, occupied = settings.free_at_most, settings.occupied_at_least
    free = FREE_AT_MOST if free is None else free
    occupied = OCCUPIED_AT_LEAST if occupied is None else occupied
    marks = (FREE if v <= free else WALL if v >= occupied else 0 for v in range(101))
    return bytes(marks).ljust(256, b"\0")


def _coverage_marks() -> bytes:
    marks = bytearray(256)
    for value in (TO_COVER, COVERED, RECOVERED):
        marks[value] = FREE
    marks[BLOCKED] = WALL
    return bytes(marks)


def level_marks(top: int) -> bytes:
    """Return the mark of each value: values 1 to ``top`` get ``LEVELS`` levels, 0 gets no bit."""
    levels = (-(-min(value, top) * LEVELS // top) for value in range(256))
    return bytes((1 << level) - 1 for level in levels)


COVERAGE_MARKS = _coverage_marks()
"""Marks of a coverage grid, used if no map is received."""
FLOOR_MARKS = level_marks(100)
"""Marks of swept floor in percent."""
FIELD_MARKS = level_marks(255)
"""Marks of a pheromone field."""
UNSWEPT_MARKS = bytes(1 << value - 1 if 1 <= value <= 6 else 0 for value in range(256))
"""Marks of unswept floor: a bit for each reason."""


def grid_message(kind: str, grid: GridOctets, marks: bytes) -> bytes:
    """Return a grid as a message for the page: its place and its compressed marks."""
    size, origin = grid.geometry, grid.geometry.origin
    octets = bytes(grid.octets).translate(marks)
    step = 1
    while -(-size.rows // step) * -(-size.cols // step) > MOST_PIXELS:
        step += 1
    rows, cols = -(-size.rows // step), -(-size.cols // step)
    if step > 1:
        octets = merged(octets, size.cols, step)
    place: dict[str, object] = {
        "rows": rows,
        "cols": cols,
        "pixel": size.resolution * step,
        "x": origin.x,
        "y": origin.y,
        "yaw": origin.yaw,
    }
    return framed(kind, place, zlib.compress(octets, COMPRESSION))


def merged(octets: bytes, cols: int, step: int) -> bytes:
    """Return marks, in rows of ``cols``, with each ``step`` x ``step`` of them merged."""
    width = -(-cols // step) * step
    rows = [octets[start : start + cols] for start in range(0, len(octets), cols)]
    parts = []
    for start in range(0, len(rows), step):
        row = _either(rows[start : start + step], cols).ljust(width, b"\0")
        parts.append(_either([row[index::step] for index in range(step)], width // step))
    return b"".join(parts)


def _either(rows: Sequence[bytes], size: int) -> bytes:
    marks = 0
    for row in rows:
        marks |= int.from_bytes(row, "little")
    return marks.to_bytes(size, "little")
