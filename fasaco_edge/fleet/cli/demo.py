"""Starting places of a fleet's robots in a demo."""

from __future__ import annotations

import numpy as np

from fasaco_edge.errors import StartBlocked
from fasaco_edge.fleet.mission.travel import cell_of
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.lattice.ways import FAR, ways_from
from fasaco_edge.mission.map.reachable_area import anchor_cell


def apart(lattice: CoverageLattice, first: Point, count: int) -> list[Point]:
    """Return places, each with the largest walking distance from all earlier ones."""
    start = anchor_cell(lattice, Pose2D(*first))
    if start is None:
        raise StartBlocked(f"the robot does not fit where it starts, {first} m")
    row, col = lattice.local(start)
    cols = lattice.steps.shape[1]
    nearest = ways_from(lattice.steps, row * cols + col)
    nearest[nearest >= FAR] = 0
    places: list[Point] = []
    for _ in range(count):
        flat = int(nearest.argmax())
        if nearest[flat] <= 0:
            raise StartBlocked(
                f"there is no place for a robot beside the other {len(places) + 1}",
                hint="let fewer robots start",
            )
        ((x, y),) = lattice.centres(np.array([cell_of(lattice, flat)], np.int32)).tolist()
        places.append((x, y))
        nearest = np.minimum(nearest, ways_from(lattice.steps, flat))
    return places
