"""Common fields of messages: header and pose."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import NoReturn

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.text import one_line
from fasaco_edge.wire.limits import MAX_COORDINATE_M, MAX_STRING_BYTES, QUATERNION_TOLERANCE
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, encoded_string, refuse

SECOND_NS = 1_000_000_000
# What to do about values that look like those of another unit or notation.
IN_METRES = "publish positions in metres, in a frame whose origin is nearer"
IN_QUATERNIONS = "publish the orientation as a quaternion x, y, z, w of length 1"
POSE = struct.Struct("<7d")
"""A geometry_msgs/Pose: position x, y, z and quaternion x, y, z, w."""

_HEADER = struct.Struct("<iII")
_HEADER_NAMES = ("{}.stamp.sec", "{}.stamp.nanosec", "length of {}.frame_id")
_SENT_HEADER_NAMES = tuple(name.format("header") for name in _HEADER_NAMES)


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

    The second argument is 1 - 2 (y^2 + z^2) for a unit quaternion, and also right for one
    whose norm is within the tolerance.
    """
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def read_pose(reader: CdrReader, field: str) -> Pose2D:
    """Read a geometry_msgs/Pose; return the pose in the plane."""
    pose = reader.doubles(POSE, field)
    check_pose(pose, reader.message, field)
    return planar(pose)


def write_pose(writer: CdrWriter, pose: Pose2D, field: str) -> None:
    """Write a pose in the plane as a geometry_msgs/Pose with z = 0."""
    # math refuses an infinite angle; NaN passes here, and is refused later as any other.
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
