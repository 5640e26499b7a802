"""rosbags, another reader and writer of the same messages, which ours is held against."""

from __future__ import annotations

from fasaco_edge.errors import MissingExtra
from fasaco_edge.resources import folder
from fasaco_edge.wire.schemas import OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID

try:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
except ImportError as error:
    raise MissingExtra(
        f"bench codec compares with rosbags, which is not installed: {error}",
        hint="pip install rosbags",
    ) from error


class RosbagsCodec:
    """Encodes and decodes the messages of the contract by rosbags."""

    def __init__(self) -> None:
        """Learn the messages, those that ROS 2 does not have included."""
        self._store = get_typestore(Stores.ROS2_JAZZY)
        for schema in (OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID):
            definition = folder("protocol") / "msg" / f"{schema.rsplit('/', 1)[1]}.msg"
            self._store.register(get_types_from_msg(definition.read_text(), schema))

    def encode(self, message: object, schema: str) -> bytes:
        """Return a message as bytes: Zenoh takes no memoryview."""
        return bytes(self._store.serialize_cdr(message, schema))

    def decode(self, payload: bytes, schema: str) -> object:
        """Return the message in ``payload``."""
        return self._store.deserialize_cdr(payload, schema)
