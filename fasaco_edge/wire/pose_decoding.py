"""Poses out of whatever tells them: messages of three types, or transforms."""

from __future__ import annotations

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.wire.poses import decode_pose
from fasaco_edge.wire.schemas import TF_MESSAGE
from fasaco_edge.wire.transforms import TransformTree, decode_transforms

DEFAULT_FRAMES = ("map", "base_link")


class PoseDecoder:
    """Decodes one payload after the other.

    Args:
        schema: type of those that come without one.
        frames: the map's and the robot's, for transforms; None where none are taken.

    Attributes:
        schema: as above; may be changed.
    """

    def __init__(self, schema: str, frames: tuple[str, str] | None = DEFAULT_FRAMES) -> None:
        self.schema = schema
        self._transforms = TransformTree(*frames) if frames else None

    def follow(self, frames: tuple[str, str]) -> None:
        """Take poses out of the transforms between these frames from now on."""
        if self._transforms is None:
            self._transforms = TransformTree(*frames)
        self._transforms.follow(*frames)

    def decode(self, payload: bytes, schema: str, *, is_static: bool = False) -> StampedPose | None:
        """Return the pose; None for transforms that tell no new one.

        Raises:
            MalformedMessage: it is none of these.
            TransformLoop: the frames hang on each other.
        """
        schema = schema or self.schema
        if self._transforms is None or schema != TF_MESSAGE:
            return decode_pose(payload, schema)
        return self._transforms.take(decode_transforms(payload), is_static=is_static)
