"""Poses of the robot: messages of three types, or transforms (tf2_msgs/TFMessage).

From transforms, the robot's pose is the product of the newest transform of each link between map
and robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from fasaco_edge.errors import MalformedMessage, TransformLoop
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_TRANSFORM_TILT,
    MAX_TRANSFORMS,
    QUATERNION_TOLERANCE,
)
from fasaco_edge.wire.messages.cdr import (
    IN_METRES,
    IN_QUATERNIONS,
    POSE,
    CdrReader,
    CdrWriter,
    read_header,
    read_pose,
    refuse,
    write_header,
    write_pose,
    yaw_of,
)
from fasaco_edge.wire.schemas import (
    ODOMETRY,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE_STAMPED,
    TF_MESSAGE,
)

# Number of 64-bit floats after the pose in each type.
_AFTER_POSE = {
    POSE_STAMPED: {},
    POSE_WITH_COVARIANCE_STAMPED: {"pose.covariance": 36},
    ODOMETRY: {"pose.covariance": 36, "twist.twist": 6, "twist.covariance": 36},
}


def decode_pose(payload: bytes, schema: str) -> StampedPose:
    """Return the robot's pose in a message of type ``schema``, one of ``schemas.POSE_SCHEMAS``.

    Covariance and twist are skipped, not checked: publishers write NaN there for unknown.

    Raises:
        MalformedMessage: the bytes are not such a message, or ``schema`` is not a pose type.
    """
    if schema not in _AFTER_POSE:
        known = ", ".join(_AFTER_POSE)
        raise MalformedMessage(
            f"a pose must come as one of {known}, got {schema!r}",
            hint="publish one of these types, and name it in the encoding",
        )
    reader = CdrReader(payload, schema)
    frame, stamp_ns = read_header(reader)
    if schema == ODOMETRY:
        reader.string("child_frame_id")
    pose = read_pose(reader, "pose" if schema == POSE_STAMPED else "pose.pose")
    for field, floats in _AFTER_POSE[schema].items():
        reader.take(8, 8 * floats, field)
    reader.end()
    return StampedPose(pose, frame, stamp_ns)


def encode_pose_stamped(stamped: StampedPose) -> bytes:
    """Return ``stamped`` as a geometry_msgs/PoseStamped."""
    writer = CdrWriter(POSE_STAMPED)
    write_header(writer, stamped.frame, stamped.stamp_ns)
    write_pose(writer, stamped.pose, "pose")
    return writer.payload()


LEAST_TRANSFORM_BYTES = 80
"""Size of a TransformStamped with empty names: stamp 8, twice length 4, NUL 1, padding 3, floats
56."""


@dataclass(frozen=True, slots=True)
class Transform:
    """A received transform: the pose of a frame in its parent frame.

    A robot also sends the rotations of its wheels and cameras, so ``placement`` is checked only
    when needed, in ``planar``.

    Attributes:
        frame: name of the parent frame.
        child: name of the child frame.
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
            MalformedMessage: a number is not finite or too large, or the quaternion is invalid or
                tilts the plane.
        """
        which = f"of {self.child!r} in {self.frame!r}"
        x, y, z, *turn = self.placement
        # Negated comparisons, so that NaN is caught too.
        for axis, value in zip("xyz", (x, y, z), strict=True):
            if not abs(value) <= MAX_COORDINATE_M:
                expected = f"within {MAX_COORDINATE_M:g} m of 0"
                refuse(TF_MESSAGE, f"translation.{axis} {which}", expected, value, IN_METRES)
        norm = math.hypot(*turn)
        if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
            expected = f"1 within {QUATERNION_TOLERANCE}"
            refuse(TF_MESSAGE, f"norm of rotation {which}", expected, norm, IN_QUATERNIONS)
        if max(abs(turn[0]), abs(turn[1])) > MAX_TRANSFORM_TILT:
            expected = f"a turn about z (x and y within {MAX_TRANSFORM_TILT})"
            refuse(TF_MESSAGE, f"rotation {which}", expected, turn)
        return Pose2D(x, y, yaw_of(*turn))


def decode_transforms(payload: bytes) -> tuple[Transform, ...]:
    """Return the transforms in a tf2_msgs/TFMessage; there may be none.

    Raises:
        MalformedMessage: it is not such a message, or has over ``MAX_TRANSFORMS`` transforms.
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
    return Transform(frame, child, stamp_ns, reader.doubles(POSE, f"{field}.transform"))


@dataclass(frozen=True, slots=True)
class Link:
    """The newest transform between two frames.

    Attributes:
        transform: the transform.
        is_static: whether it is static.
        came_at: time of arrival of the first transform with the same stamp [s].
    """

    transform: Transform
    is_static: bool
    came_at: float


class TransformTree:
    """Stores the newest transform of each frame, and multiplies those between robot and map.

    The frames are usually map, odom and base_link: a localiser publishes the first link, odometry
    the second. The newest transform is the last to arrive. Poses are in the map's frame.

    Attributes:
        oldest: the moving link between map and robot that arrived longest ago; None if no link
            moves, or a link is missing.
    """

    def __init__(self, map_frame: str, robot_frame: str) -> None:
        self._map_frame = map_frame
        self._robot_frame = robot_frame
        self.oldest: Link | None = None
        # The newest link to each child frame.
        self._links: dict[str, Link] = {}
        self._last: StampedPose | None = None

    def follow(self, map_frame: str, robot_frame: str) -> None:
        """Change the two frames of the pose; stored transforms stay."""
        self._map_frame, self._robot_frame = map_frame, robot_frame

    def take(
        self, transforms: Iterable[Transform], *, is_static: bool, came_at: float = 0.0
    ) -> StampedPose | None:
        """Store transforms; return the robot's pose if it is known and has changed.

        The pose has the stamp of the moving link nearest to the robot, which is odometry.
        ``came_at``: the transforms' time of arrival [s].

        Raises:
            TransformLoop: the frames form a loop; their links are dropped.
            MalformedMessage: a link between map and robot is not in the plane, and is dropped; or
                there are over ``MAX_TRANSFORMS`` frames.
        """
        for transform in transforms:
            if transform.child not in self._links and len(self._links) >= MAX_TRANSFORMS:
                refuse(TF_MESSAGE, "number of frames", f"at most {MAX_TRANSFORMS}", "one more")
            self._links[transform.child] = self._link(transform, is_static, came_at)
        chain = self._chain()
        moving = [link for link in chain if not link.is_static]
        self.oldest = min(moving, key=lambda link: link.came_at, default=None)
        if not chain:
            return None
        pose = Pose2D(0.0, 0.0)
        for link in chain:
            pose = _placed(self._planar(link.transform), pose)
        nearest = (moving or chain)[0].transform
        stamped = StampedPose(pose, self._map_frame, nearest.stamp_ns)
        if stamped == self._last:
            return None
        self._last = stamped
        return stamped

    def _link(self, transform: Transform, is_static: bool, came_at: float) -> Link:
        before = self._links.get(transform.child)
        if before is not None and transform.stamp_ns == before.transform.stamp_ns != 0:
            came_at = before.came_at
        return Link(transform, is_static, came_at)

    def _planar(self, transform: Transform) -> Pose2D:
        try:
            return transform.planar()
        except MalformedMessage:
            del self._links[transform.child]  # otherwise each later message would be refused
            raise

    def _chain(self) -> list[Link]:
        """Return the links from the robot's frame up to the map's; none if one is missing."""
        chain: list[Link] = []
        frame = self._robot_frame
        while frame != self._map_frame:
            link = self._links.get(frame)
            if link is None:
                return []
            chain.append(link)
            if len(chain) > len(self._links):
                raise self._loop(frame)
            frame = link.transform.frame
        return chain

    def _loop(self, frame: str) -> TransformLoop:
        """Drop the links of the loop that ``frame`` is in; return the error that names them."""
        names = []
        while (link := self._links.pop(frame, None)) is not None:
            names.append(frame)
            frame = link.transform.frame
        looped = ", ".join(names[:8])
        return TransformLoop(f"tf: the transforms of these frames form a loop: {looped}")


def _placed(frame: Pose2D, pose: Pose2D) -> Pose2D:
    """Return ``pose``, given in a frame, in the parent frame; ``frame``: the frame's pose there."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return Pose2D(
        frame.x + cos * pose.x - sin * pose.y,
        frame.y + sin * pose.x + cos * pose.y,
        math.remainder(frame.yaw + pose.yaw, math.tau),
    )


DEFAULT_FRAMES = ("map", "base_link")


class PoseDecoder:
    """Decodes successive poses: messages of three types, or transforms between two ``frames``.

    Attributes:
        schema: message type of samples that name none; may be changed.
    """

    def __init__(self, schema: str, frames: tuple[str, str] | None = DEFAULT_FRAMES) -> None:
        self.schema = schema
        self._transforms = TransformTree(*frames) if frames else None

    def follow(self, frames: tuple[str, str]) -> None:
        """Take poses from the transforms between these frames from now on."""
        if self._transforms is None:
            self._transforms = TransformTree(*frames)
        self._transforms.follow(*frames)

    @property
    def oldest_link(self) -> Link | None:
        """As ``TransformTree.oldest``; None if poses are not from transforms."""
        return self._transforms.oldest if self._transforms else None

    def decode(
        self, payload: bytes, schema: str, *, is_static: bool = False, came_at: float = 0.0
    ) -> StampedPose | None:
        """Return the pose; None for transforms without a new pose.

        ``schema``: "" if the sample names none; ``came_at``: time of arrival [s].

        Raises:
            MalformedMessage: the payload is not a valid message of that type.
            TransformLoop: the frames form a loop.
        """
        schema = schema or self.schema
        if self._transforms is None or schema != TF_MESSAGE:
            return decode_pose(payload, schema)
        transforms = decode_transforms(payload)
        return self._transforms.take(transforms, is_static=is_static, came_at=came_at)
