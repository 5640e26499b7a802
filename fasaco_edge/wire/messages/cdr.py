"""Plain CDR, little endian: the wire format of ROS 2 and its Zenoh bridges.

Sources: OMG DDS-RTPS 2.5, clause 10 (encapsulation header); OMG CORBA 3.4, clause 9.3
(transfer syntax); OMG DDS-XTypes 1.3, clause 7.6.3.1.2 (the header's padding count).
A primitive of n bytes is aligned to n, counted from the first byte after the header.

The module also reads and writes header and pose, which many messages contain.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, NoReturn

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.text import one_line
from fasaco_edge.wire.limits import MAX_COORDINATE_M, MAX_STRING_BYTES, QUATERNION_TOLERANCE

ENCAPSULATION = b"\x00\x01\x00\x00"
HEADER_SIZE = len(ENCAPSULATION)
# The last byte counts padding.
_FIXED_HEADER = ENCAPSULATION[:3]
MAX_PADDING = 3

_UINT32 = struct.Struct("<I")
_LENGTH = ("length of {}",)
# Range and name of the numbers in a struct's format.
_RANGES: dict[str, tuple[float, float, str]] = {
    "i": (-(2**31), 2**31, "an int32"),
    "I": (0, 2**32, "a uint32"),
    "f": (-math.inf, math.inf, "a float32"),
}


SECOND_NS = 1_000_000_000
# Hints for values that seem to be in another unit or notation.
IN_METRES = "publish positions in metres, in a frame whose origin is nearer"
IN_QUATERNIONS = "publish the orientation as a quaternion x, y, z, w of length 1"
POSE = struct.Struct("<7d")
"""A geometry_msgs/Pose: position x, y, z and quaternion x, y, z, w."""

_HEADER = struct.Struct("<iII")
_HEADER_NAMES = ("{}.stamp.sec", "{}.stamp.nanosec", "length of {}.frame_id")
_SENT_HEADER_NAMES = tuple(name.format("header") for name in _HEADER_NAMES)

# Hint for a value that its type allows and the contract does not.
OF_A_VALUE = "correct this field where it is published"


def refuse(
    message: str, field: str, expected: str, got: object, hint: str | None = OF_A_VALUE
) -> NoReturn:
    """Raise MalformedMessage: ``message: field must be expected, got got``.

    ``hint`` says what to do; None where the bytes may be of another type or encoding.
    """
    raise MalformedMessage(f"{message}: {field} must be {expected}, got {got}", hint=hint)


def encoded_string(value: str, message: str, field: str) -> bytes:
    """Return ``value`` in UTF-8 with its NUL.

    Raises:
        MalformedMessage: it is too long, holds a NUL, or cannot be encoded in UTF-8.
    """
    try:
        text = value.encode()
    except UnicodeEncodeError as error:
        refuse(message, field, "UTF-8", f"{value!r} ({error.reason})")
    if len(text) > MAX_STRING_BYTES or 0 in text:
        refuse(message, field, f"at most {MAX_STRING_BYTES} bytes without NUL", repr(value))
    return text + b"\0"


class CdrReader:
    """Reads the fields of one payload in order; each is checked before use.

    All methods raise MalformedMessage if the payload ends before the field does.
    Bytes skipped for alignment are not checked: some writers leave them unset.
    Consecutive numbers are read in one call, and field names are made only for errors, as calls
    take most of the time of a small message.
    """

    __slots__ = ("_offset", "_payload", "_size", "message")

    def __init__(self, payload: bytes, message: str) -> None:
        """Begin at the first field of ``payload``, a CDR message of type ``message``."""
        size = len(payload)
        if size < HEADER_SIZE or payload[:3] != _FIXED_HEADER or payload[3] > MAX_PADDING:
            header = payload[:HEADER_SIZE].hex(" ") or "no bytes"
            refuse(message, "encapsulation header", "00 01 00 00", header, None)
        self.message = message
        self._payload = payload
        self._size = size
        self._offset = HEADER_SIZE

    @property
    def remaining(self) -> int:
        """Number of bytes not yet read."""
        return self._size - self._offset

    @property
    def position(self) -> int:
        """Number of bytes read since the header; alignment counts from there."""
        return self._offset - HEADER_SIZE

    def take(self, alignment: int, size: int, field: str) -> int:
        """Skip ``size`` aligned bytes of any value; return their offset in the payload."""
        start = self._offset + ((HEADER_SIZE - self._offset) & (alignment - 1))
        if start + size > self._size:
            self._cut(field, size, start)
        self._offset = start + size
        return start

    def words(
        self, layout: struct.Struct, names: Sequence[str], field: str = ""
    ) -> tuple[Any, ...]:
        """Read consecutive 32-bit numbers, as many as ``layout`` has; a tuple.

        Args:
            layout: little endian, of the formats i, I and f.
            names: names of the numbers, each with ``{}`` in place of ``field``.
            field: the field that they are part of.
        """
        start = self._offset + (-self._offset & 3)
        stop = start + layout.size
        if stop > self._size:
            there = max(self._size - start, 0) // 4
            self._cut(names[there].format(field), 4, start + 4 * there)
        self._offset = stop
        return layout.unpack_from(self._payload, start)

    def doubles(self, layout: struct.Struct, field: str) -> tuple[float, ...]:
        """Read 64-bit floats, as many as ``layout`` has; a tuple."""
        return layout.unpack_from(self._payload, self.take(8, layout.size, field))

    def octets(self, count: int, field: str) -> memoryview:
        """Read ``count`` bytes, a view of the payload."""
        start = self.take(1, count, field)
        return memoryview(self._payload)[start : start + count]

    def string(self, field: str) -> str:
        """Read a string: its length with the NUL, UTF-8, NUL."""
        return self.text(self.words(_UINT32, _LENGTH, field)[0], field)

    def text(self, length: int, field: str) -> str:
        """Read a string whose ``length`` with the NUL was read already."""
        if not 1 <= length <= MAX_STRING_BYTES + 1:
            expected = f"1..{MAX_STRING_BYTES + 1}"
            refuse(self.message, f"length of {field}", expected, length, None)
        start = self.take(1, length, field)
        text = self._payload[start : self._offset]
        if text.find(0) != length - 1:
            refuse(self.message, field, "a string with one NUL, at its end", repr(text), None)
        try:
            return text[:-1].decode()
        except UnicodeDecodeError as error:
            refuse(self.message, field, "UTF-8", f"{text!r} ({error.reason})", None)

    def length(self, field: str, least_bytes: int) -> int:
        """Read the length of a sequence whose items take at least ``least_bytes`` each."""
        count: int = self.words(_UINT32, _LENGTH, field)[0]
        if count * least_bytes > self._size - self._offset:
            refuse(
                self.message,
                f"length of {field}",
                f"at most {self.remaining // least_bytes} in {self.remaining} bytes",
                count,
                None,
            )
        return count

    def peek(self, count: int) -> memoryview | None:
        """Return the next ``count`` bytes, a view, without taking them; None if there are fewer."""
        if count > self.remaining:
            return None
        return memoryview(self._payload)[self._offset : self._offset + count]

    def end(self) -> None:
        """Check that only padding to a multiple of four follows the last field.

        DDS pads its submessages this way, and bridges keep the padding: zeros, counted in the
        header's last byte by some (XTypes), not counted by others (RTPS alone).
        """
        counted = self._payload[HEADER_SIZE - 1]
        if self._offset == self._size and not counted:
            return
        tail = self._payload[self._offset :]
        rounded = not tail or (len(tail) <= MAX_PADDING and self._size % 4 == 0)
        if not rounded or any(tail) or counted not in (0, len(tail)):
            expected = (
                f"at its end after {self._offset} bytes, or {counted} counted ones of padding"
            )
            refuse(self.message, "payload", expected, f"{len(tail)} bytes more", None)

    def _cut(self, field: str, size: int, start: int) -> NoReturn:
        expected = f"{size} bytes at offset {start}"
        refuse(self.message, field, expected, f"a payload of {self._size}", None)


class CdrWriter:
    """Writes fields in order, with the alignment ``CdrReader`` expects.

    Views are not copied before ``payload``: until then they must not change.

    Attributes:
        position: number of bytes written since the header; alignment counts from there.
    """

    __slots__ = ("_parts", "message", "position")

    def __init__(self, message: str) -> None:
        """Begin a CDR message of type ``message``."""
        self.message = message
        self._parts: list[bytes | memoryview] = [ENCAPSULATION]
        self.position = 0

    def words(self, layout: struct.Struct, names: Sequence[str], *values: float) -> None:
        """Write 32-bit numbers, as ``CdrReader.words`` reads them; ``names`` are for errors."""
        try:
            self._put(4, layout.pack(*values))
        except struct.error:
            for name, code, value in zip(names, layout.format[1:], values, strict=True):
                least, most, expected = _RANGES[code]
                if not least <= value < most:
                    refuse(self.message, name, expected, value)
            raise

    def uint32(self, value: int, field: str) -> None:
        """Write an unsigned 32-bit integer."""
        self.words(_UINT32, (field,), value)

    def doubles(self, layout: struct.Struct, *values: float) -> None:
        """Write 64-bit floats, as many as ``layout`` has."""
        self._put(8, layout.pack(*values))

    def view(self, values: memoryview) -> None:
        """Write the bytes of a contiguous array as they are."""
        self._parts.append(values)
        self.position += values.nbytes

    def octets(self, values: bytes) -> None:
        """Write bytes as they are."""
        self._put(1, values)

    def string(self, value: str, field: str) -> None:
        """Write a string: its length with the NUL, UTF-8, NUL."""
        text = encoded_string(value, self.message, field)
        self.uint32(len(text), field)
        self.octets(text)

    def payload(self) -> bytes:
        """Return the message."""
        return b"".join(self._parts)

    def _put(self, alignment: int, packed: bytes) -> None:
        if padding := -self.position & (alignment - 1):
            packed = bytes(padding) + packed
        self._parts.append(packed)
        self.position += len(packed)


def read_header(reader: CdrReader, field: str = "header") -> tuple[str, int]:
    """Read a std_msgs/Header; return its frame and its stamp [ns]."""
    sec, nanosec, length = reader.words(_HEADER, _HEADER_NAMES, field)
    if nanosec >= SECOND_NS:
        refuse_nanosec(reader, f"{field}.stamp", nanosec)
    return reader.text(length, f"{field}.frame_id"), sec * SECOND_NS + nanosec


def write_header(writer: CdrWriter, frame: str, stamp_ns: int) -> None:
    """Write a std_msgs/Header."""
    text = encoded_string(frame, writer.message, "header.frame_id")
    writer.words(_HEADER, _SENT_HEADER_NAMES, *divmod(stamp_ns, SECOND_NS), len(text))
    writer.octets(text)


def clipped(text: str) -> str:
    """Return a text as one line, cut to the limit of a message's string."""
    return one_line(text).encode(errors="replace")[:MAX_STRING_BYTES].decode(errors="ignore")


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad] of a quaternion.

    The second argument of atan2 is 1 - 2 (y^2 + z^2) for a unit quaternion, and correct for any
    other norm.
    """
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def read_pose(reader: CdrReader, field: str) -> Pose2D:
    """Read a geometry_msgs/Pose; return the pose in the plane."""
    pose = reader.doubles(POSE, field)
    check_pose(pose, reader.message, field)
    return planar(pose)


def write_pose(writer: CdrWriter, pose: Pose2D, field: str) -> None:
    """Write a pose in the plane as a geometry_msgs/Pose with z = 0."""
    # math.sin raises ValueError for an infinite angle; ``check_pose`` refuses NaN.
    half = pose.yaw / 2 if math.isfinite(pose.yaw) else math.nan
    floats = (pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))
    check_pose(floats, writer.message, field)
    writer.doubles(POSE, *floats)


def check_pose(pose: Sequence[float], message: str, field: str) -> None:
    """Check a pose: position x, y, z and quaternion x, y, z, w.

    Raises:
        MalformedMessage: a coordinate is not finite or too large, or the quaternion's norm
            is not 1.
    """
    x, y, z, qx, qy, qz, qw = pose
    far = MAX_COORDINATE_M
    norm = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    if (
        -far <= x <= far
        and -far <= y <= far
        and -far <= z <= far
        and abs(norm - 1.0) <= QUATERNION_TOLERANCE
    ):
        return
    for axis, value in zip("xyz", pose, strict=False):
        # A negated comparison also catches NaN.
        if not abs(value) <= far:
            refuse(message, f"{field}.position.{axis}", f"within {far:g} m of 0", value, IN_METRES)
    expected = f"1 within {QUATERNION_TOLERANCE}"
    refuse(message, f"norm of {field}.orientation", expected, norm, IN_QUATERNIONS)


def planar(pose: Sequence[float]) -> Pose2D:
    """Return the pose in the plane."""
    x, y, _, *quaternion = pose
    return Pose2D(x, y, yaw_of(*quaternion))


def refuse_nanosec(reader: CdrReader, field: str, nanosec: int) -> NoReturn:
    """Raise MalformedMessage for the nanoseconds of a time ``field``."""
    refuse(reader.message, f"{field}.nanosec", f"less than {SECOND_NS}", nanosec, None)
