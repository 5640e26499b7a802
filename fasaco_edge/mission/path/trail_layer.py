"""Trail layer: the living trail of a mission, updated by ants, maps, paths and driving."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.events import PathUpdate, PlanRequest
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.route import NO_CELLS, Route
from fasaco_edge.planners.living_trail import LivingTrail, TrailSnapshot
from fasaco_edge.planners.path import CoveragePath


class TrailLayer:
    """Owns the living trail: each plan starts from it, and changes it.

    Attributes:
        trail: the trail; read-only.
    """

    def __init__(self, config: MissionConfig, map_state: MapState, route: Route) -> None:
        self._config = config
        self._map, self._route = map_state, route
        self.trail = LivingTrail(config.trail)
        self._lattice: CoverageLattice | None = None
        # The robot's last path, and its index on it.
        self._path, self._index = NO_CELLS, 0

    def snapshot(self) -> TrailSnapshot:
        """Return the trail on the newest map."""
        self._follow_map()
        return self.trail.snapshot()

    def with_trail(self, request: PlanRequest) -> PlanRequest:
        """Return a request with the trail from which its ants start."""
        return replace(request, problem=replace(request.problem, trail=self.snapshot()))

    def receive_plan(self, plan: CoveragePath) -> None:
        """Take over the trail that the ants of a plan have left, even if the plan is not driven."""
        self._follow_map()
        if plan.trail is not None:
            self.trail.take(plan.trail, plan.work.ants)

    def restore(self, before: TrailSnapshot) -> None:
        """Continue with the trail from before a restart."""
        self.trail, self._lattice = LivingTrail(self._config.trail, before), None

    def reset(self) -> None:
        """Clear the trail: it belongs to another place."""
        self.trail, self._lattice = LivingTrail(self._config.trail), None

    def move(self, before: TrailSnapshot, motion: Motion) -> None:
        """Move the trail with the map; ``before``: the trail before it moved."""
        self._follow_map()
        turn = math.remainder(motion.end.yaw - motion.start.yaw, math.tau)
        turns = round(turn / (0.5 * math.pi))
        self.trail.move(
            before, lambda x, y: motion.back(1.0, x, y), turns, self._config.footprint.cell_m
        )

    def fade_driven(self) -> None:
        """Fade the trail along the driven part of the path."""
        self._follow_map()
        path = self._route.path
        begun = self._index if path.cells is self._path else 0
        if path.index > begun:
            self.trail.fade(path.cells[begun : path.index + 1])
        self._path, self._index = path.cells, path.index

    def finish(self, update: PathUpdate | None) -> None:
        """Take in the result of a step: a planned path strengthens the trail."""
        self._follow_map()
        if update is not None and update.plan is not None:
            cells, cost = update.cells, self._config.cost
            self.trail.strengthen(cells, cost.quality(_distinct(cells), cost.of_walk_us(cells)))

    def _follow_map(self) -> None:
        lattice, before = self._map.ground.lattice, self._lattice
        if lattice is None or lattice is before:
            return
        change = self._map.ground.change
        is_next = change is not None and change.before is before and change.after is lattice
        changed = change.cells if change is not None and is_next and before is not None else None
        self.trail.follow(lattice.window, lattice.steps, changed)
        self._lattice = lattice


def _distinct(cells: NDArray[np.int32]) -> int:
    # Column by column: numpy takes several times as long for rows of two.
    rows, cols = np.ascontiguousarray(cells.T)
    rows, cols = rows - rows.min(), cols - cols.min()
    width = int(cols.max()) + 1
    seen = np.zeros((int(rows.max()) + 1) * width, np.bool_)
    seen[rows.astype(np.intp) * width + cols] = True
    return int(np.count_nonzero(seen))
