"""Poses of frames: composition and inverse."""

import math

from fasaco_edge.grid.geometry import Pose2D


def composed(frame: Pose2D, pose: Pose2D) -> Pose2D:
    """Return a pose given in ``frame`` in the parent frame; yaw in [-pi, pi]."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return Pose2D(
        frame.x + pose.x * cos - pose.y * sin,
        frame.y + pose.x * sin + pose.y * cos,
        math.remainder(frame.yaw + pose.yaw, math.tau),
    )


def inverse(pose: Pose2D) -> Pose2D:
    """Return the inverse pose: the origin as seen from the frame at ``pose``."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Pose2D(-pose.x * cos - pose.y * sin, pose.x * sin - pose.y * cos, -pose.yaw)
