"""The coverage grid: published when it has changed, and no more often than anybody could look."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.daemon.outbox import Outbox
from fasaco_edge.wire.coverage import coverage_grid

if TYPE_CHECKING:
    from fasaco_edge.mission.mission import Mission

PERIOD_S = 0.5


class CoverageNews:
    """Knows what was published last."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def forget(self) -> None:
        """Take what comes next for news, whatever it is."""
        self._key = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the coverage if that is due."""
        # An order may forget what was covered, and keep the robot out of cells.
        key = (mission.ledger.total, mission.map_revision, mission.assignment)
        if key == self._key or now - self._published_at < PERIOD_S:
            return
        lattice, grid = mission.lattice, mission.grid
        if lattice is None or grid is None:
            return
        self._published_at, self._key = now, key
        visits = mission.ledger.visits(lattice.window)
        self._outbox.coverage(
            coverage_grid(
                lattice.window, lattice.cell_m, lattice.states, visits, grid.frame, grid.stamp_ns
            )
        )
