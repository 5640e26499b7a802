"""The fields that messages share: header, pose, and the placement of a grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.wire.cdr import CdrReader, CdrWriter, refuse
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_GRID_TILT,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
    QUATERNION_TOLERANCE,
)

SECOND_NS = 1_000_000_000
POSE_FLOATS = 7
"""A geometry_msgs/Pose: position x, y, z and quaternion x, y, z, w."""


def read_stamp(reader: CdrReader, field: str) -> int:
    """Read a builtin_interfaces/Time; return it in nanoseconds."""
    sec = reader.int32(f"{field}.sec")
    nanosec = reader.uint32(f"{field}.nanosec")
    if nanosec >= SECOND_NS:
        refuse(reader.message, f"{field}.nanosec", f"less than {SECOND_NS}", nanosec)
    return sec * SECOND_NS + nanosec


def write_stamp(writer: CdrWriter, stamp_ns: int, field: str) -> None:
    """Write nanoseconds as a builtin_interfaces/Time."""
    sec, nanosec = divmod(stamp_ns, SECOND_NS)
    writer.int32(sec, f"{field}.sec")
    writer.uint32(nanosec, f"{field}.nanosec")


def read_header(reader: CdrReader, field: str = "header") -> tuple[str, int]:
    """Read a std_msgs/Header; return its frame and its stamp [ns]."""
    stamp_ns = read_stamp(reader, f"{field}.stamp")
    return reader.string(f"{field}.frame_id"), stamp_ns


def write_header(writer: CdrWriter, frame: str, stamp_ns: int) -> None:
    """Write a std_msgs/Header."""
    write_stamp(writer, stamp_ns, "header.stamp")
    writer.string(frame, "header.frame_id")


def check_poses(poses: NDArray[np.float64], message: str, field_of: Callable[[int], str]) -> None:
    """Check poses, float64 (n, 7), each position x, y, z and quaternion x, y, z, w.

    Raises:
        MalformedMessage: a coordinate is not finite or too large, or a quaternion's norm
            is not 1; ``field_of(i)`` names pose i.
    """
    position, quaternion = poses[:, :3], poses[:, 3:]
    # Negated comparisons, so that NaN is caught too.
    with np.errstate(over="ignore", invalid="ignore"):
        far = ~(np.abs(position) <= MAX_COORDINATE_M)
        norm = np.sqrt(np.square(quaternion).sum(axis=1))
        skewed = ~(np.abs(norm - 1.0) <= QUATERNION_TOLERANCE)
    if far.any():
        index, axis = (int(i) for i in np.argwhere(far)[0])
        field = f"{field_of(index)}.position.{'xyz'[axis]}"
        refuse(message, field, f"within {MAX_COORDINATE_M:g} m of 0", position[index, axis])
    if skewed.any():
        index = int(np.flatnonzero(skewed)[0])
        field = f"norm of {field_of(index)}.orientation"
        refuse(message, field, f"1 within {QUATERNION_TOLERANCE}", norm[index])


def yaw_of(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the yaw [rad], float64 (n,), of quaternions x, y, z, w, float64 (n, 4).

    The second argument is 1 - 2 (y^2 + z^2) for a unit quaternion, and stays right for
    one that is off by the tolerance.
    """
    x, y, z, w = quaternions.T
    yaw: NDArray[np.float64] = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw


def planar_poses(xy: NDArray[np.float64], yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses, float64 (n, 7), at points (n, 2) [m] with yaws (n,) [rad]."""
    poses = np.zeros((len(xy), POSE_FLOATS))
    poses[:, :2] = xy
    with np.errstate(invalid="ignore"):
        poses[:, 5], poses[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
    return poses


def read_pose(reader: CdrReader, field: str) -> Pose2D:
    """Read a geometry_msgs/Pose; return its place in the plane."""
    poses = reader.float64s(POSE_FLOATS, field).reshape(1, POSE_FLOATS)
    check_poses(poses, reader.message, lambda _: field)
    return Pose2D(float(poses[0, 0]), float(poses[0, 1]), float(yaw_of(poses[:, 3:])[0]))


def write_pose(writer: CdrWriter, pose: Pose2D, field: str) -> None:
    """Write a pose in the plane as a geometry_msgs/Pose with z = 0."""
    poses = planar_poses(np.array([[pose.x, pose.y]]), np.array([pose.yaw]))
    check_poses(poses, writer.message, lambda _: field)
    writer.float64s(poses)


def read_grid_geometry(reader: CdrReader) -> GridGeometry:
    """Read a nav_msgs/MapMetaData; its time of loading is dropped."""
    read_stamp(reader, "info.map_load_time")
    # The shortest decimal that is this float32: 0.05 m stays 0.05 m.
    resolution = float(str(np.float32(reader.float32("info.resolution"))))
    _check_resolution(resolution, reader.message)
    cols, rows = reader.uint32("info.width"), reader.uint32("info.height")
    origin = reader.float64s(POSE_FLOATS, "info.origin").reshape(1, POSE_FLOATS)
    check_poses(origin, reader.message, lambda _: "info.origin")
    tilt = float(np.abs(origin[0, 3:5]).max())
    if tilt > MAX_GRID_TILT:
        refuse(
            reader.message,
            "info.origin.orientation",
            f"a turn about z (x and y within {MAX_GRID_TILT})",
            origin[0, 3:].tolist(),
        )
    x, y, yaw = float(origin[0, 0]), float(origin[0, 1]), float(yaw_of(origin[:, 3:])[0])
    return GridGeometry(rows, cols, resolution, Pose2D(x, y, yaw))


def write_grid_geometry(writer: CdrWriter, geometry: GridGeometry, stamp_ns: int) -> None:
    """Write a nav_msgs/MapMetaData, loaded at ``stamp_ns``."""
    write_stamp(writer, stamp_ns, "info.map_load_time")
    _check_resolution(geometry.resolution, writer.message)
    writer.float32(geometry.resolution)
    writer.uint32(geometry.cols, "info.width")
    writer.uint32(geometry.rows, "info.height")
    write_pose(writer, geometry.origin, "info.origin")


def read_cells(
    reader: CdrReader, rows: int, cols: int, max_cells: int, field: str = "data"
) -> NDArray[np.uint8]:
    """Read the last field, rows * cols bytes; return uint8 (rows, cols), a read-only view."""
    count = reader.length(field, 1)
    if not 0 < count <= max_cells:
        refuse(reader.message, f"length of {field}", f"1..{max_cells}", count)
    if count != rows * cols:
        expected = f"width x height = {cols} x {rows} = {rows * cols}"
        refuse(reader.message, f"length of {field}", expected, count)
    cells = reader.octets(count, field)
    reader.end()
    return cells.reshape(rows, cols)


def write_cells(writer: CdrWriter, cells: NDArray[np.generic], field: str = "data") -> None:
    """Write cells of one byte each, (rows, cols), as the last field."""
    if not cells.size:
        refuse(writer.message, f"length of {field}", "at least 1", 0)
    writer.uint32(cells.size, f"length of {field}")
    writer.octets(cells.tobytes())


def _check_resolution(resolution: float, message: str) -> None:
    if not MIN_RESOLUTION_M <= resolution <= MAX_RESOLUTION_M:
        expected = f"{MIN_RESOLUTION_M}..{MAX_RESOLUTION_M:g} m"
        refuse(message, "info.resolution", expected, resolution)
