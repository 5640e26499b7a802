"""What the status, and the answer to a command, say of the order and how far it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fasaco_edge.mission.orders.order_state import OrderState

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


def mission_report(mission: Mission | None, assignment: OrderState) -> dict[str, Any]:
    """Return this part of the status."""
    order, zone = assignment.order, assignment.current_zone
    home = assignment.home
    lattice = mission.lattice if mission else None
    return {
        "ordered": None if order is None else ("itself" if assignment.automatic else "command"),
        "stage": None if order is None else str(assignment.stage),
        "paused": assignment.paused,
        "zone": None if zone is None or zone.polygon is None else zone.name,
        "pass": None if zone is None else assignment.pass_number,
        "passes": None if zone is None else zone.passes,
        "zones": _zones(mission, assignment),
        "keep_out": 0 if order is None else len(order.keep_out),
        "return_home": bool(order and order.return_home),
        "home": None if home is None or lattice is None else _centre(home, lattice.cell_m),
        "tries": assignment.tries,
        "unreached": _unreached(mission),
    }


def _zones(mission: Mission | None, assignment: OrderState) -> list[dict[str, Any]]:
    if mission is None:
        zones = assignment.order.zones if assignment.order else ()
        return [
            {"name": zone.name, "passes": zone.passes, "pass": 0, "cells": 0, "covered": 0}
            for zone in zones
            if zone.polygon is not None
        ]
    return [
        {
            "name": zone.name,
            "passes": zone.passes,
            "pass": zone.begun,
            "cells": zone.cells,
            "covered": zone.covered,
        }
        for zone in mission.zone_progress()
    ]


def _unreached(mission: Mission | None) -> dict[str, Any]:
    if mission is None or mission.lattice is None:
        return {"cells": 0, "m2": 0.0, "areas": [], "areas_left_out": 0}
    found, cell_m = mission.unreached(), mission.lattice.cell_m
    return {
        "cells": found.cells,
        "m2": round(found.cells * cell_m**2, 3),
        "areas": [
            {
                "cells": area.cells,
                "m2": round(area.cells * cell_m**2, 3),
                **_centre(area.cell, cell_m),
                "reason": area.reason,
            }
            for area in found.areas
        ],
        "areas_left_out": found.areas_left_out,
    }


def _centre(cell: tuple[int, int], cell_m: float) -> dict[str, float]:
    row, col = cell
    return {"x": round((col + 0.5) * cell_m, 3), "y": round((row + 0.5) * cell_m, 3)}
