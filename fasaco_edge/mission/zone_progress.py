"""How far each zone of an order is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.assignment import Assignment, Stage
from fasaco_edge.mission.ground import Ground
from fasaco_edge.mission.ledger import CoverageLedger
from fasaco_edge.mission.polygons import Polygon, bounds, cells_inside


@dataclass(frozen=True, slots=True)
class ZoneProgress:
    """How far a zone is.

    Attributes:
        name: of the zone.
        passes: how often it is to be covered.
        begun: the number of its newest pass; 0 before the first.
        cells: of it that the robot can reach.
        covered: those of them that are covered in that pass.
    """

    name: str
    passes: int
    begun: int
    cells: int
    covered: int


def zone_progress(
    assignment: Assignment, ground: Ground | None, ledger: CoverageLedger
) -> list[ZoneProgress]:
    """Return how far each zone is, in order; none of an order for everything."""
    order = assignment.order
    if order is None:
        return []
    found = []
    for index, zone in enumerate(order.zones):
        if zone.polygon is None:
            continue
        if assignment.stage is not Stage.COVERING or index < assignment.zone:
            begun = zone.passes
        elif index > assignment.zone:
            begun = 0
        else:
            begun = assignment.turn if assignment.begun else assignment.turn - 1
        cells, covered = _counts(zone.polygon, ground, ledger)
        found.append(ZoneProgress(zone.name, zone.passes, begun, cells, covered if begun else 0))
    return found


def _counts(polygon: Polygon, ground: Ground | None, ledger: CoverageLedger) -> tuple[int, int]:
    if ground is None:
        return 0, 0
    lattice = ground.lattice
    x0, y0, x1, y1 = (value / lattice.cell_m for value in bounds(polygon))
    around = Window(math.floor(y0), math.floor(x0), math.ceil(y1), math.ceil(x1))
    window = around.intersection(lattice.window)
    if window is None:
        return 0, 0
    inside = cells_inside(polygon, window, lattice.cell_m)
    inside &= ground.reachable[window.slices_in(lattice.window)]
    covered = inside & (ledger.visits(window) > 0)
    return int(np.count_nonzero(inside)), int(np.count_nonzero(covered))
