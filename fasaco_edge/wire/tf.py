"""Transforms between frames: tf2_msgs/TFMessage, what ROS 2 sends on /tf and /tf_static."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.cdr import CdrReader
from fasaco_edge.wire.fields import POSE_FLOATS, read_header, yaw_of_one
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_TRANSFORM_TILT,
    MAX_TRANSFORMS,
    QUATERNION_TOLERANCE,
)
from fasaco_edge.wire.refusal import refuse
from fasaco_edge.wire.schemas import TF_MESSAGE

LEAST_TRANSFORM_BYTES = 80
"""Of a TransformStamped with empty names: stamp 8, twice length 4, NUL 1, padding 3, floats 56."""


@dataclass(frozen=True, slots=True)
class Transform:
    """Where a frame lies in another one, as it came.

    A robot sends the turns of its wheels and cameras, too, so that what ``placement`` holds is
    looked at only by who needs it, in ``planar``.

    Attributes:
        frame: name of the frame it is told in.
        child: name of the frame that lies there.
        stamp_ns: time of the transform [ns], by its publisher's clock.
        placement: translation x, y, z [m] and quaternion x, y, z, w.
    """

    frame: str
    child: str
    stamp_ns: int
    placement: tuple[float, ...]

    def planar(self) -> Pose2D:
        """Return the pose of ``child`` in the plane of ``frame``.

        Raises:
            MalformedMessage: a number is not finite or too large, the quaternion is none, or it
                tilts the plane.
        """
        which = f"of {self.child!r} in {self.frame!r}"
        x, y, z, *turn = self.placement
        # Negated comparisons, so that NaN is caught too.
        for axis, value in zip("xyz", (x, y, z), strict=True):
            if not abs(value) <= MAX_COORDINATE_M:
                expected = f"within {MAX_COORDINATE_M:g} m of 0"
                refuse(TF_MESSAGE, f"translation.{axis} {which}", expected, value)
        norm = math.hypot(*turn)
        if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
            refuse(
                TF_MESSAGE, f"norm of rotation {which}", f"1 within {QUATERNION_TOLERANCE}", norm
            )
        if max(abs(turn[0]), abs(turn[1])) > MAX_TRANSFORM_TILT:
            expected = f"a turn about z (x and y within {MAX_TRANSFORM_TILT})"
            refuse(TF_MESSAGE, f"rotation {which}", expected, turn)
        return Pose2D(x, y, yaw_of_one(*turn))


def decode_transforms(payload: bytes) -> tuple[Transform, ...]:
    """Return the transforms in a tf2_msgs/TFMessage; there may be none.

    Raises:
        MalformedMessage: it is no such message, or has over ``MAX_TRANSFORMS`` transforms.
    """
    reader = CdrReader(payload, TF_MESSAGE)
    count = reader.length("transforms", LEAST_TRANSFORM_BYTES)
    if count > MAX_TRANSFORMS:
        refuse(reader.message, "length of transforms", f"at most {MAX_TRANSFORMS}", count)
    transforms = tuple(_read_transform(reader, f"transforms[{index}]") for index in range(count))
    reader.end()
    return transforms


def _read_transform(reader: CdrReader, field: str) -> Transform:
    frame, stamp_ns = read_header(reader, f"{field}.header")
    child = reader.string(f"{field}.child_frame_id")
    placement = reader.float64s(POSE_FLOATS, f"{field}.transform").tolist()
    return Transform(frame, child, stamp_ns, tuple(placement))
