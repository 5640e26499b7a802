"""Publisher of the living trail: its field, with figures, and where it points to."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.living_trail import (
    TrailSnapshot,
    branching,
    directions,
    strongest_into,
)
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import TrailAttachment
from fasaco_edge.wire.messages.maps import direction_values, encode_occupancy_grid
from fasaco_edge.wire.messages.pheromone import encode_pheromone

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.outbox import Outbox
    from fasaco_edge.mission.core.mission import Mission

# The field is shown no more often than this [s], and a large one, which takes the loop some
# milliseconds per 100,000 cells, less often.
PERIOD_S = 0.5
CELLS_PER_S = 200_000


@dataclass(frozen=True, slots=True, eq=False)
class ShownTrail:
    """The living trail at a moment; becomes messages on any thread.

    Attributes:
        held: the trail.
        cell_m: edge of a cell [m].
        frame: of the map.
        revision: of the path in force.
        steps: of it, still to be driven.
        stamp_ns: of the moment [ns].
    """

    held: TrailSnapshot
    cell_m: float
    frame: str
    revision: int
    steps: int
    stamp_ns: int

    def field(self) -> tuple[bytes, bytes]:
        """Return the field as payload and attachment."""
        tau = self.held.tau
        field = strongest_into(tau)
        about = TrailAttachment(
            revision=self.revision,
            cells=int(np.count_nonzero(field)),
            branching=round(branching(tau), 4),
        )
        seen = ColonySnapshot(self.held.window, self.cell_m, field, 0, 0, 0, self.steps)
        return encode_pheromone(seen, self.frame, self.stamp_ns), encode_json(about)

    def directions(self) -> bytes:
        """Return where it points to as a payload."""
        geometry = GridGeometry.of_cells(self.held.window, self.cell_m)
        values = direction_values(*directions(self.held.tau))
        return encode_occupancy_grid(OccupancyGrid(geometry, values, self.frame, self.stamp_ns))


class TrailPublisher:
    """Shows the trail when it has changed, twice a second at most.

    It is published while someone listens, and kept for who asks.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._due = float("-inf")
        # What was kept last, and what was published last.
        self._kept: tuple[object, ...] = ()
        self._published: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Show the trail if that is due."""
        is_heard = self._outbox.shows_pheromone
        if not is_heard:
            self._published = ()  # the next listener has not received it
        trail, lattice, grid = mission.trail, mission.lattice, mission.grid
        key = (trail, trail.changes)
        is_known = key == self._kept and (not is_heard or key == self._published)
        if is_known or now < self._due or grid is None or lattice is None:
            return
        held = trail.snapshot()
        cells = held.window.rows * held.window.cols
        if not cells:
            return
        self._due = now + max(PERIOD_S, cells / CELLS_PER_S)
        steps = max(len(mission.route.path.ahead) - 1, 0)
        shown = ShownTrail(
            held, lattice.cell_m, grid.frame, mission.route.revision, steps, time.time_ns()
        )
        self._kept = key
        self._outbox.keep_trail(shown)
        if is_heard:
            self._published = key
            self._outbox.trail(shown)
