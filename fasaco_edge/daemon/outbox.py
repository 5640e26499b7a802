"""What goes out: path, coverage, pheromone, status; and answers to who asks later."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.session import Bus, Reply
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.errors import NotYet
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire import schemas
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.maps import encode_occupancy_grid
from fasaco_edge.wire.paths import encode_path
from fasaco_edge.wire.pheromone import encode_pheromone
from fasaco_edge.wire.status import encode_error, encode_json

if TYPE_CHECKING:
    from fasaco_edge.planners.observation import ColonySnapshot


class Outbox:
    """The publishers and queryables of a daemon.

    Queries are answered from the last payload, on Zenoh's thread: a late joiner
    never waits for the loop.
    """

    def __init__(self, bus: Bus, keys: Keys, ros: RosBridge | None = None) -> None:
        self._ros = ros
        self._lock = threading.Lock()
        self._replies: dict[str, Reply] = {}
        self._path = bus.publisher(keys.path, schemas.PATH, latched=True)
        self._coverage = bus.publisher(keys.coverage, schemas.OCCUPANCY_GRID, latched=True)
        self._pheromone = bus.publisher(keys.pheromone, schemas.PHEROMONE_GRID)
        self._status = bus.publisher(keys.status, latched=True)
        self._command = bus.publisher(keys.command)
        for name, key in (
            ("path", keys.path),
            ("status", keys.status),
            ("coverage", keys.coverage),
        ):
            # The same answer on the topic itself, as a storage would give it.
            for served in (keys.rpc(name), key):
                bus.serve(served, partial(self._answer, name))

    def path(
        self,
        xy: NDArray[np.float64],
        frame: str,
        stamp_ns: int,
        about: dict[str, Any],
    ) -> None:
        """Publish a path through ``xy`` [m], float64 (n, 2), facing along the way."""
        payload = encode_path(xy, headings(xy), frame, stamp_ns)
        attachment = encode_json(about)
        self._remember("path", Reply(payload, schemas.PATH, attachment))
        self._path.put(payload, attachment)
        if self._ros is not None:
            self._ros.path.put(payload)

    def status(self, document: dict[str, Any]) -> None:
        """Publish the status."""
        payload = encode_json(document)
        self._remember("status", Reply(payload))
        self._status.put(payload)

    def command(self, document: dict[str, Any]) -> None:
        """Publish a command that the mission has taken."""
        self._command.put(encode_json(document))

    def coverage(self, grid: OccupancyGrid) -> None:
        """Publish the coverage, a grid on the lattice."""
        payload = encode_occupancy_grid(grid)
        self._remember("coverage", Reply(payload, schemas.OCCUPANCY_GRID))
        self._coverage.put(payload)
        if self._ros is not None:
            self._ros.coverage.put(payload)

    def is_watched(self) -> bool:
        """Tell whether anyone listens to the pheromone field; safe from any thread."""
        return self._pheromone.has_listeners()

    def pheromone(self, snapshot: ColonySnapshot, frame: str) -> None:
        """Publish the pheromone field, if anyone listens."""
        if self.is_watched():
            self._pheromone.put(encode_pheromone(snapshot, frame, time.time_ns()))

    def _remember(self, name: str, reply: Reply) -> None:
        with self._lock:
            self._replies[name] = reply

    def _answer(self, name: str, _: dict[str, str]) -> Reply:
        with self._lock:
            reply = self._replies.get(name)
        if reply is not None:
            return reply
        return Reply(encode_error(NotYet(f"there is no {name} yet")), is_error=True)


def headings(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading [rad], float64 (n,), at each point of a path: towards the next one."""
    if len(xy) < 2:
        return np.zeros(len(xy))
    ahead = np.diff(xy, axis=0)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.append(yaw, yaw[-1])
