"""Encoders of the poses that robots send beside PoseStamped: with covariance, and odometry."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.wire.messages.cdr import CdrWriter, refuse, write_header, write_pose
from fasaco_edge.wire.schemas import ODOMETRY, POSE_WITH_COVARIANCE_STAMPED

COVARIANCE_FLOATS = 36
TWIST_FLOATS = 6


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
    writer = CdrWriter(POSE_WITH_COVARIANCE_STAMPED)
    write_header(writer, stamped.frame, stamped.stamp_ns)
    write_pose(writer, stamped.pose, "pose.pose")
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


def _write_floats(
    writer: CdrWriter, values: NDArray[np.float64] | None, count: int, field: str
) -> None:
    values = np.zeros(count) if values is None else values
    if values.shape != (count,):
        refuse(writer.message, field, f"float64 ({count},)", f"{values.dtype} {values.shape}")
    writer.doubles(struct.Struct(f"<{count}d"), *values)
