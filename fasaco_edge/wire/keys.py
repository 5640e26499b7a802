"""Keys of the native contract; ``protocol/keys.yaml`` is the same table as data."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fasaco_edge.errors import BadConfiguration

VERSION = "@v1"

RPC_NAMES = ("path", "status", "coverage", "pheromone", "config", "version", "mission", "replan")
"""What can be asked, each as ``@rpc/<name>``."""

_CHUNK = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one robot, under ``<base>/@v1/<robot>``.

    Attributes:
        robot: name of the robot, one chunk.
        base: what all robots' keys begin with, one chunk or several joined by ``/``.

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
        """What all keys of this robot begin with."""
        return f"{self.base}/{VERSION}/{self.robot}"

    @property
    def map(self) -> str:
        """In: the map."""
        return f"{self.prefix}/map"

    @property
    def map_update(self) -> str:
        """In: new values for a window of the map."""
        return f"{self.prefix}/map_update"

    @property
    def pose(self) -> str:
        """In: the robot's pose."""
        return f"{self.prefix}/pose"

    @property
    def path(self) -> str:
        """Out: the walk still to be driven."""
        return f"{self.prefix}/path"

    @property
    def coverage(self) -> str:
        """Out: what is covered."""
        return f"{self.prefix}/coverage"

    @property
    def pheromone(self) -> str:
        """Out: the pheromone field."""
        return f"{self.prefix}/pheromone"

    @property
    def status(self) -> str:
        """Out: what the planner is doing."""
        return f"{self.prefix}/status"

    @property
    def command(self) -> str:
        """Out: each command the mission has taken."""
        return f"{self.prefix}/command"

    @property
    def turns(self) -> str:
        """Out: what each turn of the loop took in and decided."""
        return f"{self.prefix}/turns"

    @property
    def alive(self) -> str:
        """Liveliness token of the planner."""
        return f"{self.prefix}/alive"

    @property
    def claims(self) -> str:
        """What matches the claims of all daemons of this name."""
        return self.claim("*", "*")

    def claim(self, own: str, stand: str) -> str:
        """Liveliness token of the daemon with the Zenoh id ``own``, which "plans" or "waits"."""
        return f"{self.prefix}/claim/{own}/{stand}"

    @property
    def recorder(self) -> str:
        """Out, by the recorder: what it is doing."""
        return f"{self.prefix}/recorder"

    @property
    def recorder_alive(self) -> str:
        """Liveliness token of the recorder."""
        return f"{self.prefix}/recorder/alive"

    def rpc(self, name: str) -> str:
        """Return the key of the queryable ``name``.

        Raises:
            BadConfiguration: the name is not one chunk.
        """
        _check_chunk("rpc", name)
        return f"{self.prefix}/@rpc/{name}"


def _check_chunk(what: str, chunk: str) -> None:
    if not _CHUNK.fullmatch(chunk):
        raise BadConfiguration(
            f"{what} must be chunks of letters, digits, '_' and '-', got {chunk!r}"
        )
