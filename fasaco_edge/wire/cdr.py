"""Plain CDR, little endian: what ROS 2 and its Zenoh bridges put on the wire.

Sources: OMG DDS-RTPS 2.5, clause 10 (encapsulation header); OMG CORBA 3.4, clause 9.3
(transfer syntax); OMG DDS-XTypes 1.3, clause 7.6.3.1.2 (the header's padding count).
A primitive of n bytes is aligned to n, counted from the first byte after the header.
"""

from __future__ import annotations

import struct
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.limits import MAX_STRING_BYTES

ENCAPSULATION = b"\x00\x01\x00\x00"
HEADER_SIZE = len(ENCAPSULATION)
MAX_PADDING = 3

_INT32 = struct.Struct("<i")
_UINT32 = struct.Struct("<I")
_FLOAT32 = struct.Struct("<f")


def refuse(message: str, field: str, expected: str, got: object) -> NoReturn:
    """Raise MalformedMessage: ``message: field must be expected, got got``."""
    raise MalformedMessage(f"{message}: {field} must be {expected}, got {got}")


def aligned(offset: int, alignment: int) -> int:
    """Return the first multiple of ``alignment`` from ``offset`` on."""
    return offset + -offset % alignment


class CdrReader:
    """Reads the fields of one payload in order; each is checked before it is touched.

    All methods raise MalformedMessage where the payload ends before the field does.
    Bytes skipped for alignment are not looked at: some writers leave them unset.
    """

    __slots__ = ("_offset", "_payload", "message")

    def __init__(self, payload: bytes, message: str) -> None:
        """Begin at the first field of ``payload``, a CDR message of type ``message``."""
        header = payload[:HEADER_SIZE]
        if len(header) < HEADER_SIZE or header[:3] != ENCAPSULATION[:3] or header[3] > MAX_PADDING:
            refuse(message, "encapsulation header", "00 01 00 00", header.hex(" ") or "no bytes")
        self.message = message
        self._payload = payload
        self._offset = HEADER_SIZE

    @property
    def remaining(self) -> int:
        """Number of bytes not yet read."""
        return len(self._payload) - self._offset

    @property
    def position(self) -> int:
        """Number of bytes read since the header, what alignment is counted in."""
        return self._offset - HEADER_SIZE

    def int32(self, field: str) -> int:
        """Read a signed 32-bit integer."""
        value: int = _INT32.unpack_from(self._payload, self._take(4, 4, field))[0]
        return value

    def uint32(self, field: str) -> int:
        """Read an unsigned 32-bit integer."""
        value: int = _UINT32.unpack_from(self._payload, self._take(4, 4, field))[0]
        return value

    def float32(self, field: str) -> float:
        """Read a 32-bit float."""
        value: float = _FLOAT32.unpack_from(self._payload, self._take(4, 4, field))[0]
        return value

    def float64s(self, count: int, field: str) -> NDArray[np.float64]:
        """Read ``count`` 64-bit floats, float64 (count,), a read-only view of the payload."""
        start = self._take(8, 8 * count, field)
        return np.frombuffer(self._payload, "<f8", count, start)

    def octets(self, count: int, field: str) -> NDArray[np.uint8]:
        """Read ``count`` bytes, uint8 (count,), a read-only view of the payload."""
        return np.frombuffer(self._payload, np.uint8, count, self._take(1, count, field))

    def string(self, field: str) -> str:
        """Read a string: its length with the NUL, UTF-8, NUL."""
        length = self.uint32(f"length of {field}")
        if not 1 <= length <= MAX_STRING_BYTES + 1:
            refuse(self.message, f"length of {field}", f"1..{MAX_STRING_BYTES + 1}", length)
        text = self.octets(length, field).tobytes()
        if text.find(0) != length - 1:
            refuse(self.message, field, "a string with one NUL, at its end", repr(text))
        try:
            return text[:-1].decode()
        except UnicodeDecodeError as error:
            refuse(self.message, field, "UTF-8", f"{text!r} ({error.reason})")

    def length(self, field: str, least_bytes: int) -> int:
        """Read the length of a sequence whose items take at least ``least_bytes`` each."""
        count = self.uint32(f"length of {field}")
        if count * least_bytes > self.remaining:
            refuse(
                self.message,
                f"length of {field}",
                f"at most {self.remaining // least_bytes} in {self.remaining} bytes",
                count,
            )
        return count

    def peek(self, count: int) -> NDArray[np.uint8] | None:
        """Return the next ``count`` bytes, a read-only view, without taking them; None where
        there are fewer."""
        if count > self.remaining:
            return None
        return np.frombuffer(self._payload, np.uint8, count, self._offset)

    def end(self) -> None:
        """Check that nothing follows the last field but padding to a multiple of four.

        DDS pads its submessages so, and what comes over a bridge keeps it: zeros, counted
        in the header's last byte by some (XTypes), not counted by others (RTPS alone).
        """
        tail, counted = self._payload[self._offset :], self._payload[HEADER_SIZE - 1]
        rounded = not tail or (len(tail) <= MAX_PADDING and len(self._payload) % 4 == 0)
        if not rounded or any(tail) or counted not in (0, len(tail)):
            expected = (
                f"at its end after {self._offset} bytes, or {counted} counted ones of padding"
            )
            refuse(self.message, "payload", expected, f"{len(tail)} bytes more")

    def _take(self, alignment: int, size: int, field: str) -> int:
        start = HEADER_SIZE + aligned(self.position, alignment)
        if start + size > len(self._payload):
            refuse(
                self.message,
                field,
                f"{size} bytes at offset {start}",
                f"a payload of {len(self._payload)}",
            )
        self._offset = start + size
        return start


class CdrWriter:
    """Writes fields in order, with the alignment ``CdrReader`` expects."""

    __slots__ = ("_buffer", "message")

    def __init__(self, message: str) -> None:
        """Begin a CDR message of type ``message``."""
        self.message = message
        self._buffer = bytearray(ENCAPSULATION)

    @property
    def position(self) -> int:
        """Number of bytes written since the header, what alignment is counted in."""
        return len(self._buffer) - HEADER_SIZE

    def align(self, alignment: int) -> None:
        """Write zeros up to a multiple of ``alignment``."""
        self._buffer += bytes(-self.position % alignment)

    def int32(self, value: int, field: str) -> None:
        """Write a signed 32-bit integer."""
        if not -(2**31) <= value < 2**31:
            refuse(self.message, field, "an int32", value)
        self._put(4, _INT32.pack(value))

    def uint32(self, value: int, field: str) -> None:
        """Write an unsigned 32-bit integer."""
        if not 0 <= value < 2**32:
            refuse(self.message, field, "a uint32", value)
        self._put(4, _UINT32.pack(value))

    def float32(self, value: float) -> None:
        """Write a 32-bit float."""
        self._put(4, _FLOAT32.pack(value))

    def float64s(self, values: NDArray[np.float64]) -> None:
        """Write 64-bit floats of any shape, in row order."""
        self._put(8, values.astype("<f8", copy=False).tobytes())

    def octets(self, values: bytes) -> None:
        """Write bytes as they are."""
        self._buffer += values

    def string(self, value: str, field: str) -> None:
        """Write a string: its length with the NUL, UTF-8, NUL."""
        text = encoded_string(value, self.message, field)
        self.uint32(len(text), field)
        self.octets(text)

    def payload(self) -> bytes:
        """Return the message."""
        return bytes(self._buffer)

    def _put(self, alignment: int, packed: bytes) -> None:
        self.align(alignment)
        self._buffer += packed


def encoded_string(value: str, message: str, field: str) -> bytes:
    """Return ``value`` in UTF-8 with its NUL.

    Raises:
        MalformedMessage: it is too long, holds a NUL, or has no UTF-8.
    """
    try:
        text = value.encode()
    except UnicodeEncodeError as error:
        refuse(message, field, "UTF-8", f"{value!r} ({error.reason})")
    if len(text) > MAX_STRING_BYTES or 0 in text:
        refuse(message, field, f"at most {MAX_STRING_BYTES} bytes without NUL", repr(value))
    return text + b"\0"
