"""Keys of one robot; their table is ``wire.topics``."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.wire.topic_types import Topic
from fasaco_edge.wire.topics import CLAIM

VERSION = "@v1"

_CHUNK = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one robot, under ``<base>/@v1/<robot>``.

    Attributes:
        robot: name of the robot, one chunk.
        base: common prefix of all robots' keys, one chunk or several joined by ``/``.

    Raises:
        BadConfiguration: a chunk is empty or holds more than letters, digits, ``_``, ``-``.
    """

    robot: str = "robot"
    base: str = "fasaco"

    def __post_init__(self) -> None:
        _check_chunk("robot", self.robot)
        for chunk in self.base.split("/"):
            _check_chunk("base", chunk)

    @property
    def prefix(self) -> str:
        """Prefix of all keys of this robot."""
        return f"{self.base}/{VERSION}/{self.robot}"

    def of(self, topic: Topic) -> str:
        """Return the key of a topic; a key expression if its row has a ``*``."""
        return f"{self.prefix}/{topic.suffix}"

    def of_all(self, topic: Topic) -> str:
        """Return the key expression of a topic of all robots under this base."""
        return f"{self.base}/{VERSION}/*/{topic.suffix}"

    def robot_of(self, key: str) -> str:
        """Return the name of the robot of a key; "" for a key expression."""
        robot = key.removeprefix(f"{self.base}/{VERSION}/").partition("/")[0]
        return robot if is_chunk(robot) else ""

    def claim(self, own: str, stand: str, topic: Topic = CLAIM) -> str:
        """Return the token of the daemon with the Zenoh id ``own``; ``stand``: "plans" or "waits".

        ``topic`` may be another topic whose key has the same ending.
        """
        return self.of(topic).replace("*/*", f"{own}/{stand}")

    def rpc(self, name: str) -> str:
        """Return the key of the queryable ``name``.

        Raises:
            BadConfiguration: the name is not one chunk.
        """
        _check_chunk("rpc", name)
        return f"{self.prefix}/@rpc/{name}"


def is_chunk(text: str) -> bool:
    """Return whether a text can be the name of a robot."""
    return bool(_CHUNK.fullmatch(text))


def _check_chunk(what: str, chunk: str) -> None:
    if not is_chunk(chunk):
        text = f"must be chunks of letters, digits, '_' and '-', got {chunk!r}"
        raise BadConfiguration(text, key=what)
