"""The coverage path: nav_msgs/Path, thousands of poses at once.

A PoseStamped ends with eight-byte floats, so every pose after the first begins at a multiple of
eight. If all poses have the same frame name, they are read and written as records of an array.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.wire.limits import MAX_COORDINATE_M, MAX_PATH_POSES, QUATERNION_TOLERANCE
from fasaco_edge.wire.messages.cdr import (
    POSE,
    SECOND_NS,
    CdrReader,
    CdrWriter,
    check_pose,
    encoded_string,
    read_header,
    refuse,
    write_header,
)
from fasaco_edge.wire.messages.path_points import read_path_pose, read_pose_count
from fasaco_edge.wire.schemas import PATH

# Poses computed at a time.
BLOCK_POSES = 16_384


@dataclass(frozen=True, slots=True, eq=False)
class PathMessage:
    """A path received from the bus.

    Attributes:
        frame: name of the frame of all poses.
        stamp_ns: time of the path [ns].
        xy: float64 (n, 2), read-only: points [m].
        yaw: float64 (n,), read-only: headings [rad].
    """

    frame: str
    stamp_ns: int
    xy: NDArray[np.float64]
    yaw: NDArray[np.float64]

    def __post_init__(self) -> None:
        self.xy.flags.writeable = self.yaw.flags.writeable = False


def encode_path(
    xy: NDArray[np.float64], yaw: NDArray[np.float64], frame: str, stamp_ns: int
) -> bytes:
    """Return a nav_msgs/Path of points (n, 2) [m] and headings (n,) [rad]; n may be 0.

    All poses carry the header's frame and stamp.
    """
    writer = CdrWriter(PATH)
    if xy.ndim != 2 or xy.shape[1] != 2 or yaw.shape != (len(xy),):
        refuse(writer.message, "poses", "points (n, 2), yaws (n,)", f"{xy.shape}, {yaw.shape}")
    if len(xy) > MAX_PATH_POSES:
        refuse(PATH, "length of poses", f"at most {MAX_PATH_POSES}", len(xy))
    write_header(writer, frame, stamp_ns)
    writer.uint32(len(xy), "length of poses")
    text = encoded_string(frame, writer.message, "header.frame_id")
    for first, last in ((0, min(len(xy), 1)), (1, len(xy))):
        records = np.zeros(max(last - first, 0), _record(writer.position, len(text)))
        records["sec"], records["nanosec"] = divmod(stamp_ns, SECOND_NS)
        records["length"] = len(text)
        records["frame"] = np.frombuffer(text, np.uint8)
        # A path of half a million poses is some 40 MB: only a block is held beside the message.
        for start in range(first, last, BLOCK_POSES):
            stop = min(start + BLOCK_POSES, last)
            poses = _planar_poses(xy[start:stop], yaw[start:stop])
            _check_poses(poses, writer.message, partial(_pose_field, first=start))
            records["pose"][start - first : stop - first] = poses
        writer.view(records.data)
    return writer.payload()


def decode_path(payload: bytes) -> PathMessage:
    """Return the path in a nav_msgs/Path.

    Raises:
        MalformedMessage: it is not such a message, has over ``MAX_PATH_POSES`` poses, or a pose
            names another frame than the path; a pose may name no frame.
    """
    reader = CdrReader(payload, PATH)
    frame, stamp_ns = read_header(reader)
    count = read_pose_count(reader)
    poses = _read_records(reader, frame, count)
    if poses is None:
        poses = _read_one_by_one(reader, frame, count)
    reader.end()
    _check_poses(poses, reader.message, _pose_field)
    return PathMessage(frame, stamp_ns, poses[:, :2].copy(), _yaw_of(poses[:, 3:]))


def _read_records(reader: CdrReader, frame: str, count: int) -> NDArray[np.float64] | None:
    """Read poses that all name ``frame``, float64 (count, 7).

    Return None, without taking any bytes, for other frames or an invalid message.
    """
    text = np.frombuffer(encoded_string(frame, reader.message, "header.frame_id"), np.uint8)
    first, rest = _record(reader.position, len(text)), _record(0, len(text))
    size = first.itemsize + (count - 1) * rest.itemsize
    view = reader.peek(size) if count else None
    if view is None:
        return None
    block = np.frombuffer(view, np.uint8)
    poses = np.empty((count, 7))
    for some, to in (
        (block[: first.itemsize].view(first), poses[:1]),
        (block[first.itemsize :].view(rest), poses[1:]),
    ):
        same_frame = (some["length"] == len(text)).all() and (some["frame"] == text).all()
        if not (same_frame and (some["nanosec"] < SECOND_NS).all()):
            return None
        to[:] = some["pose"]
    reader.take(1, size, "poses")
    return poses


def _read_one_by_one(reader: CdrReader, frame: str, count: int) -> NDArray[np.float64]:
    poses = np.empty((count, 7))
    for index in range(count):
        poses[index] = read_path_pose(reader, frame, index)
    return poses


def _check_poses(poses: NDArray[np.float64], message: str, field_of: Callable[[int], str]) -> None:
    """Check poses, float64 (n, 7), each position x, y, z and quaternion x, y, z, w.

    Raises:
        MalformedMessage: a coordinate is not finite or too large, or a quaternion's norm
            is not 1; ``field_of(i)`` names pose i.
    """
    position, quaternion = poses[:, :3], poses[:, 3:]
    # Negated comparisons also catch NaN.
    with np.errstate(over="ignore", invalid="ignore"):
        far = ~(np.abs(position) <= MAX_COORDINATE_M)
        norm = np.sqrt(np.square(quaternion).sum(axis=1))
        skewed = ~(np.abs(norm - 1.0) <= QUATERNION_TOLERANCE)
    for wrong in (far.any(axis=1), skewed):
        if wrong.any():
            index = int(np.argmax(wrong))
            check_pose(poses[index].tolist(), message, field_of(index))


def _yaw_of(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the yaw [rad], float64 (n,), of quaternions x, y, z, w, float64 (n, 4)."""
    x, y, z, w = quaternions.T
    yaw: NDArray[np.float64] = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw


def _planar_poses(xy: NDArray[np.float64], yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses, float64 (n, 7), at points (n, 2) [m] with yaws (n,) [rad]."""
    poses = np.zeros((len(xy), 7))
    poses[:, :2] = xy
    with np.errstate(invalid="ignore"):
        poses[:, 5], poses[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
    return poses


def _record(start: int, frame_size: int) -> np.dtype[np.void]:
    """Return the layout of a PoseStamped that begins at ``start``, a multiple of four."""
    frame_at = 12
    pose_at = frame_at + frame_size
    pose_at += -(start + pose_at) % 8
    return np.dtype(
        {
            "names": ["sec", "nanosec", "length", "frame", "pose"],
            "formats": ["<i4", "<u4", "<u4", (np.uint8, frame_size), ("<f8", 7)],
            "offsets": [0, 4, 8, frame_at, pose_at],
            "itemsize": pose_at + POSE.size,
        }
    )


def _pose_field(index: int, first: int = 0) -> str:
    return f"poses[{first + index}].pose"
