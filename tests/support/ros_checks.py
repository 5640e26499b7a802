"""What a robot under ROS 2 needs of what it hears."""

from __future__ import annotations

import struct
import time

import numpy as np

from tests.support.outsider import Heard
from tests.support.ros_robot import PATH
from tests.wire import oracle


def is_walk(heard: Heard) -> bool:
    return len(heard.payload) > 200


def check_path(heard: Heard, near: tuple[float, float]) -> None:
    """Check what a robot that follows the path needs."""
    path = oracle.from_bytes(PATH, heard.payload)
    assert path.header.frame_id == "map"
    assert path.header.stamp.nanosec == 1  # the map's
    xy = np.array([[pose.pose.position.x, pose.pose.position.y] for pose in path.poses])
    assert len(xy) > 50
    assert np.hypot(*(xy[0] - near)) < 0.5
    for pose, step in zip(path.poses, np.diff(xy, axis=0), strict=False):
        assert pose.header.frame_id == "map"
        turn = pose.pose.orientation
        ahead = [turn.w**2 - turn.z**2, 2 * turn.w * turn.z]
        np.testing.assert_allclose(ahead, step / np.hypot(*step), atol=1e-6)


def check_attachment(heard: Heard) -> int:
    """Check what rmw_zenoh takes apart; return the sequence number."""
    assert heard.attachment is not None
    assert len(heard.attachment) == 33
    sequence, time_ns, size = struct.unpack_from("<qqB", heard.attachment)
    assert size == 16
    assert abs(time_ns - time.time_ns()) < 60e9
    return sequence
