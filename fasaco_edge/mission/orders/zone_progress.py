"""How far each zone of an order is."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.map.reachable_area import Ground
from fasaco_edge.mission.orders.assignment import Assignment, Stage
from fasaco_edge.mission.orders.zones import counts_in


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
    polygons = tuple(zone.polygon for zone in order.zones if zone.polygon)
    cells = covered = [0] * len(polygons)
    if ground is not None and polygons:
        lattice, reachable = ground.lattice, ground.reachable
        visited = reachable & (ledger.visits(lattice.window) > 0)
        cells = counts_in(polygons, lattice.window, lattice.cell_m, reachable)
        covered = counts_in(polygons, lattice.window, lattice.cell_m, visited)
    found = []
    # Either all zones have polygons, or there is but one, without: for everything.
    for index, counted in enumerate(zip(cells, covered, strict=True)):
        zone = order.zones[index]
        if assignment.stage is not Stage.COVERING or index < assignment.zone:
            begun = zone.passes
        elif index > assignment.zone:
            begun = 0
        else:
            begun = assignment.turn if assignment.begun else assignment.turn - 1
        reached, done = counted
        found.append(ZoneProgress(zone.name, zone.passes, begun, reached, done if begun else 0))
    return found
