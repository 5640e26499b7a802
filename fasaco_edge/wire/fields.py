"""The fields that messages share: header, pose, and the placement of a grid."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.wire.cdr import CdrReader, CdrWriter, encoded_string, refuse
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_GRID_TILT,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
    QUATERNION_TOLERANCE,
)

SECOND_NS = 1_000_000_000
POSE = struct.Struct("<7d")
"""A geometry_msgs/Pose: position x, y, z and quaternion x, y, z, w."""

_Cell = TypeVar("_Cell", np.int8, np.uint8)

_HEADER = struct.Struct("<iII")
_HEADER_NAMES = ("{}.stamp.sec", "{}.stamp.nanosec", "length of {}.frame_id")
_SENT_HEADER_NAMES = tuple(name.format("header") for name in _HEADER_NAMES)
_INFO = struct.Struct("<iIfII")
_INFO_NAMES = (
    "info.map_load_time.sec",
    "info.map_load_time.nanosec",
    "info.resolution",
    "info.width",
    "info.height",
)


def read_header(reader: CdrReader, field: str = "header") -> tuple[str, int]:
    """Read a std_msgs/Header; return its frame and its stamp [ns]."""
    sec, nanosec, length = reader.words(_HEADER, _HEADER_NAMES, field)
    if nanosec >= SECOND_NS:
        _refuse_nanosec(reader, f"{field}.stamp", nanosec)
    return reader.text(length, f"{field}.frame_id"), sec * SECOND_NS + nanosec


def write_header(writer: CdrWriter, frame: str, stamp_ns: int) -> None:
    """Write a std_msgs/Header."""
    text = encoded_string(frame, writer.message, "header.frame_id")
    writer.words(_HEADER, _SENT_HEADER_NAMES, *divmod(stamp_ns, SECOND_NS), len(text))
    writer.octets(text)


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


def yaw_of_one(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad] of one quaternion, as ``yaw_of`` has it."""
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def planar_poses(xy: NDArray[np.float64], yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses, float64 (n, 7), at points (n, 2) [m] with yaws (n,) [rad]."""
    poses = np.zeros((len(xy), 7))
    poses[:, :2] = xy
    with np.errstate(invalid="ignore"):
        poses[:, 5], poses[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
    return poses


def read_pose(reader: CdrReader, field: str) -> Pose2D:
    """Read a geometry_msgs/Pose; return its place in the plane."""
    pose = reader.doubles(POSE, field)
    _check_pose(pose, reader.message, field)
    return _planar(pose)


def write_pose(writer: CdrWriter, pose: Pose2D, field: str) -> None:
    """Write a pose in the plane as a geometry_msgs/Pose with z = 0."""
    # math refuses to turn by infinity; NaN it lets through, to be refused as all others.
    half = pose.yaw / 2 if math.isfinite(pose.yaw) else math.nan
    floats = (pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))
    _check_pose(floats, writer.message, field)
    writer.doubles(POSE, *floats)


def read_grid_geometry(reader: CdrReader) -> GridGeometry:
    """Read a nav_msgs/MapMetaData; its time of loading is dropped."""
    _, nanosec, edge, cols, rows = reader.words(_INFO, _INFO_NAMES)
    if nanosec >= SECOND_NS:
        _refuse_nanosec(reader, "info.map_load_time", nanosec)
    resolution = _shortest_decimal(edge)
    _check_resolution(resolution, reader.message)
    origin = reader.doubles(POSE, "info.origin")
    _check_pose(origin, reader.message, "info.origin")
    if max(abs(origin[3]), abs(origin[4])) > MAX_GRID_TILT:
        refuse(
            reader.message,
            "info.origin.orientation",
            f"a turn about z (x and y within {MAX_GRID_TILT})",
            list(origin[3:]),
        )
    return GridGeometry(rows, cols, resolution, _planar(origin))


def write_grid_geometry(writer: CdrWriter, geometry: GridGeometry, stamp_ns: int) -> None:
    """Write a nav_msgs/MapMetaData, loaded at ``stamp_ns``."""
    _check_resolution(geometry.resolution, writer.message)
    writer.words(
        _INFO,
        _INFO_NAMES,
        *divmod(stamp_ns, SECOND_NS),
        geometry.resolution,
        geometry.cols,
        geometry.rows,
    )
    write_pose(writer, geometry.origin, "info.origin")


def read_cells(
    reader: CdrReader,
    geometry: GridGeometry | Window,
    dtype: type[_Cell],
    max_cells: int,
    field: str = "data",
) -> NDArray[_Cell]:
    """Read the last field, a byte for each of the cells of ``geometry``.

    Returns a read-only view, (rows, cols), of type ``dtype``.
    """
    rows, cols = geometry.rows, geometry.cols
    count = reader.length(field, 1)
    if not 0 < count <= max_cells:
        refuse(reader.message, f"length of {field}", f"1..{max_cells}", count)
    if count != rows * cols:
        expected = f"width x height = {cols} x {rows} = {rows * cols}"
        refuse(reader.message, f"length of {field}", expected, count)
    cells = reader.cells(rows, cols, dtype, field)
    reader.end()
    return cells


def write_cells(writer: CdrWriter, cells: NDArray[np.generic], field: str = "data") -> None:
    """Write cells of one byte each, (rows, cols), as the last field."""
    if not cells.size:
        refuse(writer.message, f"length of {field}", "at least 1", 0)
    writer.uint32(cells.size, f"length of {field}")
    writer.array(cells)


def _check_pose(pose: Sequence[float], message: str, field: str) -> None:
    """Check one pose: as ``check_poses``, which says what is wrong, without arrays."""
    x, y, z, qx, qy, qz, qw = pose
    far = MAX_COORDINATE_M
    norm = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    if not (
        -far <= x <= far
        and -far <= y <= far
        and -far <= z <= far
        and abs(norm - 1.0) <= QUATERNION_TOLERANCE
    ):
        check_poses(np.array([pose], np.float64), message, lambda _: field)


def _planar(pose: Sequence[float]) -> Pose2D:
    """Return the place in the plane of one pose."""
    x, y, _, *quaternion = pose
    return Pose2D(x, y, yaw_of_one(*quaternion))


def _refuse_nanosec(reader: CdrReader, field: str, nanosec: int) -> NoReturn:
    refuse(reader.message, f"{field}.nanosec", f"less than {SECOND_NS}", nanosec)


# A robot's maps have one resolution, and numpy takes a while to find its decimal.
@lru_cache(maxsize=16)
def _shortest_decimal(value: float) -> float:
    """Return the shortest decimal that is this float32: 0.05 m stays 0.05 m."""
    return float(str(np.float32(value)))


def _check_resolution(resolution: float, message: str) -> None:
    if not MIN_RESOLUTION_M <= resolution <= MAX_RESOLUTION_M:
        expected = f"{MIN_RESOLUTION_M}..{MAX_RESOLUTION_M:g} m"
        refuse(message, "info.resolution", expected, resolution)
