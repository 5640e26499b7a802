"""The daemon with faults built in: ``python -m tests.daemon.breaking run ...`` as ``fasaco-edge``.

What breaks is chosen by the width of the map; after the word ``unsent`` the first stops do.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np

from fasaco_edge.daemon.loop.outbox import Outbox
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.planners import registry
from fasaco_edge.planners.living_trail import TrailSnapshot

# Width of the map that makes planner, pheromone or mission fail [m].
PLANNER_M, PHEROMONE_M, MISSION_M = 4.6, 5.2, 5.8
PIXEL_M = 0.05
# Argument after which stops of the robot cannot be sent.
UNSENT = "unsent"
# Number of stops that cannot be sent.
MOST_UNSENT = 3


class BreakingPlanner:
    """Breaks on lattices over one map, and leaves an impossible trail over another."""

    def __init__(self, planner: Any) -> None:
        self._planner = planner

    def plan(self, problem: Any, stop: Any, observe: Any) -> Any:
        cols = problem.lattice.window.cols
        if cols == cells(PLANNER_M):
            raise IndexError("index 7 is out of bounds")

        path = self._planner.plan(problem, stop, observe)
        if cols != cells(PHEROMONE_M):
            return path
        endless = np.full((*problem.lattice.states.shape, 4), np.inf, np.float32)
        return replace(path, trail=TrailSnapshot(problem.lattice.window, endless))


def cells(width_m: float) -> int:
    """Return how many cells of 0.3 m a map that is not a multiple of them is wide."""
    return int(np.ceil(width_m / 0.3))


def break_stops() -> None:
    put_path, unsent = Outbox._put_path, []

    def breaking_put(self: Any, path: Any) -> None:
        if path.stops and len(unsent) < MOST_UNSENT:
            unsent.append(path)
            raise MemoryError
        put_path(self, path)

    Outbox._put_path = breaking_put  # type: ignore[method-assign]


def main() -> None:
    if UNSENT in sys.argv:
        sys.argv.remove(UNSENT)
        break_stops()
    planner_of, take_map = registry.planner_of, MapState._apply_map

    def breaking_map(self: Any, grid: Any, within: Any = None) -> None:
        take_map(self, grid, within)
        if grid.geometry.cols == round(MISSION_M / PIXEL_M):
            raise ZeroDivisionError("division by zero")

    registry.planner_of = lambda *args: BreakingPlanner(planner_of(*args))  # type: ignore[assignment]
    MapState._apply_map = breaking_map  # type: ignore[method-assign]
    from fasaco_edge.cli import main as run

    sys.exit(run())


if __name__ == "__main__":
    main()
