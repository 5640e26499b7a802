"""The last samples published on some topics, kept for queries."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import partial

import numpy as np

from fasaco_edge.bus.queries import Reply, Request, Shared
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.loop.answers import Said, answering, check
from fasaco_edge.errors import NotYet
from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.planners.living_trail import (
    TrailSnapshot,
    branching,
    directions,
    strongest_into,
)
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire import schemas, topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import TrailAttachment
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import direction_values, encode_occupancy_grid
from fasaco_edge.wire.messages.pheromone import encode_pheromone

# Parameter of the query for a path, and what is kept for it.
BEFORE_STOP = "before_stop"


class LastSamples:
    """Keeps the last sample of some topics, and replies with it.

    A query on the topic itself gets the same reply, as from a storage.
    """

    def __init__(self, bus: Bus, keys: Keys) -> None:
        self._lock = threading.Lock()
        self._last: dict[str, Said] = {}
        self._living: ShownTrail | None = None
        for topic in (topics.PATH, topics.STATUS, topics.COVERAGE, topics.ROOMS):
            answer = answering(partial(self._answer, topic.name))
            for key in (keys.rpc(topic.name), keys.of(topic)):
                bus.serve(key, answer)
        for key in (keys.rpc("pheromone"), keys.of(topics.PHEROMONE)):
            bus.serve(key, answering(self._trail))

    def keep(self, topic: str, reply: Said) -> None:
        """Keep a sample of ``topic``."""
        with self._lock:
            self._last[topic] = reply

    def keep_path(self, path: Shared, *, stops: bool) -> None:
        """Keep a path; the one before it, too, if it only ``stops`` the robot."""
        with self._lock:
            self._last["path"] = path
            if not stops:
                self._last[BEFORE_STOP] = path

    def keep_living(self, shown: ShownTrail) -> None:
        """Keep the living trail."""
        with self._lock:
            self._living = shown

    def _answer(self, topic: str, request: Request) -> Said:
        check(request, *((BEFORE_STOP,) if topic == topics.PATH.name else ()))
        with self._lock:
            reply = self._last.get(BEFORE_STOP if BEFORE_STOP in request.parameters else topic)
        if reply is None:
            what = "are no rooms" if topic == topics.ROOMS.name else f"is no {topic}"
            raise NotYet(f"there {what} yet")
        return reply

    def _trail(self, request: Request) -> Said:
        check(request)
        with self._lock:
            living = self._living
        if living is None:
            raise NotYet("there is no pheromone yet: there is no map with cells")
        payload, attachment = living.field()
        return Reply(payload, schemas.PHEROMONE_GRID, attachment)


@dataclass(frozen=True, slots=True, eq=False)
class ShownTrail:
    """The living trail at a moment; encoded on any thread.

    Attributes:
        held: the trail.
        ants: number of ants that have walked on it so far.
        cell_m: edge of a cell [m].
        frame: of the map.
        revision: of the path in force.
        steps: steps of the path still to drive.
        stamp_ns: of the moment [ns].
        lattice_deg: the angle of the cells to the map frame [deg].
    """

    held: TrailSnapshot
    ants: int
    cell_m: float
    frame: str
    revision: int
    steps: int
    stamp_ns: int
    lattice_deg: float = 0.0

    def field(self) -> tuple[bytes, bytes]:
        """Return the field as payload and attachment."""
        tau = self.held.tau
        field = strongest_into(tau)
        about = TrailAttachment(
            revision=self.revision,
            cells=int(np.count_nonzero(field)),
            branching=round(branching(tau), 4),
        )
        seen = ColonySnapshot(self.held.window, self.cell_m, field, 0, 0, self.ants, self.steps)
        payload = encode_pheromone(seen, self.frame, self.stamp_ns, self.lattice_deg)
        return payload, encode_json(about)

    def directions(self) -> bytes:
        """Return its directions as a payload."""
        plain = GridGeometry.of_cells(self.held.window, self.cell_m)
        geometry = rotated_geometry(plain, self.lattice_deg)
        values = direction_values(*directions(self.held.tau))
        return encode_occupancy_grid(OccupancyGrid(geometry, values, self.frame, self.stamp_ns))
