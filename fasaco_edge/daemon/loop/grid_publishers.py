"""Publishers of grids that change as the robot drives: coverage, swept floor, living trail."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.daemon.loop.last_samples import ShownTrail
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire.messages.maps import coverage_values

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.outbox import Outbox
    from fasaco_edge.mission.core.mission import Mission

# Least period of the coverage [s].
COVERAGE_PERIOD_S = 0.5
# Least period of the swept floor [s], and the most squares of it: a large floor gets larger
# squares.
FLOOR_PERIOD_S = 2.0
MOST_SQUARES = 1_000_000
# Least period of the trail [s]; a large one, which takes the loop some milliseconds per 100,000
# cells, is published less often.
PERIOD_S = 0.5
CELLS_PER_S = 200_000


class CoveragePublisher:
    """Publishes the coverage grid on change, at most twice a second."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def forget(self) -> None:
        """Publish the next grid even if it has not changed."""
        self._key = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the coverage if that is due."""
        # An order may reset the coverage, and add keep-out cells.
        key = (mission.covered.version, mission.map_revision, mission.order_state)
        if key == self._key or now - self._published_at < COVERAGE_PERIOD_S:
            return
        lattice, grid = mission.lattice, mission.grid
        if lattice is None or grid is None:
            return
        self._published_at, self._key = now, key
        geometry = mission.rotation.cells(lattice.window, lattice.cell_m)
        values = coverage_values(lattice.states, mission.covered.visits(lattice.window))
        self._outbox.coverage(OccupancyGrid(geometry, values, grid.frame, grid.stamp_ns))


class FloorPublisher:
    """Publishes the swept floor on change if it has subscribers, every two seconds."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the swept floor if that is due."""
        if not self._outbox.shows_floor:
            self._key = ()  # the next listener has not received it
            return
        floor, grid = mission.floor, mission.grid
        key = (floor, floor.changes)
        is_early = now - self._published_at < FLOOR_PERIOD_S
        if key == self._key or is_early or grid is None:
            return
        self._published_at, self._key = now, key
        shown = floor.snapshot().shown(MOST_SQUARES, grid.frame, grid.stamp_ns)
        if shown is not None:
            self._outbox.floor(replace(shown, geometry=mission.rotation.geometry(shown.geometry)))


class TrailPublisher:
    """Publishes the trail on change, at most twice a second.

    It is published while it has subscribers, and kept for queries.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._due = float("-inf")
        # The trail kept last, and the trail published last.
        self._kept: tuple[object, ...] = ()
        self._published: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish or keep the trail if due."""
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
        of_path = mission.route.revision, steps
        shown = ShownTrail(
            held, lattice.cell_m, grid.frame, *of_path, time.time_ns(), mission.rotation.deg
        )
        self._kept = key
        self._outbox.keep_trail(shown)
        if is_heard:
            self._published = key
            self._outbox.trail(shown)
