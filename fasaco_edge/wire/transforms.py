"""The robot's pose out of transforms: the newest of each link between map and robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from fasaco_edge.errors import MalformedMessage, TransformLoop
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire.limits import MAX_TRANSFORMS
from fasaco_edge.wire.refusal import refuse
from fasaco_edge.wire.schemas import TF_MESSAGE
from fasaco_edge.wire.tf import Transform


@dataclass(frozen=True, slots=True)
class _Link:
    transform: Transform
    is_static: bool


class TransformTree:
    """Remembers of each frame where it lies, and follows the robot's up to the map's.

    Usually map, odom, base_link: a localiser publishes the first link, odometry the second.
    Newest is what came last.

    Args:
        map_frame: the frame poses are wanted in.
        robot_frame: the robot's own.
    """

    def __init__(self, map_frame: str, robot_frame: str) -> None:
        self._map_frame = map_frame
        self._robot_frame = robot_frame
        self._links: dict[str, _Link] = {}
        self._told: StampedPose | None = None

    def follow(self, map_frame: str, robot_frame: str) -> None:
        """Want poses between other frames from now on; what is known of all of them stays."""
        self._map_frame, self._robot_frame = map_frame, robot_frame

    def take(self, transforms: Iterable[Transform], *, is_static: bool) -> StampedPose | None:
        """Take transforms in; return the robot's pose if it is known and another than before.

        Its stamp is that of the link nearest to the robot that moves: of odometry.

        Args:
            transforms: as they came.
            is_static: whether they were said to hold for ever.

        Raises:
            TransformLoop: the frames hang on each other; their links are forgotten.
            MalformedMessage: a link between map and robot has no place in the plane, and is
                forgotten; or there are over ``MAX_TRANSFORMS`` frames.
        """
        for transform in transforms:
            if transform.child not in self._links and len(self._links) >= MAX_TRANSFORMS:
                refuse(TF_MESSAGE, "number of frames", f"at most {MAX_TRANSFORMS}", "one more")
            self._links[transform.child] = _Link(transform, is_static)
        chain = self._chain()
        if not chain:
            return None
        pose = Pose2D(0.0, 0.0)
        for link in chain:
            pose = _placed(self._planar(link.transform), pose)
        moving = next((link for link in chain if not link.is_static), chain[0])
        stamped = StampedPose(pose, self._map_frame, moving.transform.stamp_ns)
        if stamped == self._told:
            return None
        self._told = stamped
        return stamped

    def _planar(self, transform: Transform) -> Pose2D:
        try:
            return transform.planar()
        except MalformedMessage:
            del self._links[transform.child]  # else each message from now on would be refused
            raise

    def _chain(self) -> list[_Link]:
        """Return the links from the robot's frame up to the map's; none where one is missing."""
        chain: list[_Link] = []
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
        """Forget the links of the loop that ``frame`` is in; return the error that names them."""
        names = []
        while (link := self._links.pop(frame, None)) is not None:
            names.append(frame)
            frame = link.transform.frame
        return TransformLoop(f"tf: these frames hang on each other: {', '.join(names[:8])}")


def _placed(frame: Pose2D, pose: Pose2D) -> Pose2D:
    """Return ``pose``, given in a frame that lies at ``frame``, where that one is given."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return Pose2D(
        frame.x + cos * pose.x - sin * pose.y,
        frame.y + sin * pose.x + cos * pose.y,
        math.remainder(frame.yaw + pose.yaw, math.tau),
    )
