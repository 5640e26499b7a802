"""Poses of the robot: PoseStamped, PoseWithCovarianceStamped and Odometry."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.wire.cdr import CdrReader, CdrWriter, refuse
from fasaco_edge.wire.fields import read_header, read_pose, write_header, write_pose
from fasaco_edge.wire.schemas import ODOMETRY, POSE_STAMPED, POSE_WITH_COVARIANCE_STAMPED

COVARIANCE_FLOATS = 36
TWIST_FLOATS = 6


def decode_pose(payload: bytes, schema: str) -> StampedPose:
    """Return the robot's pose in a message of type ``schema``, one of ``topics.POSE_SCHEMAS``.

    Covariance and twist are stepped over, not looked at: publishers write NaN there for
    what they do not know.

    Raises:
        MalformedMessage: it is no such message, or poses do not come as ``schema``.
    """
    decode = _DECODERS.get(schema)
    if decode is None:
        known = ", ".join(_DECODERS)
        raise MalformedMessage(f"a pose must come as one of {known}, got {schema!r}")
    return decode(payload)


def encode_pose_stamped(stamped: StampedPose) -> bytes:
    """Return ``stamped`` as a geometry_msgs/PoseStamped.

    Raises:
        MalformedMessage: the message would be one that ``decode_pose`` refuses.
    """
    return _begin(POSE_STAMPED, stamped).payload()


def encode_pose_with_covariance_stamped(
    stamped: StampedPose, covariance: NDArray[np.float64] | None = None
) -> bytes:
    """Return ``stamped`` as a geometry_msgs/PoseWithCovarianceStamped.

    Args:
        stamped: the pose.
        covariance: float64 (36,), row-major over x, y, z [m] and the turns about x, y, z
            [rad]; None for zeros.

    Raises:
        MalformedMessage: the message would be one that ``decode_pose`` refuses.
    """
    writer = _begin(POSE_WITH_COVARIANCE_STAMPED, stamped)
    _write_floats(writer, covariance, COVARIANCE_FLOATS, "pose.covariance")
    return writer.payload()


def encode_odometry(
    stamped: StampedPose,
    child_frame: str = "base_link",
    covariance: NDArray[np.float64] | None = None,
    twist: NDArray[np.float64] | None = None,
    twist_covariance: NDArray[np.float64] | None = None,
) -> bytes:
    """Return ``stamped`` as a nav_msgs/Odometry.

    Args:
        stamped: the pose of ``child_frame``.
        child_frame: name of the robot's own frame.
        covariance: of the pose, float64 (36,), as in PoseWithCovarianceStamped; None for zeros.
        twist: float64 (6,), velocity along x, y, z [m/s] and about x, y, z [rad/s] in
            ``child_frame``; None for zeros.
        twist_covariance: float64 (36,); None for zeros.

    Raises:
        MalformedMessage: the message would be one that ``decode_pose`` refuses.
    """
    writer = CdrWriter(ODOMETRY)
    write_header(writer, stamped.frame, stamped.stamp_ns)
    writer.string(child_frame, "child_frame_id")
    write_pose(writer, stamped.pose, "pose.pose")
    _write_floats(writer, covariance, COVARIANCE_FLOATS, "pose.covariance")
    _write_floats(writer, twist, TWIST_FLOATS, "twist.twist")
    _write_floats(writer, twist_covariance, COVARIANCE_FLOATS, "twist.covariance")
    return writer.payload()


def _decode_pose_stamped(payload: bytes) -> StampedPose:
    reader = CdrReader(payload, POSE_STAMPED)
    frame, stamp_ns = read_header(reader)
    pose = read_pose(reader, "pose")
    reader.end()
    return StampedPose(pose, frame, stamp_ns)


def _decode_pose_with_covariance_stamped(payload: bytes) -> StampedPose:
    reader = CdrReader(payload, POSE_WITH_COVARIANCE_STAMPED)
    frame, stamp_ns = read_header(reader)
    pose = read_pose(reader, "pose.pose")
    reader.skip_float64s(COVARIANCE_FLOATS, "pose.covariance")
    reader.end()
    return StampedPose(pose, frame, stamp_ns)


def _decode_odometry(payload: bytes) -> StampedPose:
    reader = CdrReader(payload, ODOMETRY)
    frame, stamp_ns = read_header(reader)
    reader.string("child_frame_id")
    pose = read_pose(reader, "pose.pose")
    reader.skip_float64s(COVARIANCE_FLOATS, "pose.covariance")
    reader.skip_float64s(TWIST_FLOATS, "twist.twist")
    reader.skip_float64s(COVARIANCE_FLOATS, "twist.covariance")
    reader.end()
    return StampedPose(pose, frame, stamp_ns)


_DECODERS: dict[str, Callable[[bytes], StampedPose]] = {
    POSE_STAMPED: _decode_pose_stamped,
    POSE_WITH_COVARIANCE_STAMPED: _decode_pose_with_covariance_stamped,
    ODOMETRY: _decode_odometry,
}


def _begin(schema: str, stamped: StampedPose) -> CdrWriter:
    writer = CdrWriter(schema)
    write_header(writer, stamped.frame, stamped.stamp_ns)
    write_pose(writer, stamped.pose, "pose" if schema == POSE_STAMPED else "pose.pose")
    return writer


def _write_floats(
    writer: CdrWriter, values: NDArray[np.float64] | None, count: int, field: str
) -> None:
    if values is None:
        writer.align(8)
        writer.octets(bytes(8 * count))
        return
    if values.shape != (count,):
        refuse(writer.message, field, f"float64 ({count},)", f"{values.dtype} {values.shape}")
    writer.float64s(values)
