"""The pheromone field: fasaco_msgs/PheromoneGrid, one byte per cell on a log scale.

Trails span orders of magnitude: level l in 1..255 stands for
``trail_min * (trail_max / trail_min) ** ((l - 1) / 254)``, level 0 for a cell that
cannot be covered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire.limits import MAX_GRID_CELLS
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, read_header, refuse, write_header
from fasaco_edge.wire.messages.grids import (
    COLONY,
    COLONY_NAMES,
    read_grid_geometry,
    write_grid_geometry,
)
from fasaco_edge.wire.messages.maps import read_cells, write_cells
from fasaco_edge.wire.schemas import PHEROMONE_GRID

TOP_STEP = 254
"""Steps of the scale between level 1, trail_min, and level 255, trail_max."""


@dataclass(frozen=True, slots=True, eq=False)
class PheromoneMessage:
    """A pheromone field received from the bus.

    Attributes:
        geometry: placement of the cells in the map frame.
        levels: uint8 (rows, cols), read-only: 0 not coverable, 1..255 from ``trail_min``
            to ``trail_max``.
        trail_min, trail_max: bounds of the trail; both 0 if no cell is coverable.
        cohort: number of the cohort that has just walked, from 0.
        velocity: its velocity [cells/move].
        ants: number of ants that have walked so far.
        best_steps: steps of the best walk so far.
        frame: name of the map frame.
        stamp_ns: time of the snapshot [ns].
    """

    geometry: GridGeometry
    levels: NDArray[np.uint8]
    trail_min: float
    trail_max: float
    cohort: int
    velocity: int
    ants: int
    best_steps: int
    frame: str = "map"
    stamp_ns: int = 0

    def trail(self) -> NDArray[np.float32]:
        """Return the trail decoded from the levels, float32 (rows, cols); 0 for level 0."""
        scale = np.zeros(TOP_STEP + 2, np.float32)
        if self.trail_min > 0:
            scale[1:] = np.geomspace(self.trail_min, self.trail_max, TOP_STEP + 1)
        return scale[self.levels]


def encode_pheromone(
    snapshot: ColonySnapshot, frame: str, stamp_ns: int, lattice_deg: float = 0.0
) -> bytes:
    """Return ``snapshot`` as a fasaco_msgs/PheromoneGrid.

    ``lattice_deg`` is the angle of its cells' rows to the x axis of the map frame [deg].
    """
    writer = CdrWriter(PHEROMONE_GRID)
    levels, trail_min, trail_max = _quantised(snapshot.trail, writer.message)
    write_header(writer, frame, stamp_ns)
    plain = GridGeometry.of_cells(snapshot.window, snapshot.cell_m)
    geometry = rotated_geometry(plain, lattice_deg)
    if levels.shape != (geometry.rows, geometry.cols):
        refuse(writer.message, "levels", f"{geometry.rows, geometry.cols}", levels.shape)
    write_grid_geometry(writer, geometry, stamp_ns)
    writer.words(
        COLONY,
        COLONY_NAMES,
        trail_min,
        trail_max,
        snapshot.cohort,
        snapshot.velocity,
        snapshot.ants,
        snapshot.best_steps,
    )
    write_cells(writer, levels, "levels")
    return writer.payload()


def decode_pheromone(payload: bytes) -> PheromoneMessage:
    """Return the pheromone field in a fasaco_msgs/PheromoneGrid."""
    reader = CdrReader(payload, PHEROMONE_GRID)
    frame, stamp_ns = read_header(reader)
    geometry = read_grid_geometry(reader)
    colony = reader.words(COLONY, COLONY_NAMES)
    trail_min, trail_max, cohort, velocity, ants, best_steps = colony
    levels = read_cells(reader, geometry, np.uint8, MAX_GRID_CELLS, "levels")
    empty = trail_min == trail_max == 0.0 and not levels.any()
    if not empty and not 0.0 < trail_min <= trail_max < math.inf:
        expected = "finite with 0 < trail_min <= trail_max, or 0 where no level is above 0"
        refuse(reader.message, "trail_min, trail_max", expected, (trail_min, trail_max))
    return PheromoneMessage(
        geometry, levels, trail_min, trail_max, cohort, velocity, ants, best_steps, frame, stamp_ns
    )


def _quantised(trail: NDArray[np.float32], message: str) -> tuple[NDArray[np.uint8], float, float]:
    """Return the levels of ``trail``, its least positive and its greatest value."""
    present = trail > 0
    lowest, highest = float(trail.min(initial=0.0)), float(trail.max(initial=0.0))
    if not 0.0 <= lowest <= highest < math.inf:
        refuse(message, "trail", "finite and not negative", f"{lowest}..{highest}")
    levels = np.zeros(trail.shape, np.uint8)
    if not present.any():
        return levels, 0.0, 0.0
    least = float(trail[present].min())
    # If all values are equal, their span is 0, and all levels are 1.
    span = math.log(highest) - math.log(least)
    logs = np.log(trail[present].astype(np.float64)) - math.log(least)
    levels[present] = 1 + np.rint(logs * (TOP_STEP / span if span else 0.0)).astype(np.uint8)
    return levels, least, highest
