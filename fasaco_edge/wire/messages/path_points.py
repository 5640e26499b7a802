"""Incremental reader of a nav_msgs/Path, point by point.

For a small program that must not pause: reading a path of half a million poses would take seconds,
and the next path replaces it long before its end is driven.
"""

from __future__ import annotations

from collections.abc import Iterator

from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.wire.limits import MAX_PATH_POSES
from fasaco_edge.wire.messages.cdr import POSE, CdrReader, check_pose, read_header, refuse, yaw_of
from fasaco_edge.wire.schemas import PATH

# Number of poses read at a time.
CHUNK = 500

LEAST_POSE_BYTES = 72
"""Size of a PoseStamped with an empty frame: stamp 8, length 4, NUL 1, padding 3, floats 56."""


class PathPoints:
    """The points of a path, in order; iteration yields its poses, and reads them on demand.

    Attributes:
        frame: name of the frame of all poses.
        left: number of points not read yet.

    Raises:
        MalformedMessage: the payload does not begin like a path, or is too short for its poses.
    """

    def __init__(self, payload: bytes) -> None:
        self._reader = CdrReader(payload, PATH)
        self.frame, _ = read_header(self._reader)
        self.left = self._count = read_pose_count(self._reader)
        if not self.left:
            self._reader.end()

    def take(self, most: int) -> list[Point]:
        """Return the next points [m], at most ``most``.

        Raises:
            MalformedMessage: a pose is invalid or in another frame, or data follow the last pose.
        """
        return [(pose[0], pose[1]) for pose in self._take(most)]

    def __iter__(self) -> Iterator[Pose2D]:
        """Yield the next poses; raises as ``take`` does."""
        while self.left:
            for pose in self._take(CHUNK):
                yield Pose2D(pose[0], pose[1], yaw_of(*pose[3:7]))

    def _take(self, most: int) -> list[tuple[float, ...]]:
        poses = []
        for index in range(self._count - self.left, self._count)[:most]:
            pose = read_path_pose(self._reader, self.frame, index)
            check_pose(pose, PATH, f"poses[{index}].pose")
            poses.append(pose)
            self.left -= 1
        if not self.left and poses:
            self._reader.end()
        return poses


def read_pose_count(reader: CdrReader) -> int:
    """Read the number of poses of a path."""
    count = reader.length("poses", LEAST_POSE_BYTES)
    if count > MAX_PATH_POSES:
        refuse(PATH, "length of poses", f"at most {MAX_PATH_POSES}", count)
    return count


def read_path_pose(reader: CdrReader, frame: str, index: int) -> tuple[float, ...]:
    """Read a pose of a path in ``frame``: position x, y, z and quaternion x, y, z, w, unchecked."""
    field = f"poses[{index}].header"
    named, _ = read_header(reader, field)
    if named not in ("", frame):
        refuse(PATH, f"{field}.frame_id", f"{frame!r}, as the path's, or ''", repr(named))
    return reader.doubles(POSE, f"poses[{index}].pose")
