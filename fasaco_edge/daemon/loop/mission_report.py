"""The order in a status, and in the answer to a command: what it is, and how far."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.mission.orders.order_state import OrderState
from fasaco_edge.wire.replies import (
    MissionReport,
    Point,
    UnreachedArea,
    UnreachedReport,
    ZoneReport,
)

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


def mission_report(mission: Mission | None, assignment: OrderState) -> MissionReport:
    """Return this part of the status."""
    order, zone = assignment.order, assignment.current_zone
    home = assignment.home
    lattice = mission.lattice if mission else None
    return MissionReport(
        ordered=None if order is None else ("itself" if assignment.automatic else "command"),
        stage=None if order is None else str(assignment.stage),
        paused=assignment.paused,
        zone=None if zone is None or zone.polygon is None else zone.name,
        pass_number=None if zone is None else assignment.pass_number,
        passes=None if zone is None else zone.passes,
        zones=_zones(mission, assignment),
        keep_out=0 if order is None else len(order.keep_out),
        return_home=bool(order and order.return_home),
        home=None if home is None or lattice is None else Point(*_centre(home, lattice.cell_m)),
        tries=assignment.tries,
        unreached=_unreached(mission),
    )


def _zones(mission: Mission | None, assignment: OrderState) -> tuple[ZoneReport, ...]:
    if mission is None:
        zones = assignment.order.zones if assignment.order else ()
        return tuple(
            ZoneReport(name=zone.name, passes=zone.passes)
            for zone in zones
            if zone.polygon is not None
        )
    return tuple(
        ZoneReport(
            name=zone.name,
            passes=zone.passes,
            pass_number=zone.begun,
            cells=zone.cells,
            covered=zone.covered,
        )
        for zone in mission.zone_progress()
    )


def _unreached(mission: Mission | None) -> UnreachedReport:
    if mission is None or mission.lattice is None:
        return UnreachedReport()
    found, cell_m = mission.unreached(), mission.lattice.cell_m
    areas = tuple(
        UnreachedArea(
            area.cells,
            round(area.cells * cell_m**2, 3),
            *_centre(area.cell, cell_m),
            reason=area.reason,
        )
        for area in found.areas
    )
    m2 = round(found.cells * cell_m**2, 3)
    return UnreachedReport(found.cells, m2, areas, found.areas_left_out)


def _centre(cell: tuple[int, int], cell_m: float) -> tuple[float, float]:
    row, col = cell
    return round((col + 0.5) * cell_m, 3), round((row + 0.5) * cell_m, 3)
